"""MAVLink 2 (and 1) of an autopilot, common dialect.

Document: mavlink.io, MAVLink 2 serialization and common.xml, as carried by the package ``pymavlink`` 2.4.  Framing is
ours (bytes accounted, first-byte stamps, no parser state shared by several sources); a complete frame is taken apart
by ``pymavlink``.

    v2   FD | length | incompatible | compatible | sequence | system | component | message u24 | payload | CRC u16
         | signature 13 B when incompatible bit 0 is set (carried over, not verified)
    v1   FE | length | sequence | system | component | message u8 | payload | CRC u16
    CRC  CRC-16/MCRF4XX over everything behind the first byte, and a seed byte of the message

A message that the dialect does not know has no known seed, so its CRC proves nothing: refused ("unknown_message").

    24 GPS_RAW_INT          fix, lat lon 1e-7 deg, altitudes mm (MSL, ellipsoid), speed cm/s, course 0.01 deg
    29 SCALED_PRESSURE      absolute, differential [hPa]          30 ATTITUDE   roll pitch yaw [rad], rates [rad/s]
    33 GLOBAL_POSITION_INT  lat lon 1e-7 deg, alt mm (option ``height``: MSL by the standard), velocity NED cm/s
    105 HIGHRES_IMU         m/s^2, rad/s, gauss, hPa, as far as ``fields_updated`` says
    132 DISTANCE_SENSOR     cm; only orientation 25 (down); radar gives a RadioHeight, everything else a Range;
                            not valid outside min..max or with signal_quality 1
    2 SYSTEM_TIME           UNIX us

``hdg`` of 33 repeats ATTITUDE and is not taken; temperatures are the sensors' own and are not taken.  The emulated
autopilot sends ATTITUDE (with the rates of an ImuSample of the same t_rx_ns), HIGHRES_IMU for an ImuSample with
accelerations, GLOBAL_POSITION_INT for a Position that has a Velocity of the same t_rx_ns, GPS_RAW_INT beside it when
both heights are known, SCALED_PRESSURE for a StaticPressure (with the ImpactPressure of the same t_rx_ns).
"""

from __future__ import annotations

import binascii
import re
from typing import Annotated, Literal

from pydantic import Field
from pymavlink.dialects.v20 import common

from fti.config import StrictModel
from fti.drivers import Counters
from fti.drivers._bits import REVERSED
from fti.drivers._framing import Framer, Skip
from fti.drivers._talker import COMMANDS, command, on_connect, poll  # noqa: F401 - the rest of the contract
from fti.drivers.mavlink.decode import READERS
from fti.drivers.mavlink.encode import Encoder
from fti.types import Measurement

DOCUMENT = "MAVLink 2 serialization and common.xml (mavlink.io)"
MESSAGES = {
    "GPS_RAW_INT": "position, ground speed and track, kind of fix, dilution of precision",
    "SCALED_PRESSURE": "static and impact pressure",
    "ATTITUDE": "attitude and body rates",
    "GLOBAL_POSITION_INT": "position and velocity",
    "HIGHRES_IMU": "inertial sample, magnetic field, pressures",
    "DISTANCE_SENSOR": "range or radio height, looking down",
    "SYSTEM_TIME": "the autopilot's UTC",
    "(other)": "framed and counted by name",
}
CARRIERS = frozenset({"serial", "udp"})

FRAME_MAX = 10 + 255 + 2 + 13
SIGNED = 0x01
SIGNATURE = 13
_START = re.compile(rb"[\xfd\xfe]")


class Options(StrictModel):
    """``system``: only this system id (the emulator sends under it, or else under 1); ``height``: see the docstring."""

    system: Annotated[int, Field(ge=1, le=255)] | None = None
    height: Literal["msl", "ellipsoid"] = "msl"


def crc(data: bytes) -> int:
    """CRC-16/MCRF4XX: the CCITT polynomial with everything reflected."""
    mirrored = binascii.crc_hqx(data.translate(REVERSED), 0xFFFF)
    return REVERSED[mirrored & 0xFF] << 8 | REVERSED[mirrored >> 8]


def measure(buffer: bytearray) -> int | Skip:
    """Framing; see ``fti.drivers._framing``."""
    start = _START.search(buffer)
    if start is None:
        return Skip(len(buffer), "no_sync")
    if start.start():
        return Skip(start.start(), "no_sync")
    return _measure_frame(buffer, 10 if buffer[0] == common.PROTOCOL_MARKER_V2 else 6)


def _measure_frame(buffer: bytearray, header: int) -> int | Skip:
    if len(buffer) < header:
        return 0
    flags = buffer[2] if header == 10 else 0
    if flags & ~SIGNED:
        return Skip(1, "bad_flags")
    known = common.mavlink_map.get(message_id(buffer))
    if known is None:
        return Skip(1, "unknown_message")
    end = header + buffer[1]
    length = end + 2 + (SIGNATURE if flags & SIGNED else 0)
    if len(buffer) < length:
        return 0
    good = crc(bytes(buffer[1:end]) + bytes([known.crc_extra])) == buffer[end] | buffer[end + 1] << 8
    return length if good else Skip(1, "bad_checksum")


def message_id(frame: bytes | bytearray) -> int:
    """Number of the message in a frame."""
    return int.from_bytes(frame[7:10], "little") if frame[0] == common.PROTOCOL_MARKER_V2 else frame[5]


class Decoder:
    """Frames to measurements."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._options = options
        self._mavlink = common.MAVLink(None)
        self._framer = Framer(measure, self.counters, limit=FRAME_MAX)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        found: list[Measurement] = []
        for stamp, frame in self._framer.feed(data, t_rx_ns):
            found += self._read(frame, stamp)
        return found

    def _read(self, frame: bytes, t_rx_ns: int) -> list[Measurement]:
        number = message_id(frame)
        system = frame[5] if frame[0] == common.PROTOCOL_MARKER_V2 else frame[3]
        if self._options.system not in (None, system):
            self.counters.messages["other system"] += 1
            return []
        name = common.mavlink_map[number].msgname
        self.counters.messages[name] += 1
        if number not in READERS:
            return []
        try:
            message = self._mavlink.decode(bytearray(frame))
        except common.MAVError:
            self.counters.messages[f"{name} malformed"] += 1
            return []
        return READERS[number](message, t_rx_ns, self._options.height)


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder."""
    return Decoder(options)


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder."""
    return Encoder(options.system or 1, options.height)
