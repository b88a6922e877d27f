"""Measurements to MAVLink messages, as an autopilot sends them; what is sent when stands in ``mavlink``."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common

from fti.drivers._times import device_time_ns
from fti.drivers._units import DEGREE, HECTOPASCAL, wrap_half_turn, wrap_heading
from fti.drivers.mavlink.decode import (
    DOWNWARD,
    FIX_3D,
    IMU_ACCEL,
    IMU_GYRO,
    INVALID_SIGNAL,
    LASER,
    RADAR,
    UNKNOWN_U16,
    UNKNOWN_VARIANCE,
)
from fti.types import (
    Attitude,
    DeviceTime,
    ImpactPressure,
    ImuSample,
    Measurement,
    Position,
    RadioHeight,
    Range,
    Stamp,
    StaticPressure,
    TimeScale,
    Velocity,
)

DISTANCE_MIN_CM, DISTANCE_MAX_CM = 1, 0xFFFE


class Encoder:
    """The autopilot's end of the line."""

    def __init__(self, system: int, height: str) -> None:
        self._height = height
        self._mavlink = common.MAVLink(None, srcSystem=system, srcComponent=1)
        self._held: dict[type, Any] = {}
        self._encoders: dict[type, Callable[[Any], list[Any]]] = {
            Attitude: self._attitude,
            ImuSample: self._imu,
            Position: self._position,
            StaticPressure: self._pressure,
            Range: self._distance,
            RadioHeight: self._distance,
            DeviceTime: self._time,
        }

    def encode(self, measurement: Measurement) -> list[bytes]:
        self._held[type(measurement)] = measurement
        encoder = self._encoders.get(type(measurement))
        return [self._pack(message) for message in encoder(measurement)] if encoder else []

    def respond(self, data: bytes) -> list[bytes]:
        return []

    def _pack(self, message: Any) -> bytes:
        data = bytes(message.pack(self._mavlink))
        self._mavlink.seq = (self._mavlink.seq + 1) & 0xFF
        return data

    def _beside(self, kind: type, measurement: Measurement) -> Any:
        """What was last told of that kind, if it was at the same time."""
        held = self._held.get(kind)
        return held if held is not None and held.stamp.t_rx_ns == measurement.stamp.t_rx_ns else None

    def _attitude(self, m: Attitude) -> list[Any]:
        if m.roll is None or m.pitch is None or not m.valid:
            return []
        imu = self._beside(ImuSample, m)
        rates = imu.gyro_b if imu and imu.gyro_b else (math.nan,) * 3
        yaw = math.nan if m.heading is None else wrap_half_turn(m.heading)
        return [common.MAVLink_attitude_message(_boot_ms(m.stamp), m.roll, m.pitch, yaw, *rates)]

    def _imu(self, m: ImuSample) -> list[Any]:
        if m.accel_b is None:
            return []
        fields = IMU_ACCEL | (IMU_GYRO if m.gyro_b else 0)
        values = (*m.accel_b, *(m.gyro_b or (0.0,) * 3), *(0.0,) * 7)
        return [common.MAVLink_highres_imu_message(_boot_us(m.stamp), *values, fields)]

    def _position(self, m: Position) -> list[Any]:
        if m.lat is None or m.lon is None:
            return []
        velocity = self._beside(Velocity, m)
        receiver = [self._gps_raw(m, velocity)] if m.alt is not None and m.alt_msl is not None else []
        height = m.alt_msl if self._height == "msl" else m.alt
        vel = _speeds(velocity)
        if height is None or vel is None or not m.valid:
            return receiver
        where = (_e7(m.lat), _e7(m.lon), round(height * 1000), 0)
        return [
            common.MAVLink_global_position_int_message(_boot_ms(m.stamp), *where, *vel, UNKNOWN_U16),
            *receiver,
        ]

    def _gps_raw(self, m: Position, velocity: Velocity | None) -> Any:
        speed, track = _polar(velocity)
        return common.MAVLink_gps_raw_int_message(
            time_usec=_boot_us(m.stamp),
            fix_type=FIX_3D if m.valid else 1,
            lat=_e7(m.lat or 0.0),
            lon=_e7(m.lon or 0.0),
            alt=round((m.alt_msl or 0.0) * 1000),
            eph=UNKNOWN_U16,
            epv=UNKNOWN_U16,
            vel=UNKNOWN_U16 if speed is None else _limited(speed * 100, 0, UNKNOWN_U16 - 1),
            cog=UNKNOWN_U16 if track is None else round(track / DEGREE * 100) % 36_000,
            satellites_visible=255,
            alt_ellipsoid=round((m.alt or 0.0) * 1000),
            h_acc=round((m.horizontal_sd or 0.0) * 1000),
            v_acc=round((m.vertical_sd or 0.0) * 1000),
        )

    def _pressure(self, m: StaticPressure) -> list[Any]:
        impact = self._beside(ImpactPressure, m)
        q_c = impact.q_c / HECTOPASCAL if impact else math.nan
        return [common.MAVLink_scaled_pressure_message(_boot_ms(m.stamp), m.p_static / HECTOPASCAL, q_c, 0)]

    def _distance(self, m: Range | RadioHeight) -> list[Any]:
        kind, value = (RADAR, m.height_agl) if isinstance(m, RadioHeight) else (LASER, m.slant_range)
        current = 0 if value is None else _limited(value * 100, DISTANCE_MIN_CM, UNKNOWN_U16)
        variance = UNKNOWN_VARIANCE if m.sd is None else _limited((m.sd * 100) ** 2, 1, UNKNOWN_VARIANCE - 1)
        return [
            common.MAVLink_distance_sensor_message(
                _boot_ms(m.stamp), DISTANCE_MIN_CM, DISTANCE_MAX_CM, current, kind, 0, DOWNWARD, variance,
                signal_quality=100 if m.valid else INVALID_SIGNAL,
            )
        ]  # fmt: skip

    def _time(self, m: DeviceTime) -> list[Any]:
        unix_us = device_time_ns(m.stamp, TimeScale.UTC) // 1000
        return [common.MAVLink_system_time_message(unix_us, _boot_ms(m.stamp))]


def _boot_us(stamp: Stamp) -> int:
    return device_time_ns(stamp, TimeScale.BOOT) // 1000


def _boot_ms(stamp: Stamp) -> int:
    return device_time_ns(stamp, TimeScale.BOOT) // 1_000_000 & 0xFFFF_FFFF


def _limited(value: float, low: int, high: int) -> int:
    return max(low, min(high, round(value)))


def _e7(angle: float) -> int:
    return round(angle / DEGREE * 1e7)


def _speeds(velocity: Velocity | None) -> list[int] | None:
    """North, east, down [cm/s]; None unless all are known, for the message cannot say that one is not."""
    if velocity is None or velocity.north is None or velocity.east is None or velocity.down is None:
        return None
    return [_limited(v * 100, -0x8000, 0x7FFF) for v in (velocity.north, velocity.east, velocity.down)]


def _polar(velocity: Velocity | None) -> tuple[float | None, float | None]:
    """Ground speed and track, from north and east where those are known."""
    if velocity is None:
        return None, None
    if velocity.north is None or velocity.east is None:
        return velocity.ground_speed, velocity.track
    return math.hypot(velocity.north, velocity.east), wrap_heading(math.atan2(velocity.east, velocity.north))
