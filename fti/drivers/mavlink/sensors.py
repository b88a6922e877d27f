"""Inertial, magnetic, pressure and distance messages of MAVLink to measurements."""

from __future__ import annotations

import math
from typing import Any

from fti.constants import STANDARD_GRAVITY
from fti.drivers.mavlink.fields import Reader, Settings, all_finite, stamp_from_boot_ms, stamp_from_us
from fti.formats.quantities import STANDARD_PA
from fti.formats.unit_factors import HECTOPASCAL
from fti.messages.measurements import (
    ImpactPressure,
    ImuSample,
    MagneticField,
    Measurement,
    PressureAltitude,
    RadioHeight,
    Range,
    Reading,
    Stamp,
    StaticPressure,
)

DOWNWARD = 25
LASER, RADAR = 0, 3
INVALID_SIGNAL = 1
FULL_SCALE = 0xFFFF  # saturated value of a range that is too long
UNKNOWN_VARIANCE = 255
GAUSS = 1e-4
MILLI_G = 1e-3 * STANDARD_GRAVITY
IMU_ACCEL, IMU_GYRO, IMU_MAG, IMU_ABS, IMU_DIFF, IMU_ALT = 0x7, 0x38, 0x1C0, 0x200, 0x400, 0x800
AXES = ("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag")


def decode_distance(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """DISTANCE_SENSOR 132."""
    if m.orientation != DOWNWARD:
        return []
    stamp = stamp_from_boot_ms(t_rx_ns, m.time_boot_ms)
    inside = m.min_distance <= m.current_distance <= m.max_distance and m.current_distance != FULL_SCALE
    value = m.current_distance * 1e-2 if inside else None
    sd = math.sqrt(m.covariance) * 1e-2 if 0 < m.covariance < UNKNOWN_VARIANCE else None
    valid = inside and m.signal_quality != INVALID_SIGNAL
    if m.type == RADAR:
        return [RadioHeight(stamp=stamp, height_agl=value, sd=sd, valid=valid)]
    return [Range(stamp=stamp, slant_range=value, sd=sd, valid=valid)]


def decode_pressure(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """SCALED_PRESSURE 29; exactly 0 means no pitot tube, or no pressure sensor."""
    stamp = stamp_from_boot_ms(t_rx_ns, m.time_boot_ms)
    measurements: list[Measurement] = []
    if all_finite(m.press_diff):
        measurements.append(ImpactPressure(stamp=stamp, q_c=m.press_diff * HECTOPASCAL, valid=m.press_diff != 0.0))
    if m.press_abs and all_finite(m.press_abs):
        measurements.append(StaticPressure(stamp=stamp, p_static=m.press_abs * HECTOPASCAL))
    return measurements


def _second_pressure(number: int) -> Reader:
    """SCALED_PRESSURE2 137 and 3 143: other sensors, possibly inside the case: readings."""

    def decode(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
        stamp = stamp_from_boot_ms(t_rx_ns, m.time_boot_ms)
        values = ((f"differential_pressure_{number}", m.press_diff), (f"static_pressure_{number}", m.press_abs))
        return [
            Reading(stamp=stamp, name=name, value=value * HECTOPASCAL, unit="Pa")
            for name, value in values
            if math.isfinite(value)
        ]

    return decode


def decode_highres_imu(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """HIGHRES_IMU 105 and HIL_SENSOR 107, of the first sensor (``id`` 0) only."""
    if m.id:
        return []
    stamp, updated = stamp_from_us(t_rx_ns, m.time_usec), m.fields_updated
    accel, gyro, mag = (m.xacc, m.yacc, m.zacc), (m.xgyro, m.ygyro, m.zgyro), (m.xmag, m.ymag, m.zmag)
    measurements: list[Measurement] = []
    accel_b = accel if _has(updated, IMU_ACCEL, *accel) else None
    gyro_b = gyro if _has(updated, IMU_GYRO, *gyro) else None
    if _has(updated, IMU_MAG, *mag):
        measurements.append(MagneticField(stamp=stamp, field_b=(mag[0] * GAUSS, mag[1] * GAUSS, mag[2] * GAUSS)))
    if _has(updated, IMU_DIFF, m.diff_pressure):
        measurements.append(ImpactPressure(stamp=stamp, q_c=m.diff_pressure * HECTOPASCAL))
    if _has(updated, IMU_ABS, m.abs_pressure):
        measurements.append(StaticPressure(stamp=stamp, p_static=m.abs_pressure * HECTOPASCAL))
    if _has(updated, IMU_ALT, m.pressure_alt):
        measurements.append(PressureAltitude(stamp=stamp, alt_press=m.pressure_alt, setting_pa=STANDARD_PA))
    if accel_b or gyro_b:
        measurements.append(ImuSample(stamp=stamp, accel_b=accel_b, gyro_b=gyro_b))
    return measurements


def _has(updated: int, mask: int, *values: float) -> bool:
    return updated & mask == mask and all_finite(*values)


def decode_scaled_imu(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """SCALED_IMU 26: mG, mrad/s, mgauss; a field of exactly 0 means no magnetometer."""
    return _scaled(m, stamp_from_boot_ms(t_rx_ns, m.time_boot_ms))


def decode_raw_imu(m: Any, t_rx_ns: int, settings: Settings) -> list[Measurement]:
    """RAW_IMU 27 of the first sensor (``id`` 0): counts, or the units of SCALED_IMU (ArduPilot: ``raw_imu`` scaled)."""
    if m.id:
        return []
    stamp = stamp_from_us(t_rx_ns, m.time_usec)
    if settings.raw_imu == "scaled":
        return _scaled(m, stamp)
    return [Reading(stamp=stamp, name=f"raw_{axis}", value=float(getattr(m, axis))) for axis in AXES]


def _scaled(m: Any, stamp: Stamp) -> list[Measurement]:
    accel_b = (m.xacc * MILLI_G, m.yacc * MILLI_G, m.zacc * MILLI_G)
    gyro_b = (m.xgyro * 1e-3, m.ygyro * 1e-3, m.zgyro * 1e-3)
    measurements: list[Measurement] = [ImuSample(stamp=stamp, accel_b=accel_b, gyro_b=gyro_b)]
    if m.xmag or m.ymag or m.zmag:
        field_b = (m.xmag * GAUSS * 1e-3, m.ymag * GAUSS * 1e-3, m.zmag * GAUSS * 1e-3)
        measurements.append(MagneticField(stamp=stamp, field_b=field_b))
    return measurements


READERS: dict[int, Reader] = {
    26: decode_scaled_imu,
    27: decode_raw_imu,
    29: decode_pressure,
    105: decode_highres_imu,
    107: decode_highres_imu,
    132: decode_distance,
    137: _second_pressure(2),
    143: _second_pressure(3),
}
