"""FreeFlight RA-4000 / RA-4500 radar altimeter, RS-232, 25 Hz.

Document: FreeFlight 84629 names the interface; its byte table is not public.  The layout is the one that a public
airborne logger decodes (third party):

    byte  0  1  2  | 3  4          | 5      | 6        | 7  8
          10 DF 03 | altitude [ft] | status | checksum | 10 03       altitude: u16, big-endian

    status bit 0 ascending, 1 self test, 2 failure, 3 unlocked or invalid, 4 in air

Unknown, therefore options: the algorithm of byte 6 (default: not checked) and DLE stuffing (default: none).  0x10 may
occur inside the data; the trailer confirms a frame.  The driver ``arinc429`` decodes the ARINC 429 output, label 164.
Its range ends at 8192 ft, so larger heights are not valid: all bits set, or a few feet below zero on the ground if the
number is signed (unknown), would be 20 km.

Quantisation: ``fti.ranging.radar.quantise``.  Sigma is the root sum square of step / sqrt(12) and of the assumed
accuracy of the instrument: ``sd_ft``, and ``sd_percent`` of the height.  The accuracy is not published: both are 0 by
default, so that sigma is that of the step only.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, Literal

from pydantic import Field

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, key
from fti.constants import FOOT
from fti.drivers import Counters
from fti.drivers._framing import Framer, Skip, skip_to
from fti.drivers._no_commands import COMMANDS, command, on_connect, poll  # noqa: F401 - the rest of the contract
from fti.messages.measurements import DeviceStatus, Measurement, RadioHeight, Stamp
from fti.ranging.radar.quantise import quantisation_step_ft, quantise_ft

DOCUMENT = "FreeFlight 84629 (interface); layout as decoded by a public airborne logger"
MESSAGES = {"height": "radio height and status of the altimeter"}
CARRIERS = frozenset({"serial", "udp"})

HEADER = b"\x10\xdf\x03"
TRAILER = b"\x10\x03"
DLE = 0x10
BODY = 4  # altitude, status, checksum
STATUS_FLAGS = {0: "ascending", 1: "self_test", 2: "failure", 3: "unlocked", 4: "in_air"}
INVALIDATING = ("self_test", "failure", "unlocked")
FULL_SCALE_FT = 8192
#: A port is reopened after 0.1 s at the earliest; the bytes of a frame arrive with shorter pauses.
FRAME_TIMEOUT_NS = 100_000_000
NotNegative = Annotated[float, Field(ge=0)]


class Options(StrictModel):
    """Options of a radar altimeter."""

    checksum: Annotated[
        Literal["none", "xor", "sum"], key("algorithm of byte 6 over bytes 3 to 5; none: it is not checked", NO_UNIT)
    ] = "none"
    dle_stuffing: Annotated[bool, key("a byte 0x10 in the data is sent twice", NO_UNIT)] = False
    sd_ft: Annotated[NotNegative, key("constant part of the 1-sigma of the instrument", "ft")] = 0.0
    sd_percent: Annotated[
        NotNegative, key("part of the 1-sigma of the instrument in proportion to the height", "%")
    ] = 0.0


def _checksum(rule: str, data: bytes) -> int:
    if rule == "xor":
        return functools.reduce(lambda a, b: a ^ b, data, 0)
    return sum(data) & 0xFF if rule == "sum" else 0


def sigma_ft(height_ft: float, options: Options) -> float:
    """One sigma [ft] of an altitude [ft]: of the step and of the instrument."""
    step = quantisation_step_ft(height_ft) / math.sqrt(12)
    return math.hypot(step, options.sd_ft, options.sd_percent / 100.0 * height_ft)


def decode_height(body: bytes, t_rx_ns: int, options: Options) -> list[Measurement]:
    """Altitude and status of the four body bytes, in metres and flags."""
    height_ft = int.from_bytes(body[:2], "big")
    flags = tuple(name for bit, name in STATUS_FLAGS.items() if body[2] >> bit & 1)
    ok = not any(flag in INVALIDATING for flag in flags)
    stamp = Stamp(t_rx_ns)
    sd = sigma_ft(height_ft, options) * FOOT
    return [
        DeviceStatus(stamp=stamp, ok=ok, flags=flags),
        RadioHeight(stamp=stamp, height_agl=height_ft * FOOT, sd=sd, valid=ok and height_ft < FULL_SCALE_FT),
    ]


def encode_height(height_agl: float, flags: tuple[str, ...], options: Options) -> bytes:
    """One frame; the height [m] is quantised like in the instrument."""
    status = sum(1 << bit for bit, name in STATUS_FLAGS.items() if name in flags)
    body = quantise_ft(height_agl / FOOT).to_bytes(2, "big") + bytes([status])
    body += bytes([_checksum(options.checksum, body)])
    if options.dle_stuffing:
        body = body.replace(bytes([DLE]), bytes([DLE, DLE]))
    return HEADER + body + TRAILER


class Decoder:
    """Frames of the altimeter to RadioHeight and DeviceStatus."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._options = options
        self._framer = Framer(self._measure, self.counters, limit=64)
        self._last_ns = 0

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        measurements: list[Measurement] = []
        if self.counters.held and t_rx_ns - self._last_ns >= FRAME_TIMEOUT_NS:
            # Discard a partial frame before a pause: its rest may be missing.
            self.counters.skipped["pause"] += self.counters.held
            self.counters.held = 0
            self._framer = Framer(self._measure, self.counters, limit=64)
        self._last_ns = t_rx_ns
        for stamp, frame in self._framer.feed(data, t_rx_ns):
            self.counters.messages["height"] += 1
            measurements += decode_height(self._body(frame)[:BODY], stamp, self._options)
        return measurements

    def _body(self, buffer: bytes | bytearray) -> bytes:
        """The received part of the body, without stuffing."""
        inner = bytes(buffer[len(HEADER) :])
        return inner.replace(bytes([DLE, DLE]), bytes([DLE])) if self._options.dle_stuffing else inner

    def _measure(self, buffer: bytearray) -> int | Skip:
        if skip := skip_to(buffer, HEADER):
            return skip
        length = self._length(buffer)
        if isinstance(length, Skip):
            return length
        if length == 0 or len(buffer) < length:
            return 0
        if buffer[length - 2 : length] != TRAILER:
            return Skip(1, "bad_trailer")
        body = self._body(buffer[: length - 2])
        if self._options.checksum != "none" and _checksum(self._options.checksum, body[:3]) != body[3]:
            return Skip(1, "bad_checksum")
        return length

    def _length(self, buffer: bytearray) -> int | Skip:
        """Length of the frame at the start of the buffer; 0 while stuffing leaves it unknown."""
        if not self._options.dle_stuffing:
            return len(HEADER) + BODY + len(TRAILER)
        at = len(HEADER)
        for _ in range(BODY):
            if at + 1 >= len(buffer):
                return 0
            if buffer[at] == DLE and buffer[at + 1] != DLE:
                return Skip(1, "bad_stuffing")
            at += 2 if buffer[at] == DLE else 1
        return at + len(TRAILER)


class Encoder:
    """The emulated altimeter: a frame for each RadioHeight, with the flags of the last DeviceStatus."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._flags: tuple[str, ...] = ("in_air",)

    def encode(self, measurement: Measurement) -> list[bytes]:
        if isinstance(measurement, DeviceStatus):
            self._flags = measurement.flags
            return []
        if not isinstance(measurement, RadioHeight):
            return []
        flags = self._flags
        if measurement.valid:
            flags = tuple(flag for flag in flags if flag not in INVALIDATING)
        elif not set(flags).intersection(INVALIDATING):
            flags = (*flags, "unlocked")
        return [encode_height(measurement.height_agl or 0.0, flags, self._options)]

    def respond(self, data: bytes) -> list[bytes]:
        return []


make_decoder, make_encoder = Decoder, Encoder
