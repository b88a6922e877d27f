"""MAVLink messages to measurements, one function each; the layout table stands in ``mavlink``."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from fti.drivers._quantities import STANDARD_PA
from fti.drivers._units import DEGREE, HECTOPASCAL, wrap_heading
from fti.types import (
    Attitude,
    DeviceStatus,
    DeviceTime,
    ImpactPressure,
    ImuSample,
    MagneticField,
    Measurement,
    Position,
    PressureAltitude,
    RadioHeight,
    Range,
    Satellites,
    Stamp,
    StaticPressure,
    TimeScale,
    Velocity,
)

DOWNWARD = 25
LASER, RADAR = 0, 3
INVALID_SIGNAL = 1
UNKNOWN_U16 = 0xFFFF
UNKNOWN_VARIANCE = 255
FIXES = ("no_gps", "no_fix", "2d", "3d", "dgps", "rtk_float", "rtk_fixed", "static", "ppp")
FIX_3D = 3
GAUSS = 1e-4
#: A time_usec above this is UNIX time, below it time since boot (the field's own rule: tell by the magnitude).
UNIX_US = 10**15
IMU_ACCEL, IMU_GYRO, IMU_MAG, IMU_ABS, IMU_DIFF, IMU_ALT = 0x7, 0x38, 0x1C0, 0x200, 0x400, 0x800


def _boot(t_rx_ns: int, milliseconds: int) -> Stamp:
    return Stamp(t_rx_ns, milliseconds * 1_000_000, TimeScale.BOOT)


def _micros(t_rx_ns: int, microseconds: int) -> Stamp:
    return Stamp(t_rx_ns, microseconds * 1000, TimeScale.UTC if microseconds > UNIX_US else TimeScale.BOOT)


def _known(value: int, unknown: int, factor: float) -> float | None:
    return None if value == unknown else value * factor


def decode_attitude(m: Any, t_rx_ns: int, height: str) -> list[Measurement]:
    """ATTITUDE 30."""
    stamp = _boot(t_rx_ns, m.time_boot_ms)
    rates, angles = (m.rollspeed, m.pitchspeed, m.yawspeed), (m.roll, m.pitch, m.yaw)
    found: list[Measurement] = [ImuSample(stamp=stamp, gyro_b=rates)] if _finite(*rates) else []
    if _finite(*angles):
        found.append(Attitude(stamp=stamp, roll=m.roll, pitch=m.pitch, heading=wrap_heading(m.yaw)))
    return found


def decode_global_position(m: Any, t_rx_ns: int, height: str) -> list[Measurement]:
    """GLOBAL_POSITION_INT 33; height : what the autopilot means by alt, "msl" or "ellipsoid".

    The message has no validity: an autopilot that has not found its place yet sends latitude and longitude 0.
    """
    stamp, known = _boot(t_rx_ns, m.time_boot_ms), bool(m.lat or m.lon)
    above = {"alt_msl" if height == "msl" else "alt": m.alt * 1e-3}
    return [
        Velocity(stamp=stamp, north=m.vx * 1e-2, east=m.vy * 1e-2, down=m.vz * 1e-2, valid=known),
        Position(stamp=stamp, lat=m.lat * 1e-7 * DEGREE, lon=m.lon * 1e-7 * DEGREE, valid=known, **above),
    ]


def decode_gps_raw(m: Any, t_rx_ns: int, height: str) -> list[Measurement]:
    """GPS_RAW_INT 24; an ellipsoidal height of exactly 0 is none: no extension, or accuracies without an undulation."""
    stamp = _micros(t_rx_ns, m.time_usec)
    ok = m.fix_type >= FIX_3D
    alt, alt_msl = _known(m.alt_ellipsoid, 0, 1e-3), m.alt * 1e-3
    position = Position(
        stamp=stamp,
        lat=m.lat * 1e-7 * DEGREE,
        lon=m.lon * 1e-7 * DEGREE,
        alt=alt,
        alt_msl=alt_msl,
        undulation=None if alt is None else alt - alt_msl,
        horizontal_sd=_known(m.h_acc, 0, 1e-3),
        vertical_sd=_known(m.v_acc, 0, 1e-3),
        valid=ok,
    )
    speed, track = _known(m.vel, UNKNOWN_U16, 1e-2), _known(m.cog, UNKNOWN_U16, 1e-2 * DEGREE)
    fix = FIXES[m.fix_type] if m.fix_type < len(FIXES) else f"fix_{m.fix_type}"
    return [
        Velocity(stamp=stamp, ground_speed=speed, track=track, sd=_known(m.vel_acc, 0, 1e-3), valid=ok),
        position,
        Satellites(stamp=stamp, hdop=_known(m.eph, UNKNOWN_U16, 1e-2), vdop=_known(m.epv, UNKNOWN_U16, 1e-2)),
        DeviceStatus(stamp=stamp, ok=ok, flags=(fix,)),
    ]


def decode_distance(m: Any, t_rx_ns: int, height: str) -> list[Measurement]:
    """DISTANCE_SENSOR 132."""
    if m.orientation != DOWNWARD:
        return []
    stamp = _boot(t_rx_ns, m.time_boot_ms)
    inside = m.min_distance <= m.current_distance <= m.max_distance
    value = m.current_distance * 1e-2 if inside else None
    sd = math.sqrt(m.covariance) * 1e-2 if 0 < m.covariance < UNKNOWN_VARIANCE else None
    valid = inside and m.signal_quality != INVALID_SIGNAL
    if m.type == RADAR:
        return [RadioHeight(stamp=stamp, height_agl=value, sd=sd, valid=valid)]
    return [Range(stamp=stamp, slant_range=value, sd=sd, valid=valid)]


def decode_pressure(m: Any, t_rx_ns: int, height: str) -> list[Measurement]:
    """SCALED_PRESSURE 29."""
    stamp = _boot(t_rx_ns, m.time_boot_ms)
    found: list[Measurement] = []
    if _finite(m.press_diff):
        found.append(ImpactPressure(stamp=stamp, q_c=m.press_diff * HECTOPASCAL))
    if _finite(m.press_abs):
        found.append(StaticPressure(stamp=stamp, p_static=m.press_abs * HECTOPASCAL))
    return found


def decode_imu(m: Any, t_rx_ns: int, height: str) -> list[Measurement]:
    """HIGHRES_IMU 105."""
    stamp = _micros(t_rx_ns, m.time_usec)
    accel, gyro, mag = (m.xacc, m.yacc, m.zacc), (m.xgyro, m.ygyro, m.zgyro), (m.xmag, m.ymag, m.zmag)

    def has(mask: int, *values: float) -> bool:
        return m.fields_updated & mask == mask and _finite(*values)

    accel_b, gyro_b = accel if has(IMU_ACCEL, *accel) else None, gyro if has(IMU_GYRO, *gyro) else None
    found: list[Measurement] = []
    if accel_b or gyro_b:
        found.append(ImuSample(stamp=stamp, accel_b=accel_b, gyro_b=gyro_b))
    if has(IMU_MAG, *mag):
        found.append(MagneticField(stamp=stamp, field_b=(mag[0] * GAUSS, mag[1] * GAUSS, mag[2] * GAUSS)))
    if has(IMU_ABS, m.abs_pressure):
        found.append(StaticPressure(stamp=stamp, p_static=m.abs_pressure * HECTOPASCAL))
    if has(IMU_DIFF, m.diff_pressure):
        found.append(ImpactPressure(stamp=stamp, q_c=m.diff_pressure * HECTOPASCAL))
    if has(IMU_ALT, m.pressure_alt):
        found.append(PressureAltitude(stamp=stamp, alt_press=m.pressure_alt, setting_pa=STANDARD_PA))
    return found


def decode_time(m: Any, t_rx_ns: int, height: str) -> list[Measurement]:
    """SYSTEM_TIME 2; without UTC the time since boot."""
    known = m.time_unix_usec > UNIX_US
    return [DeviceTime(stamp=_micros(t_rx_ns, m.time_unix_usec) if known else _boot(t_rx_ns, m.time_boot_ms))]


def _finite(*values: float) -> bool:
    return all(map(math.isfinite, values))


READERS: dict[int, Callable[[Any, int, str], list[Measurement]]] = {
    2: decode_time,
    24: decode_gps_raw,
    29: decode_pressure,
    30: decode_attitude,
    33: decode_global_position,
    105: decode_imu,
    132: decode_distance,
}
