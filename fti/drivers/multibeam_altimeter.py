r"""Multi-beam altimeter: a frame with the direction and the range of each beam, over UDP.

Document: this docstring.  The protocol is our own, for the emulated altimeter: no maker of a multi-beam altimeter
publishes one.  An instrument with another frame needs its own driver.

One frame is one measurement of all beams, little-endian:

    byte  0   4 characters   MBRA
          4   uint16         length of the frame, with the checksum: 26 + 10 n
          6   uint8          message: 1 ranges
          7   uint8          number of beams n, 1 to 32
          8   uint32         sequence number of the frame, from 0 after power-on
         12   uint64         time of the measurement since power-on [us]
         20   uint16         status, bits: 0 self-test, 1 temperature, 2 transmitter off, 3 failure
         22   n beams of 10 bytes
                int16        angle along the aircraft [deg / 100], forward positive, between -90 and 90
                int16        angle across it [deg / 100], right positive, between -90 and 90
                uint32       slant range [mm]
                uint8        state: 0 valid, 1 no return, 2 too near, 3 too far, 4 switched off; others are invalid
                uint8        reserved, 0
    22 + 10 n uint32         CRC-32 (ISO 3309: reflected polynomial EDB88320, initial value and final inversion
                             FFFFFFFF) of all bytes before it

With the angles a along and c across, the beam has the direction (tan a, tan c, 1) in the sensor frame: x forward, y
right, z down.

Each beam becomes a ``BeamRange`` named ``beam_1`` to ``beam_n`` in the order of the frame; all of a frame have the same
stamp.  A ``DeviceStatus`` follows, which is ok without a status bit.  Self-test, failure and a transmitter that is off
make all beams of the frame invalid, an angle outside of its range one beam; a time beyond 292 years is not used.
Missing sequence numbers are counted as lost; a lower number is a restart of the altimeter.
"""

from __future__ import annotations

import math
import struct
import zlib
from typing import NamedTuple

from fti.config import StrictModel
from fti.drivers._framing import FramedDecoder, Skip, skip_to
from fti.drivers._no_commands import COMMANDS, command, on_connect, poll  # noqa: F401 - the altimeter streams
from fti.formats.device_time import device_time_ns
from fti.formats.unit_factors import DEGREE
from fti.messages.measurements import BeamRange, DeviceStatus, Measurement, Stamp, TimeScale

DOCUMENT = "our own protocol for the laboratory: docstring of fti/drivers/multibeam_altimeter.py"
MESSAGES = {
    "ranges": "direction and slant range of each beam, status",
    "ranges_of_other_length": "ranges whose length does not fit the number of beams",
    "(other)": "another message, by its number",
}
CARRIERS = frozenset({"udp"})
BEAMS = True

START = b"MBRA"
HEADER = struct.Struct("<4sHBBIQH")
BEAM = struct.Struct("<hhIBB")
CRC_SIZE = 4
RANGES = 1
MAX_BEAMS = 32
MIN_FRAME, MAX_FRAME = HEADER.size + CRC_SIZE, HEADER.size + CRC_SIZE + MAX_BEAMS * BEAM.size
VALID, NO_RETURN = 0, 1
#: Flags of the status bits, from bit 0.
FLAGS = ("self_test", "temperature", "transmitter_off", "failure")
INVALIDATING = frozenset({"self_test", "transmitter_off", "failure"})
ANGLE_LSB, MAX_ANGLE = 0.01 * DEGREE, 9000
RANGE_LSB_M, MAX_RANGE = 1e-3, 2**32 - 1
#: A later time does not fit into 64 bits of nanoseconds.
MAX_TIME_US = (2**63 - 1) // 1000


class Options(StrictModel):
    """The altimeter has no options."""


class Header(NamedTuple):
    """Header of a frame without its constant fields."""

    message: int
    beams: int
    sequence: int
    time_us: int
    status: int


def make_frame(header: Header, body: bytes) -> bytes:
    """A whole frame.  body : the beams"""
    head = HEADER.pack(START, MIN_FRAME + len(body), *header) + body
    return head + zlib.crc32(head).to_bytes(CRC_SIZE, "little")


def read_header(frame: bytes) -> Header:
    """The header of a whole frame."""
    return Header(*HEADER.unpack_from(frame)[2:])


def measure(buffer: bytearray) -> int | Skip:
    """Size of the frame at the start of the buffer, or a Skip; see ``_framing``."""
    if skip := skip_to(buffer, START):
        return skip
    if len(buffer) < len(START) + 2:
        return 0
    length = int.from_bytes(buffer[4:6], "little")
    if not MIN_FRAME <= length <= MAX_FRAME:
        return Skip(1, "bad_length")
    if len(buffer) < length:
        return 0
    stated = int.from_bytes(buffer[length - CRC_SIZE : length], "little")
    return length if zlib.crc32(buffer[: length - CRC_SIZE]) == stated else Skip(1, "bad_checksum")


class Decoder(FramedDecoder):
    """Frames to BeamRange and DeviceStatus."""

    def __init__(self, options: Options) -> None:
        super().__init__(measure, MAX_FRAME + 1)
        self._next: int | None = None

    def _decode(self, frame: bytes, t_rx_ns: int) -> tuple[str, list[Measurement]]:
        header, body = read_header(frame), frame[HEADER.size : -CRC_SIZE]
        self._count_missing(header.sequence)
        if header.message != RANGES:
            return str(header.message), []
        if header.beams == 0 or len(body) != header.beams * BEAM.size:
            return "ranges_of_other_length", []
        stamp = Stamp(t_rx_ns)
        if header.time_us <= MAX_TIME_US:
            stamp = Stamp(t_rx_ns, 1000 * header.time_us, TimeScale.BOOT)
        flags = tuple(name for bit, name in enumerate(FLAGS) if header.status >> bit & 1)
        is_measuring = INVALIDATING.isdisjoint(flags)
        beams = (
            _beam_range(stamp, f"beam_{k}", is_measuring, *fields) for k, fields in enumerate(BEAM.iter_unpack(body), 1)
        )
        return "ranges", [*beams, DeviceStatus(stamp=stamp, ok=header.status == 0, flags=flags)]

    def _count_missing(self, sequence: int) -> None:
        if self._next is not None and sequence > self._next:
            self.counters.lost["ranges"] += sequence - self._next
        self._next = sequence + 1


def _beam_range(stamp: Stamp, beam: str, is_measuring: bool, *fields: int) -> BeamRange:
    along, across, millimetres, state, _ = fields
    valid = is_measuring and state == VALID and max(abs(along), abs(across)) < MAX_ANGLE
    return BeamRange(
        stamp=stamp,
        beam=beam,
        along=along * ANGLE_LSB,
        across=across * ANGLE_LSB,
        slant_range=millimetres * RANGE_LSB_M if valid else None,
        valid=valid,
    )


class Encoder:
    """The emulated altimeter: a frame with the preceding beams for each DeviceStatus."""

    def __init__(self, options: Options) -> None:
        self._beams: list[bytes] = []
        self._sequence = 0

    def encode(self, measurement: Measurement) -> list[bytes]:
        if isinstance(measurement, BeamRange):
            self._beams = [*self._beams, _encode_beam(measurement)][-MAX_BEAMS:]
        if not isinstance(measurement, DeviceStatus) or not self._beams:
            return []
        status = sum(1 << bit for bit, name in enumerate(FLAGS) if name in measurement.flags)
        if not measurement.ok and not status:
            status = 1 << FLAGS.index("failure")
        time_us = device_time_ns(measurement.stamp, TimeScale.BOOT) // 1000
        frame = make_frame(Header(RANGES, len(self._beams), self._sequence, time_us, status), b"".join(self._beams))
        self._beams, self._sequence = [], self._sequence + 1 & 0xFFFF_FFFF
        return [frame]

    def respond(self, data: bytes) -> list[bytes]:
        return []


def _encode_beam(m: BeamRange) -> bytes:
    angles = (_whole(angle / ANGLE_LSB, 1 - MAX_ANGLE, MAX_ANGLE - 1) for angle in (m.along, m.across))
    if not m.valid or m.slant_range is None or math.isnan(m.slant_range):
        return BEAM.pack(*angles, 0, NO_RETURN, 0)
    return BEAM.pack(*angles, _whole(m.slant_range / RANGE_LSB_M, 0, MAX_RANGE), VALID, 0)


def _whole(value: float, low: int, high: int) -> int:
    """The nearest whole number within the limits."""
    return round(min(max(value, low), high))


make_decoder, make_encoder = Decoder, Encoder
