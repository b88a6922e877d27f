"""Attitude, position, velocity and time of MAVLink to measurements; ``mavlink`` lists all messages."""

from __future__ import annotations

import math
from typing import Any

from fti.drivers.mavlink.fields import (
    UNKNOWN_U16,
    Reader,
    Settings,
    all_finite,
    scaled_or_none,
    stamp_from_boot_ms,
    stamp_from_ns,
    stamp_from_us,
)
from fti.formats.unit_factors import DEGREE
from fti.geodesy.formulas import mat_from_quat, normalised, rpy_from_mat, wrap_heading
from fti.messages.measurements import (
    Airspeed,
    Attitude,
    DeviceStatus,
    DeviceTime,
    ImuSample,
    Measurement,
    Position,
    Reading,
    Satellites,
    Stamp,
    TimeScale,
    Velocity,
)

FIXES = ("no_gps", "no_fix", "2d", "3d", "dgps", "rtk_float", "rtk_fixed", "static", "ppp")
FIX_3D = 3
NO_SATELLITES = 255


def decode_attitude(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """ATTITUDE 30."""
    stamp = stamp_from_boot_ms(t_rx_ns, m.time_boot_ms)
    measurements = _rates(m, stamp)
    if all_finite(m.roll, m.pitch, m.yaw):
        measurements.append(Attitude(stamp=stamp, roll=m.roll, pitch=m.pitch, heading=wrap_heading(m.yaw)))
    return measurements


def decode_quaternion(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """ATTITUDE_QUATERNION 31: body to north, east, down; w, x, y, z."""
    stamp = stamp_from_boot_ms(t_rx_ns, m.time_boot_ms)
    measurements = _rates(m, stamp)
    w, x, y, z = m.q1, m.q2, m.q3, m.q4
    norm = w * w + x * x + y * y + z * z
    if not 0.9 < norm < 1.1:  # NaN, too
        return measurements
    roll, pitch, heading = rpy_from_mat(mat_from_quat(*normalised(w, x, y, z)))
    return [*measurements, Attitude(stamp=stamp, roll=roll, pitch=pitch, heading=heading)]


def _rates(m: Any, stamp: Stamp) -> list[Measurement]:
    rates = (m.rollspeed, m.pitchspeed, m.yawspeed)
    return [ImuSample(stamp=stamp, gyro_b=rates)] if all_finite(*rates) else []


def decode_global_position(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """GLOBAL_POSITION_INT 33; ``height`` of the settings : datum of alt.

    The message has no validity flag: without a position the autopilot sends latitude and longitude 0.
    """
    stamp, valid = stamp_from_boot_ms(t_rx_ns, m.time_boot_ms), bool(m.lat or m.lon)
    above = {"alt_msl" if settings.height == "msl" else "alt": m.alt * 1e-3}
    return [
        Velocity(stamp=stamp, north=m.vx * 1e-2, east=m.vy * 1e-2, down=m.vz * 1e-2, valid=valid),
        Position(stamp=stamp, lat=m.lat * 1e-7 * DEGREE, lon=m.lon * 1e-7 * DEGREE, valid=valid, **above),
    ]


def decode_local_position(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """LOCAL_POSITION_NED 32; its origin is the autopilot's own, so the position is a reading."""
    stamp = stamp_from_boot_ms(t_rx_ns, m.time_boot_ms)
    measurements: list[Measurement] = []
    if all_finite(m.vx, m.vy, m.vz):
        measurements.append(Velocity(stamp=stamp, north=m.vx, east=m.vy, down=m.vz))
    for name, value in (("local_north", m.x), ("local_east", m.y), ("local_down", m.z)):
        if math.isfinite(value):
            measurements.append(Reading(stamp=stamp, name=name, value=value, unit="m"))
    return measurements


def decode_gps_raw(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """GPS_RAW_INT 24; an ellipsoidal height of exactly 0 means none."""
    stamp = stamp_from_us(t_rx_ns, m.time_usec)
    ok = m.fix_type >= FIX_3D
    alt, alt_msl = scaled_or_none(m.alt_ellipsoid, 0, 1e-3), m.alt * 1e-3
    position = Position(
        stamp=stamp,
        lat=m.lat * 1e-7 * DEGREE,
        lon=m.lon * 1e-7 * DEGREE,
        alt=alt,
        alt_msl=alt_msl,
        undulation=None if alt is None else alt - alt_msl,
        horizontal_sd=scaled_or_none(m.h_acc, 0, 1e-3),
        vertical_sd=scaled_or_none(m.v_acc, 0, 1e-3),
        valid=ok,
    )
    speed = scaled_or_none(m.vel, UNKNOWN_U16, 1e-2)
    track = None if m.cog == UNKNOWN_U16 else wrap_heading(m.cog * 1e-2 * DEGREE)
    velocity = Velocity(stamp=stamp, ground_speed=speed, track=track, sd=scaled_or_none(m.vel_acc, 0, 1e-3), valid=ok)
    return [velocity, position, *_receiver(m, stamp, ok)]


def decode_hil_gps(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """HIL_GPS 113: receiver data from a simulator; heights above mean sea level."""
    stamp = stamp_from_us(t_rx_ns, m.time_usec)
    ok = m.fix_type >= FIX_3D
    return [
        Velocity(stamp=stamp, north=m.vn * 1e-2, east=m.ve * 1e-2, down=m.vd * 1e-2, valid=ok),
        Position(stamp=stamp, lat=m.lat * 1e-7 * DEGREE, lon=m.lon * 1e-7 * DEGREE, alt_msl=m.alt * 1e-3, valid=ok),
        *_receiver(m, stamp, ok),
    ]


def _receiver(m: Any, stamp: Stamp, ok: bool) -> list[Measurement]:
    """Dilution of precision, satellites and kind of fix."""
    fix = FIXES[m.fix_type] if m.fix_type < len(FIXES) else f"fix_{m.fix_type}"
    used = None if m.satellites_visible == NO_SATELLITES else m.satellites_visible
    hdop, vdop = scaled_or_none(m.eph, UNKNOWN_U16, 1e-2), scaled_or_none(m.epv, UNKNOWN_U16, 1e-2)
    return [
        Satellites(stamp=stamp, used=used, hdop=hdop, vdop=vdop),
        DeviceStatus(stamp=stamp, ok=ok, flags=(fix,)),
    ]


def decode_hud(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """VFR_HUD 74: CAS or IAS (not specified); fields of other messages are ignored."""
    if not all_finite(m.airspeed, m.climb):
        return []
    stamp = Stamp(t_rx_ns)
    return [
        Airspeed(stamp=stamp, ias=m.airspeed),
        Reading(stamp=stamp, name="climb", value=m.climb, unit="m/s"),
        Reading(stamp=stamp, name="throttle", value=float(m.throttle), unit="%"),
    ]


def decode_time(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """SYSTEM_TIME 2; without UTC the time since boot; without both nothing."""
    stamp = stamp_from_us(t_rx_ns, m.time_unix_usec)
    if stamp.time_scale != TimeScale.UTC:
        stamp = stamp_from_boot_ms(t_rx_ns, m.time_boot_ms)
    return [] if stamp.t_dev_ns is None else [DeviceTime(stamp=stamp)]


def decode_timesync(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """TIMESYNC 111: a request has the time of the sender in ts1 and 0 in tc1, an answer its time in tc1."""
    return [DeviceTime(stamp=stamp_from_ns(t_rx_ns, m.tc1 or m.ts1))] if (m.tc1 or m.ts1) > 0 else []


READERS: dict[int, Reader] = {
    2: decode_time,
    24: decode_gps_raw,
    30: decode_attitude,
    31: decode_quaternion,
    32: decode_local_position,
    33: decode_global_position,
    74: decode_hud,
    111: decode_timesync,
    113: decode_hil_gps,
}
