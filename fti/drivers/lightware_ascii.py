r"""LightWare laser rangefinders, the text of their serial port: SF02, SF10, SF11, SF30 lines, and the LW20 / SF20.

Document: LightWare SF11 Laser altimeter product manual (menu n, appendix "Command set"); LW20 / SF20 LiDAR sensor
product manual, appendix C.  What ArduPilot reads (AP_RangeFinder_LightWareSerial) says the same.

    query = "none"   <metres>\r                 by itself; two decimals, CR or CR LF
    query = "d"      d -> <metres>\r\n          the "legacy" question of every model
    query = "ldf"    ?LDF,1\r\n -> ldf,1:<metres>\r\n     first return, raw; LW20, SF20

    LW20 commands: <type><channel><parameter>,<value>\r\n; type ? reads, # changes, % saves; the answer is the name
    in small letters, ":", and the value; "$" before it when it is streamed.  Its serial port sleeps until it hears
    something: www\r\n.

Without a return the device still says a distance: 130.00 (SF11, menu n), and on other models 160.00, 230.00, 250.00
(ArduPilot; which model says which is open) or a negative one.  All of these are a lost signal by default
(``lost_m``).  A true distance of just that centimetre cannot be told from it and is lost, too; with a model that
reaches further than 130 m, name the one that it says.  Whether a zero offset moves them, too, is open: look, and
say what you see in ``lost_m``.  Menu n offers "hold last result": never choose it.

Nothing protects a line: a digit lost in its middle by the line's noise goes unnoticed.  What can be seen is refused:
other than two decimals, signs, letters, and a line whose beginning was not seen.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from fti.config import Positive, StrictModel
from fti.drivers import Command, Counters
from fti.drivers._arguments import check_complete
from fti.drivers._line_framing import FirstLine, LineFramer
from fti.drivers._polled_device import PolledDevice
from fti.drivers._rangefinder import LOST_M, make_range, wire_distance
from fti.types import Ack, Measurement, Range, Stamp

DOCUMENT = "LightWare SF11 product manual (menu n, command set); LW20 / SF20 product manual, appendix C"
MESSAGES = {
    "distance": "slant range to the first return, or a lost signal",
    "(other)": "another answer of an LW20, by its name; many different ones together",
}
CARRIERS = frozenset({"serial", "udp"})

MAX_LINE_BYTES = 64
#: So many names are counted; noise has more, and they are "(other)" together.
MAX_NAMES = 64
DISTANCE = re.compile(rb" *(-?\d{1,4}\.\d\d) *")
ANSWER = re.compile(rb"\$?(%?[a-z]{1,4})(?:,\d)?:([\x20-\x7e]{0,32})")
LDF_ANSWER = re.compile(rb"\$?ldf,1:(-?\d{1,4}\.\d\d)")
QUESTIONS = {"none": b"", "d": b"d", "ldf": b"?LDF,1\r\n"}
WAKE = b"www\r\n"
COMMANDS: Mapping[str, Command] = {
    "identify": Command("name, firmware and hardware version (query = ldf)"),
    "laser": Command("switch the laser (query = ldf)", {"state": "on or off"}),
    "zero_offset": Command(
        "move the zero of the measurement away from the sensor (query = ldf)", {"metres": "-10 to 10 m"}
    ),
    "save": Command("keep the settings of the laser when it is switched off (query = ldf)"),
}
#: Name of an answer: the command that it answers.
ANSWER_COMMANDS = {b"p": "identify", b"lf": "laser", b"lo": "zero_offset", b"%p": "save"}


class Options(StrictModel):
    """``query``: what the device is asked, every ``poll_s``; ``lost_m``: distances that mean "no return" [m].

    ``first_line``: "take" where the first bytes after a connect begin a line (each datagram a line).
    """

    query: Literal["none", "d", "ldf"] = "none"
    poll_s: Positive = 0.1
    lost_m: tuple[Annotated[float, Field(ge=0)], ...] = LOST_M
    first_line: FirstLine = "skip"


def read_distance(line: bytes, query: str) -> float | None:
    """The distance [m] in a line without its end; None when it carries none.

    With query = "ldf" a number alone is the end of an answer.
    """
    found = LDF_ANSWER.fullmatch(line) or (None if query == "ldf" else DISTANCE.fullmatch(line))
    return float(found[1]) if found else None


def decode_answer(line: bytes, stamp: Stamp) -> tuple[str, list[Measurement]]:
    """Name of an LW20's answer, and the acknowledgement when it answers a command."""
    found = ANSWER.fullmatch(line)
    assert found is not None
    name = found[1].decode("ascii")
    if found[1] not in ANSWER_COMMANDS:
        return name, []
    return name, [Ack(stamp=stamp, command=ANSWER_COMMANDS[found[1]], accepted=True, detail=found[2].decode("ascii"))]


class Decoder:
    """Lines of the rangefinder to Range, and of an LW20 to Ack."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._options = options
        begun = options.first_line == "take" or options.query == "ldf"  # there the line says that it begins
        self._framer = LineFramer(self._refuse, self.counters, longest=MAX_LINE_BYTES, begun=begun)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        found: list[Measurement] = []
        for t_ns, frame in self._framer.feed(data, t_rx_ns):
            if len(frame) > 1:
                found += self._decode(frame[:-1], Stamp(t_ns))
        return found

    def _refuse(self, line: bytes) -> str:
        if read_distance(line, self._options.query) is not None:
            return ""
        return "" if self._options.query == "ldf" and ANSWER.fullmatch(line) else "no_distance"

    def _decode(self, line: bytes, stamp: Stamp) -> list[Measurement]:
        distance = read_distance(line, self._options.query)
        if distance is not None:
            self.counters.messages["distance"] += 1
            return [make_range(stamp, distance, self._options.lost_m)]
        name, found = decode_answer(line, stamp)
        messages = self.counters.messages
        messages[name if name in messages or len(messages) < MAX_NAMES else "(other)"] += 1
        return found


def encode_distance(distance: float, query: str) -> bytes:
    """The line for a distance [m], which may be one that means "no return"."""
    metres = f"{distance:.2f}"
    return {"none": f"{metres}\r", "d": f"{metres}\r\n", "ldf": f"ldf,1:{metres}\r\n"}[query].encode("ascii")


class Encoder:
    """The rangefinder's end of the line: a line for each Range, at once or when it is asked."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._polled_device = PolledDevice(QUESTIONS[options.query])
        self._heard = b""

    def encode(self, measurement: Measurement) -> list[bytes]:
        if not isinstance(measurement, Range):
            return []
        distance = wire_distance(measurement, self._options.lost_m)
        return self._polled_device.offer([encode_distance(distance, self._options.query)])

    def respond(self, data: bytes) -> list[bytes]:
        answers = self._polled_device.respond(data)
        if self._options.query != "ldf":
            return answers
        *lines, rest = (self._heard + data).split(b"\r\n")
        self._heard = rest[-MAX_LINE_BYTES:]
        return answers + [answer for line in lines for answer in _execute(line)]


def _execute(line: bytes) -> list[bytes]:
    """What an LW20 answers to a command."""
    if line == b"?P":
        return [b"p:LW20,1.0,1.0\r\n"]
    if line == b"%P":
        return [b"%p:\r\n"]
    if found := re.fullmatch(rb"#(LF|LO),(-?[\d.]{1,8})", line):
        return [found[1].lower() + b":" + found[2] + b"\r\n"]
    return []


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder."""
    return Decoder(options)


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder."""
    return Encoder(options)


def on_connect(options: Options) -> list[bytes]:
    """An LW20 is woken."""
    return [WAKE] if options.query == "ldf" else []


def poll(options: Options) -> tuple[float, bytes] | None:
    """The question of ``query``."""
    return (options.poll_s, QUESTIONS[options.query]) if options.query != "none" else None


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The bytes of a command to an LW20 or SF20.  Raises ValueError."""
    check_complete(COMMANDS, name, args)
    if options is not None and options.query != "ldf":
        raise ValueError(f"{name}: only an LW20 or SF20 takes commands, and query = {options.query!r} is none")
    if name == "laser":
        return b"#LF,%d\r\n" % _switch(args["state"])
    if name == "zero_offset":
        return f"#LO,{_metres(args['metres']):.2f}\r\n".encode("ascii")
    return b"?P\r\n" if name == "identify" else b"%P\r\n"


def _switch(text: str) -> bool:
    if text not in ("on", "off"):
        raise ValueError(f"laser: state = {text!r}: must be on or off")
    return text == "on"


def _metres(text: str) -> float:
    try:
        metres = float(text)
    except ValueError:
        metres = float("nan")
    if not -10.0 <= metres <= 10.0:
        raise ValueError(f"zero_offset: metres = {text!r}: must be -10 to 10")
    return metres
