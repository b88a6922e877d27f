"""LightWare laser rangefinders, binary protocol LWNX: LW20 / SF20, SF45, LW24 and their families.

Document: LightWare LW20 product guide, "Serial interface", "Detailed command descriptions" (LW20-docs); LW24 product
guide, version 0, pages 21-32 (the same packet, another table of outputs, which the SF45 shares).

    byte   0    1-2                              3     4...      last 2
           AA | flags, little-endian           | id  | data    | CRC-16/XMODEM, little-endian, over all before it
                bits 6-15 payload length (id and data), bit 0 write

    44 distance data [cm], int16 each    45 distance data [mm], int32 each    which: command 27 Distance output, bits
    0 product name    27 distance output    30 stream (5: 44; 6: 45)    50 laser firing    94 zero offset [mm]

    bit   sf20                    sf45, lw24
     0    first return raw        first return raw
     1    first return closest    first return filtered
     2    first return median     first return strength [%]
     3    first return furthest   last return raw
     4    first return strength   last return filtered
     5    last return raw         last return strength [%]
     6    last return closest     background noise
     7    last return median      temperature [degC / 100]
     8    last return furthest    yaw angle [deg / 100] (SF45)
     9    last return strength
    10    background noise

A packet does not identify its outputs: they are those configured after the connect (``outputs``).  A packet of another
length is counted as "distance_of_other_outputs" and not decoded.

Without a return the distance is -1000 mm (SF20 product guide of the newer firmware, command 95, which also sets the
number of missed returns).  Negative distances and those in ``lost_m``, the ones of the text protocol
(``lightware_ascii``), mean a lost signal, because the behaviour of older firmware is unknown; a true distance of
exactly that centimetre is lost as well.  The stream number is a byte in the guide of the LW20 and a uint32 in the
others: four bytes are sent.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, key
from fti.drivers import Command, Counters
from fti.drivers._arguments import check_complete
from fti.drivers._framing import FramedDecoder, Framer, Skip, skip_to
from fti.drivers._no_commands import poll  # noqa: F401 - the device streams
from fti.drivers._rangefinder import LOST_M, make_range, wire_distance
from fti.formats.unit_factors import DEGREE
from fti.messages.measurements import Ack, Measurement, Range, Reading, Stamp

DOCUMENT = "LightWare LW20 product guide (LWNX serial interface, commands); LW24 product guide version 0, p. 21-32"
MESSAGES = {
    "distance": "slant range, and strength, noise, temperature as configured (44, 45)",
    "distance_of_other_outputs": "distance data (44, 45) of another length than the configured outputs have",
    "product_name": "answer to identify (0)",
    "distance_output": "answer to the setting of the outputs (27)",
    "stream": "answer to the setting of the stream (30)",
    "laser_firing": "answer to laser (50)",
    "zero_offset": "answer to zero_offset (94)",
    "(other)": "another packet, by its number",
}
CARRIERS = frozenset({"serial", "udp"})

START = b"\xaa"
OVERHEAD = 5  # start, flags, CRC; the identifier counts as payload
MAX_PACKET_BYTES = 1023 + OVERHEAD
NAME, OUTPUT, STREAM, CM, MM, FIRING, OFFSET = 0, 27, 30, 44, 45, 50, 94
ANSWERS = {
    NAME: ("product_name", "identify"),
    OUTPUT: ("distance_output", ""),
    STREAM: ("stream", "stream"),
    FIRING: ("laser_firing", "laser"),
    OFFSET: ("zero_offset", "zero_offset"),
}
LAYOUTS = {
    "sf20": ("first_raw", "first_closest", "first_median", "first_furthest", "first_strength", "last_raw",
             "last_closest", "last_median", "last_furthest", "last_strength", "noise"),
    "sf45": ("first_raw", "first_filtered", "first_strength", "last_raw", "last_filtered", "last_strength", "noise",
             "temperature", "yaw_angle"),
}  # fmt: skip
#: Factor and unit of outputs other than distances.
READINGS = {
    "first_strength": (1.0, "%"),
    "last_strength": (1.0, "%"),
    "noise": (1.0, ""),
    "temperature": (0.01, "degC"),
    "yaw_angle": (0.01 * DEGREE, "rad"),
}
COMMANDS: Mapping[str, Command] = {
    "identify": Command("name of the product"),
    "laser": Command("switch the laser", {"state": "on or off"}),
    "zero_offset": Command("move the zero of the measurement away from the sensor", {"mm": "-10000 to 10000 mm"}),
    "stream": Command("start or stop the stream of distances", {"state": "on or off"}),
}


class Options(StrictModel):
    """Options of a laser with binary packets."""

    family: Annotated[Literal["sf20", "sf45"], key("family of the device: it defines the outputs", NO_UNIT)] = "sf20"
    outputs: Annotated[tuple[str, ...], key("outputs that are enabled in the device, by name", NO_UNIT)] = (
        "first_raw",
        "first_strength",
    )
    distance: Annotated[str, key("output that becomes the range", NO_UNIT)] = "first_raw"
    unit: Annotated[
        Literal["cm", "mm"], key("unit of the distances; mm if the device supports it (command 45)", NO_UNIT)
    ] = "cm"
    lost_m: Annotated[
        tuple[Annotated[float, Field(ge=0)], ...], key("distances that mean that there is no return", "m")
    ] = LOST_M


class OutputLayout:
    """The outputs of the options in the order of their bits.  Raises ValueError for an unknown one."""

    def __init__(self, options: Options) -> None:
        names = LAYOUTS[options.family]
        for name in options.outputs:
            if name not in names:
                raise ValueError(f"outputs: {name!r}; {options.family} has {', '.join(names)}")
        distances = [n for n in names if n in options.outputs and n not in READINGS]
        if options.distance not in distances:
            raise ValueError(f"distance = {options.distance!r}: must be one of the outputs: {', '.join(distances)}")
        self.names = tuple(n for n in names if n in options.outputs)
        self.distance, self.lost_m = options.distance, options.lost_m
        self.bits = sum(1 << names.index(n) for n in self.names)
        self.command, self.metre = (CM, 0.01) if options.unit == "cm" else (MM, 0.001)
        self.form = struct.Struct(f"<{len(self.names)}{'h' if options.unit == 'cm' else 'i'}")


def make_packet(command_id: int, data: bytes = b"", write: bool = False) -> bytes:
    """A whole packet."""
    head = START + struct.pack("<HB", (1 + len(data)) << 6 | write, command_id) + data
    return head + struct.pack("<H", binascii.crc_hqx(head, 0))


def decode_distance(data: bytes, layout: OutputLayout, stamp: Stamp) -> list[Measurement]:
    """Readings and then the range [m] from the data of 44 or 45."""
    values = dict(zip(layout.names, layout.form.unpack(data), strict=True))
    readings: list[Measurement] = [
        Reading(stamp=stamp, name=name, value=values[name] * factor, unit=unit)
        for name, (factor, unit) in READINGS.items()
        if name in values
    ]
    return [*readings, make_range(stamp, values[layout.distance] * layout.metre, layout.lost_m)]


def decode_answer(command_id: int, data: bytes, stamp: Stamp) -> tuple[str, list[Measurement]]:
    """Name of the message, and the acknowledgement when it answers a command."""
    if command_id not in ANSWERS:
        return str(command_id), []
    name, answered = ANSWERS[command_id]
    text = data.split(b"\0")[0].decode("ascii", errors="replace") if command_id == NAME else data.hex()
    return name, [Ack(stamp=stamp, command=answered, accepted=True, detail=text)] if answered else []


def measure(buffer: bytearray) -> int | Skip:
    """Size of the packet at the start of the buffer, or a Skip; see ``_framing``."""
    if skip := skip_to(buffer, START):
        return skip
    if len(buffer) < 3:
        return 0
    flags = int.from_bytes(buffer[1:3], "little")
    length = (flags >> 6) + OVERHEAD
    if flags >> 6 == 0 or flags & 0x3E:
        return Skip(1, "bad_length")
    if len(buffer) < length:
        return 0
    stated = int.from_bytes(buffer[length - 2 : length], "little")
    return length if binascii.crc_hqx(buffer[: length - 2], 0) == stated else Skip(1, "bad_checksum")


class Decoder(FramedDecoder):
    """Packets to Range, Reading and Ack.  Raises ValueError if the outputs do not fit the family."""

    def __init__(self, options: Options) -> None:
        super().__init__(measure, MAX_PACKET_BYTES + 1)
        self._layout = OutputLayout(options)

    def _decode(self, frame: bytes, t_rx_ns: int) -> tuple[str, list[Measurement]]:
        command_id, data, stamp = frame[3], frame[4:-2], Stamp(t_rx_ns)
        if command_id not in (CM, MM):
            return decode_answer(command_id, data, stamp)
        if command_id != self._layout.command or len(data) != self._layout.form.size:
            return "distance_of_other_outputs", []
        return "distance", decode_distance(data, self._layout, stamp)


class Encoder:
    """The emulated rangefinder: distance data for each Range, with the preceding readings."""

    def __init__(self, options: Options) -> None:
        self._layout = OutputLayout(options)
        self._readings: dict[str, float] = {}
        self._request_framer = Framer(measure, Counters(), limit=MAX_PACKET_BYTES + 1)

    def encode(self, measurement: Measurement) -> list[bytes]:
        if isinstance(measurement, Reading) and measurement.name in READINGS:
            self._readings[measurement.name] = measurement.value or 0.0
        if not isinstance(measurement, Range):
            return []
        layout = self._layout
        largest = (1 << 8 * layout.form.size // len(layout.names) - 1) - 1
        values = [self._value(name, measurement) for name in layout.names]
        return [make_packet(layout.command, layout.form.pack(*(min(max(round(v), -1), largest) for v in values)))]

    def _value(self, name: str, measurement: Range) -> float:
        if name in READINGS:
            return self._readings.get(name, 0.0) / READINGS[name][0]
        return wire_distance(measurement, self._layout.lost_m) / self._layout.metre

    def respond(self, data: bytes) -> list[bytes]:
        return [_answer(packet) for _, packet in self._request_framer.feed(data, 0)]


def _answer(packet: bytes) -> bytes:
    """Answer to a request: the name, or the written data."""
    return make_packet(NAME, b"SF20".ljust(16, b"\0")) if packet[3] == NAME else make_packet(packet[3], packet[4:-2])


make_decoder, make_encoder = Decoder, Encoder


def on_connect(options: Options) -> list[bytes]:
    """Wake serial port and protocol, each of which loses a request; then set the outputs and the stream."""
    layout = OutputLayout(options)
    return [
        *[make_packet(NAME)] * 3,
        make_packet(OUTPUT, struct.pack("<I", layout.bits), write=True),
        make_packet(STREAM, struct.pack("<I", _stream(options)), write=True),
    ]


def _stream(options: Options) -> int:
    return 5 if options.unit == "cm" else 6


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The bytes of a command.  Raises ValueError."""
    check_complete(COMMANDS, name, args)
    if name == "identify":
        return make_packet(NAME)
    if name == "zero_offset":
        return make_packet(OFFSET, struct.pack("<i", _millimetres(args["mm"])), write=True)
    if args["state"] not in ("on", "off"):
        raise ValueError(f"{name}: state = {args['state']!r}: must be on or off")
    on = args["state"] == "on"
    if name == "laser":
        return make_packet(FIRING, bytes([on]), write=True)
    return make_packet(STREAM, struct.pack("<I", _stream(options or Options()) if on else 0), write=True)


def _millimetres(text: str) -> int:
    try:
        mm = int(text)
    except ValueError:
        mm = 10_001
    if not -10_000 <= mm <= 10_000:
        raise ValueError(f"zero_offset: mm = {text!r}: must be a whole number from -10000 to 10000")
    return mm
