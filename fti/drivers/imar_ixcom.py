"""iMAR iXCOM, the message INSSOL of an inertial navigation system; RS-232 100 Hz, UDP 300 Hz.

Document: iMAR iXCOM interface, as published by the maker in the package ``ixcom`` 1.3 (message tables, data-selection
mask, global status).  Everything is little-endian; a frame is header, payload, footer:

    header 16 B   0      1   2        3         4       6     8        12
                  0x7E   id  counter  reserved  length  week  seconds  microseconds      length u16: the whole frame
    footer  4 B   status u16 | CRC-16/XMODEM u16 over all bytes before it

    INSSOL 0x03, 92 B   16 accel_b 3f [m/s^2] | 28 gyro_b 3f [rad/s] | 40 roll pitch yaw 3f [rad] | 52 velocity 3f [m/s]
                        64 longitude d [rad]  | 72 latitude d [rad]  | 80 altitude f [m] | 84 undulation i16 [cm]
                        86 data selection u16

    data selection  bit 0 raw, 1 corrected, 2 gravity-free IMU data; velocity 3 NED, 4 ENU, 5 ECEF, 6 body;
                    altitude 7 WGS84, 8 MSL, 9 barometric; 10 longitude and latitude; 15 angles after DIN 70000
    status          bits as STATUS_FLAGS; 12-13 alignment, 14-15 position quality

What the message does not say stays None: gravity-free accelerations are no specific force, angles after DIN 70000
are another convention, and an undulation of exactly 0 cm is read as "no geoid model".  Other messages of the
protocol are framed and counted by name.  The emulated device sends one INSSOL when a Position comes, with the
attitude, velocity and inertial sample of the same t_rx_ns; what is missing is sent as NaN.
"""

from __future__ import annotations

import binascii
import math
import struct
from collections.abc import Callable
from typing import Annotated

from pydantic import Field

from fti.config import StrictModel
from fti.drivers import Counters
from fti.drivers._framing import Framer, Skip, skip_to
from fti.drivers._talker import COMMANDS, command, on_connect, poll  # noqa: F401 - the rest of the contract
from fti.drivers._times import SECOND_NS, device_time_ns, gps_ns, gps_week
from fti.drivers._units import wrap_heading
from fti.types import (
    Attitude,
    DeviceStatus,
    ImuSample,
    Measurement,
    Position,
    PressureAltitude,
    Stamp,
    TimeScale,
    Velocity,
)

DOCUMENT = "iMAR iXCOM interface as published in the maker's package ixcom 1.3: INSSOL 0x03"
MESSAGES = {
    "INSSOL": "inertial sample, attitude, velocity, position and status of the navigation solution",
    "(other)": "framed and counted by name or number",
}
CARRIERS = frozenset({"serial", "udp"})

SYNC = b"\x7e"
HEADER = struct.Struct("<BBBBHHII")
FOOTER = struct.Struct("<HH")
INSSOL = struct.Struct("<3f3f3f3fddfhH")
INSSOL_ID = 0x03
FRAME_MIN, FRAME_MAX = HEADER.size + FOOTER.size, 4096
NAMES = {
    0x00: "IMURAW", 0x01: "IMUCORR", 0x02: "IMUCOMP", 0x03: "INSSOL", 0x0F: "EKFSTDDEV", 0x12: "GNSSSOL",
    0x17: "AIRDATA", 0x18: "MAGDATA", 0x19: "SYSSTAT", 0x91: "CANGATEWAY", 0x98: "EXTHEIGHT",
    0xFD: "COMMAND", 0xFE: "RESPONSE", 0xFF: "PARAMETER",
}  # fmt: skip

IMU_RAW, IMU_CORRECTED, IMU_GRAVITY_FREE = 1 << 0, 1 << 1, 1 << 2
VEL_NED, VEL_ENU, VEL_ECEF, VEL_BODY = 1 << 3, 1 << 4, 1 << 5, 1 << 6
ALT_WGS84, ALT_MSL, ALT_BARO = 1 << 7, 1 << 8, 1 << 9
LON_LAT = 1 << 10
RPY_DIN70000 = 1 << 15

STATUS_FLAGS = (
    "hardware_error", "communication_error", "navigation_error", "calibration_error", "gyro_overrange",
    "accel_overrange", "gnss_invalid", "standby", "dynamic_align", "time_invalid", "navigation_mode", "ahrs_mode",
)  # fmt: skip
ALIGNMENT = ("levelling", "aligning", "align_complete", "heading_good")
QUALITY = ("position_bad", "position_medium", "position_high", "position_undefined")
ERRORS = frozenset(STATUS_FLAGS[:6]) | {"standby"}
ALIGNED = frozenset(ALIGNMENT[2:])
POSITION_GOOD = frozenset({"position_medium", "position_high"})
HEALTHY: tuple[str, ...] = ("navigation_mode", "heading_good", "position_high")

Triple = tuple[float, float, float]


class Options(StrictModel):
    """``data_selection``: what is meant where the device sends a data-selection word of 0."""

    data_selection: Annotated[int, Field(ge=0, le=0xFFFF)] = IMU_CORRECTED | VEL_NED | ALT_WGS84 | LON_LAT


# -------------------------------------------------------------------------------------------------------- status


def decode_status(status: int) -> tuple[str, ...]:
    """Names of the conditions in the footer's status word."""
    flags = [name for bit, name in enumerate(STATUS_FLAGS) if status >> bit & 1]
    return (*flags, ALIGNMENT[status >> 12 & 3], QUALITY[status >> 14 & 3])


def encode_status(flags: tuple[str, ...]) -> int:
    """The status word; alignment and position quality are good where the flags do not name them."""
    status = sum(1 << bit for bit, name in enumerate(STATUS_FLAGS) if name in flags)
    alignment = next((i for i, name in enumerate(ALIGNMENT) if name in flags), ALIGNMENT.index("heading_good"))
    quality = next((i for i, name in enumerate(QUALITY) if name in flags), QUALITY.index("position_high"))
    return status | alignment << 12 | quality << 14


# ------------------------------------------------------------------------------------------------------ velocity


def _from_ned(vel: Triple, rpy: Triple, lat: float, lon: float) -> Triple:
    return vel


def _from_enu(vel: Triple, rpy: Triple, lat: float, lon: float) -> Triple:
    east, north, up = vel
    return north, east, -up


def _from_ecef(vel: Triple, rpy: Triple, lat: float, lon: float) -> Triple:
    x, y, z = vel
    outward = math.cos(lon) * x + math.sin(lon) * y  # away from the axis of the Earth
    north = -math.sin(lat) * outward + math.cos(lat) * z
    down = -math.cos(lat) * outward - math.sin(lat) * z
    return north, -math.sin(lon) * x + math.cos(lon) * y, down


def _from_body(vel: Triple, rpy: Triple, lat: float, lon: float) -> Triple:
    """mat_nb of roll, pitch, heading times vel_b."""
    (forward, right, below), (roll, pitch, heading) = vel, rpy
    side = math.cos(roll) * right - math.sin(roll) * below
    under = math.sin(roll) * right + math.cos(roll) * below
    ahead = math.cos(pitch) * forward + math.sin(pitch) * under
    down = -math.sin(pitch) * forward + math.cos(pitch) * under
    north = math.cos(heading) * ahead - math.sin(heading) * side
    return north, math.sin(heading) * ahead + math.cos(heading) * side, down


VELOCITY_FRAMES: tuple[tuple[int, Callable[[Triple, Triple, float, float], Triple]], ...] = (
    (VEL_NED, _from_ned),
    (VEL_ENU, _from_enu),
    (VEL_ECEF, _from_ecef),
    (VEL_BODY, _from_body),
)

# ------------------------------------------------------------------------------------------------------ messages


def decode_inssol(frame: bytes, t_rx_ns: int, if_zero: int) -> list[Measurement]:
    """The measurements of one INSSOL frame; if_zero : the data selection meant by 0."""
    week, seconds, micros = HEADER.unpack_from(frame)[5:]
    v = INSSOL.unpack_from(frame, HEADER.size)
    flags = decode_status(FOOTER.unpack_from(frame, len(frame) - FOOTER.size)[0])
    stamp = Stamp(t_rx_ns, gps_ns(week, seconds * SECOND_NS + micros * 1000), TimeScale.GPS)
    selection, ok = v[16] or if_zero, ERRORS.isdisjoint(flags)
    aligned = ok and not ALIGNED.isdisjoint(flags)
    found: list[Measurement | None] = [
        DeviceStatus(stamp=stamp, ok=ok, flags=flags),
        _imu(stamp, v[0:3], v[3:6], selection),
        _attitude(stamp, v[6:9], selection, aligned),
        _velocity(stamp, v, selection, aligned),
        *_position(stamp, v[12:16], selection, ok and not POSITION_GOOD.isdisjoint(flags)),
    ]
    return [m for m in found if m is not None]


def _finite(*values: float) -> bool:
    return all(map(math.isfinite, values))


def _imu(stamp: Stamp, accel: Triple, gyro: Triple, selection: int) -> ImuSample | None:
    if selection & IMU_GRAVITY_FREE or not _finite(*accel, *gyro):
        return None
    return ImuSample(stamp=stamp, accel_b=accel, gyro_b=gyro)


def _attitude(stamp: Stamp, rpy: Triple, selection: int, valid: bool) -> Attitude | None:
    if selection & RPY_DIN70000 or not _finite(*rpy):
        return None
    return Attitude(stamp=stamp, roll=rpy[0], pitch=rpy[1], heading=wrap_heading(rpy[2]), valid=valid)


def _velocity(stamp: Stamp, v: tuple[float, ...], selection: int, valid: bool) -> Velocity | None:
    rpy, vel, lon, lat = (v[6], v[7], v[8]), (v[9], v[10], v[11]), v[12], v[13]
    to_ned = next((turn for bit, turn in VELOCITY_FRAMES if selection & bit), None)
    if to_ned is None or not _finite(*vel):
        return None
    if to_ned is _from_ecef and not _finite(lon, lat):
        return None
    if to_ned is _from_body and (selection & RPY_DIN70000 or not _finite(*rpy)):
        return None
    north, east, down = to_ned(vel, rpy, lat, lon)
    return Velocity(stamp=stamp, north=north, east=east, down=down, valid=valid)


def _position(stamp: Stamp, v: tuple[float, ...], selection: int, valid: bool) -> list[Measurement]:
    lon, lat, altitude, centimetres = v
    height = altitude if _finite(altitude) else None
    undulation = centimetres / 100 if centimetres else None
    known = selection & LON_LAT and _finite(lon, lat)
    here = {"lat": lat, "lon": lon} if known else {}
    if selection & ALT_WGS84 and height is not None:
        here |= {"alt": height} | ({"alt_msl": height - undulation} if undulation is not None else {})
    elif selection & ALT_MSL and height is not None:
        here |= {"alt_msl": height} | ({"alt": height + undulation} if undulation is not None else {})
    found: list[Measurement] = []
    if here:
        found.append(Position(stamp=stamp, undulation=undulation, valid=valid, **here))
    if selection & ALT_BARO and height is not None:
        found.append(PressureAltitude(stamp=stamp, alt_press=height, valid=valid))
    return found


def encode_frame(message_id: int, counter: int, t_gps_ns: int, status: int, payload: bytes) -> bytes:
    """Any frame of the protocol.  t_gps_ns : GPS time [ns]; status : the footer's word."""
    week, in_week_ns = gps_week(t_gps_ns + 500)  # to the nearest microsecond
    seconds, rest_ns = divmod(in_week_ns, SECOND_NS)
    length = HEADER.size + len(payload) + FOOTER.size
    body = HEADER.pack(SYNC[0], message_id, counter & 0xFF, 0, length, week & 0xFFFF, seconds, rest_ns // 1000)
    body += payload + status.to_bytes(2, "little")
    return body + binascii.crc_hqx(body, 0).to_bytes(2, "little")


def encode_inssol(
    imu: ImuSample | None, attitude: Attitude | None, velocity: Velocity | None, position: Position
) -> bytes:
    """Payload of INSSOL; the altitude is WGS84 where it is known, else MSL; the velocity NED."""
    lost = (math.nan, math.nan, math.nan)
    accel = (imu and imu.accel_b) or lost
    gyro = (imu and imu.gyro_b) or lost
    rpy = (attitude.roll, attitude.pitch, attitude.heading) if attitude else lost
    vel = (velocity.north, velocity.east, velocity.down) if velocity else lost
    altitude = position.alt_msl if position.alt is None else position.alt
    height_bit = ALT_MSL if position.alt is None and position.alt_msl is not None else ALT_WGS84
    undulation = max(-32768, min(32767, round((position.undulation or 0.0) * 100)))
    reals = [math.nan if x is None else x for x in (*accel, *gyro, *rpy, *vel, position.lon, position.lat, altitude)]
    return INSSOL.pack(*reals, undulation, IMU_CORRECTED | VEL_NED | height_bit | LON_LAT)


# ------------------------------------------------------------------------------------------------------- streams


def measure(buffer: bytearray) -> int | Skip:
    """Framing; see ``fti.drivers._framing``."""
    if skip := skip_to(buffer, SYNC):
        return skip
    if len(buffer) < 6:
        return 0
    length = buffer[4] | buffer[5] << 8
    if not FRAME_MIN <= length <= FRAME_MAX:
        return Skip(1, "bad_length")
    if len(buffer) < length:
        return 0
    good = binascii.crc_hqx(buffer[: length - 2], 0) == buffer[length - 2] | buffer[length - 1] << 8
    return length if good else Skip(1, "bad_checksum")


class Decoder:
    """Frames of iXCOM; INSSOL to measurements."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._if_zero = options.data_selection
        self._framer = Framer(measure, self.counters, limit=FRAME_MAX)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        found: list[Measurement] = []
        for stamp, frame in self._framer.feed(data, t_rx_ns):
            name = NAMES.get(frame[1], f"0x{frame[1]:02X}")
            if frame[1] != INSSOL_ID:
                self.counters.messages[name] += 1
            elif len(frame) == FRAME_MIN + INSSOL.size:
                self.counters.messages[name] += 1
                found += decode_inssol(frame, stamp, self._if_zero)
            else:
                self.counters.messages["INSSOL of unknown length"] += 1
        return found


class Encoder:
    """The system's end of the line: one INSSOL for each Position, with what came before it at the same t_rx_ns."""

    def __init__(self, options: Options) -> None:
        self._counter = 0
        self._flags = HEALTHY
        self._imu: ImuSample | None = None
        self._attitude: Attitude | None = None
        self._velocity: Velocity | None = None

    def encode(self, measurement: Measurement) -> list[bytes]:
        if isinstance(measurement, Position):
            return [self._inssol(measurement)]
        if isinstance(measurement, DeviceStatus):
            self._flags = measurement.flags
        elif isinstance(measurement, ImuSample):
            self._imu = measurement
        elif isinstance(measurement, Attitude):
            self._attitude = measurement
        elif isinstance(measurement, Velocity):
            self._velocity = measurement
        return []

    def respond(self, data: bytes) -> list[bytes]:
        return []

    def _inssol(self, position: Position) -> bytes:
        now = position.stamp.t_rx_ns
        imu = self._imu if self._imu and self._imu.stamp.t_rx_ns == now else None
        attitude = self._attitude if self._attitude and self._attitude.stamp.t_rx_ns == now else None
        velocity = self._velocity if self._velocity and self._velocity.stamp.t_rx_ns == now else None
        flags = self._flags
        if attitude and not attitude.valid:
            flags = (*(f for f in flags if f not in ALIGNMENT), "aligning")
        if not position.valid:
            flags = (*(f for f in flags if f not in QUALITY), "position_undefined")
        t_gps_ns = device_time_ns(position.stamp, TimeScale.GPS)
        payload = encode_inssol(imu, attitude, velocity, position)
        frame = encode_frame(INSSOL_ID, self._counter, t_gps_ns, encode_status(flags), payload)
        self._counter = (self._counter + 1) & 0xFF
        return frame


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder."""
    return Decoder(options)


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder."""
    return Encoder(options)
