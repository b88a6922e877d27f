"""INSSOL: the navigation solution."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable

from fti.drivers._times import SECOND_NS, gps_ns
from fti.drivers._units import wrap_heading
from fti.drivers.imar_ixcom.status import ALIGNED, ERRORS, POSITION_GOOD, decode_status
from fti.drivers.imar_ixcom.wire import FOOTER, HEADER
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

INSSOL = struct.Struct("<3f3f3f3fddfhH")
INSSOL_ID = 0x03

IMU_RAW, IMU_CORRECTED, IMU_GRAVITY_FREE = 1 << 0, 1 << 1, 1 << 2
VEL_NED, VEL_ENU, VEL_ECEF, VEL_BODY = 1 << 3, 1 << 4, 1 << 5, 1 << 6
ALT_WGS84, ALT_MSL, ALT_BARO = 1 << 7, 1 << 8, 1 << 9
LON_LAT = 1 << 10
RPY_DIN70000 = 1 << 15

Triple = tuple[float, float, float]


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
