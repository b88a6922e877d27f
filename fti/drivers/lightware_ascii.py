r"""LightWare laser rangefinders, text protocol of the serial port: SF02, SF10, SF11, SF30, LW20 / SF20.

Document: LightWare SF11 Laser altimeter product manual (menu n, appendix "Command set"); LW20 / SF20 LiDAR sensor
product manual, appendix C.  ArduPilot (AP_RangeFinder_LightWareSerial) agrees.

    query = "none"   <metres>\r                 without request; two decimals, CR or CR LF
    query = "d"      d -> <metres>\r\n          the "legacy" request of every model
    query = "ldf"    ?LDF,1\r\n -> ldf,1:<metres>\r\n     first return, raw; LW20, SF20

    LW20 commands: <type><channel><parameter>,<value>\r\n; type ? reads, # changes, % saves; the answer is the name
    in lower case, ":", and the value; "$" precedes a streamed one.  Its serial port sleeps until it receives data:
    www\r\n.

Without a return the device sends a special distance: 130.00 (SF11, menu n), on other models 160.00, 230.00, 250.00
(ArduPilot; the models are unknown) or a negative one.  By default all of these mean a lost signal (``lost_m``).  A true
distance of exactly that centimetre is lost as well; for a model with a range above 130 m, configure its own special
distance.  It is unknown whether a zero offset shifts these distances: check your device, and set ``lost_m``
accordingly.  Never select "hold last result" in menu n.

A line has no checksum: a digit lost inside it is not detected.  Detectable errors are rejected: a wrong number of
decimals, signs, letters, and a line with a missing beginning.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from fti.config import Positive, StrictModel
from fti.config.keys import NO_UNIT, key
from fti.drivers import Command, Counters
from fti.drivers._arguments import check_complete, number_or_nan
from fti.drivers._line_framing import FirstLine, LineFramer
from fti.drivers._polled_device import PolledDevice
from fti.drivers._rangefinder import LOST_M, make_range, wire_distance
from fti.messages.measurements import Ack, Measurement, Range, Stamp

DOCUMENT = "LightWare SF11 product manual (menu n, command set); LW20 / SF20 product manual, appendix C"
MESSAGES = {
    "distance": "slant range to the first return, or a lost signal",
    "(other)": "another answer of an LW20, by its name; or (other) beyond a limit",
}
CARRIERS = frozenset({"serial", "udp"})

MAX_LINE_BYTES = 64
#: Limit of separately counted names; noise would create more.
MAX_NAMES = 64
DISTANCE = re.compile(rb" *(-?\d{1,4}\.\d\d) *")
ANSWER = re.compile(rb"\$?(%?[a-z]{1,4})(?:,\d)?:([\x20-\x7e]{0,32})")
LDF_ANSWER = re.compile(rb"\$?ldf,1:(-?\d{1,4}\.\d\d)")
REQUESTS = {"none": b"", "d": b"d", "ldf": b"?LDF,1\r\n"}
WAKE = b"www\r\n"
COMMANDS: Mapping[str, Command] = {
    "identify": Command("name, firmware and hardware version (query = ldf)"),
    "laser": Command("switch the laser (query = ldf)", {"state": "on or off"}),
    "zero_offset": Command(
        "move the zero of the measurement away from the sensor (query = ldf)", {"metres": "-10 to 10 m"}
    ),
    "save": Command("store the settings of the laser (query = ldf)"),
}
#: Name of an answer: the command that it answers.
ANSWER_COMMANDS = {b"p": "identify", b"lf": "laser", b"lo": "zero_offset", b"%p": "save"}


class Options(StrictModel):
    """Options of a laser with text lines."""

    query: Annotated[
        Literal["none", "d", "ldf"],
        key(
            "request of a distance; none: the device sends without requests; d: of every model; ldf: first return of "
            "an LW20 or SF20",
            NO_UNIT,
        ),
    ] = "none"
    poll_s: Annotated[Positive, key("period of the requests", "s")] = 0.1
    lost_m: Annotated[
        tuple[Annotated[float, Field(ge=0)], ...], key("distances that mean that there is no return", "m")
    ] = LOST_M
    first_line: Annotated[
        FirstLine,
        key(
            "the first bytes after a connect; skip: they may be the end of a line; take: they begin a line, as in "
            "datagrams",
            NO_UNIT,
        ),
    ] = "skip"


def read_distance(line: bytes, query: str) -> float | None:
    """The distance [m] in a line without its end; None without one.

    With query = "ldf" a bare number is the end of a damaged answer.
    """
    match = LDF_ANSWER.fullmatch(line) or (None if query == "ldf" else DISTANCE.fullmatch(line))
    return float(match[1]) if match else None


def decode_answer(line: bytes, stamp: Stamp) -> tuple[str, list[Measurement]]:
    """Name of an LW20's answer, and the acknowledgement when it answers a command."""
    match = ANSWER.fullmatch(line)
    assert match is not None
    name = match[1].decode("ascii")
    if match[1] not in ANSWER_COMMANDS:
        return name, []
    return name, [Ack(stamp=stamp, command=ANSWER_COMMANDS[match[1]], accepted=True, detail=match[2].decode("ascii"))]


class Decoder:
    """Lines of the rangefinder to Range, and of an LW20 to Ack."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._options = options
        is_line = options.first_line == "take" or options.query == "ldf"  # ldf answers have a prefix
        self._framer = LineFramer(self._refuse, self.counters, max_length=MAX_LINE_BYTES, starts_with_line=is_line)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        measurements: list[Measurement] = []
        for t_ns, frame in self._framer.feed(data, t_rx_ns):
            if len(frame) > 1:
                measurements += self._decode(frame[:-1], Stamp(t_ns))
        return measurements

    def _refuse(self, line: bytes) -> str:
        if read_distance(line, self._options.query) is not None:
            return ""
        return "" if self._options.query == "ldf" and ANSWER.fullmatch(line) else "no_distance"

    def _decode(self, line: bytes, stamp: Stamp) -> list[Measurement]:
        distance = read_distance(line, self._options.query)
        if distance is not None:
            self.counters.messages["distance"] += 1
            return [make_range(stamp, distance, self._options.lost_m)]
        name, measurements = decode_answer(line, stamp)
        messages = self.counters.messages
        messages[name if name in messages or len(messages) < MAX_NAMES else "(other)"] += 1
        return measurements


def encode_distance(distance: float, query: str) -> bytes:
    """The line for a distance [m], which may be one that means "no return"."""
    metres = f"{distance:.2f}"
    return {"none": f"{metres}\r", "d": f"{metres}\r\n", "ldf": f"ldf,1:{metres}\r\n"}[query].encode("ascii")


class Encoder:
    """The emulated rangefinder: a line for each Range, at once or on request."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._polled_device = PolledDevice(REQUESTS[options.query])
        self._pending = b""

    def encode(self, measurement: Measurement) -> list[bytes]:
        if not isinstance(measurement, Range):
            return []
        distance = wire_distance(measurement, self._options.lost_m)
        return self._polled_device.offer([encode_distance(distance, self._options.query)])

    def respond(self, data: bytes) -> list[bytes]:
        answers = self._polled_device.respond(data)
        if self._options.query != "ldf":
            return answers
        *lines, rest = (self._pending + data).split(b"\r\n")
        self._pending = rest[-MAX_LINE_BYTES:]
        return answers + [answer for line in lines for answer in _execute(line)]


def _execute(line: bytes) -> list[bytes]:
    """Answers of an LW20 to a command."""
    if line == b"?P":
        return [b"p:LW20,1.0,1.0\r\n"]
    if line == b"%P":
        return [b"%p:\r\n"]
    if match := re.fullmatch(rb"#(LF|LO),(-?[\d.]{1,8})", line):
        return [match[1].lower() + b":" + match[2] + b"\r\n"]
    return []


make_decoder, make_encoder = Decoder, Encoder


def on_connect(options: Options) -> list[bytes]:
    """Wake an LW20."""
    return [WAKE] if options.query == "ldf" else []


def poll(options: Options) -> tuple[float, bytes] | None:
    """The request of ``query``."""
    return (options.poll_s, REQUESTS[options.query]) if options.query != "none" else None


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The bytes of a command to an LW20 or SF20.  Raises ValueError."""
    check_complete(COMMANDS, name, args)
    if options is not None and options.query != "ldf":
        raise ValueError(f"{name}: needs query = 'ldf' (LW20, SF20); it is {options.query!r}")
    if name == "laser":
        if args["state"] not in ("on", "off"):
            raise ValueError(f"laser: state = {args['state']!r}: must be on or off")
        return b"#LF,%d\r\n" % (args["state"] == "on")
    if name == "zero_offset":
        metres = number_or_nan(args["metres"])
        if not -10.0 <= metres <= 10.0:
            raise ValueError(f"zero_offset: metres = {args['metres']!r}: must be -10 to 10")
        return f"#LO,{metres:.2f}\r\n".encode("ascii")
    return b"?P\r\n" if name == "identify" else b"%P\r\n"
