"""The emulated autopilot or simulator: measurements to MAVLink messages; ``mavlink`` lists them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common

from fti.drivers import Counters
from fti.drivers._framing import Framer
from fti.drivers.mavlink import sensors
from fti.drivers.mavlink.commands import REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, Options
from fti.drivers.mavlink.fields import UNKNOWN_U16, all_finite
from fti.drivers.mavlink.motion import FIX_3D, NO_SATELLITES
from fti.drivers.mavlink.system import MODES, STATES
from fti.drivers.mavlink.wire import FRAME_MAX, Frames, header, layout, payload
from fti.formats.device_time import device_time_ns
from fti.formats.unit_factors import DEGREE, HECTOPASCAL
from fti.geodesy.formulas import wrap_half_turn, wrap_heading
from fti.messages.measurements import (
    Attitude,
    DeviceStatus,
    DeviceTime,
    ImpactPressure,
    ImuSample,
    MagneticField,
    Measurement,
    Position,
    RadioHeight,
    Range,
    Satellites,
    Stamp,
    StaticPressure,
    TimeScale,
    Velocity,
)

DISTANCE_MIN_CM, DISTANCE_MAX_CM = 1, 0xFFFE
COMMAND_LONG = 76
MIN_INTERVAL_FRACTION = 0.95  # of an interval: tolerance for clock drift
Make = Callable[[Any], list[Any]]


class Encoder:
    """The emulated autopilot or simulator."""

    def __init__(self, options: Options) -> None:
        self._height = options.height
        self._mavlink = common.MAVLink(None, srcSystem=options.system or 1, srcComponent=options.component or 1)
        self._last_values: dict[type, Any] = {}
        autopilot: dict[type, Make] = {
            Attitude: self._attitude,
            ImuSample: self._imu,
            Position: self._position,
            StaticPressure: self._pressure,
            Range: self._distance,
            RadioHeight: self._distance,
            DeviceTime: self._time,
            DeviceStatus: self._heartbeat,
        }
        simulator: dict[type, Make] = {ImuSample: self._hil_sensor, Position: self._hil_gps}
        self._encoders = autopilot if options.emulate == "autopilot" else simulator
        self._requests = GroundStationRequests()

    def encode(self, measurement: Measurement) -> list[bytes]:
        self._last_values[type(measurement)] = measurement
        encoder = self._encoders.get(type(measurement))
        messages = encoder(measurement) if encoder else []
        return [self._pack(m) for m in messages if self._requests.is_due(m, measurement.stamp.t_rx_ns)]

    def respond(self, data: bytes) -> list[bytes]:
        return [self._pack(answer) for answer in self._requests.respond(data)]

    def _pack(self, message: Any) -> bytes:
        data = bytes(message.pack(self._mavlink))
        self._mavlink.seq = (self._mavlink.seq + 1) & 0xFF
        return data

    def _simultaneous(self, kind: type, measurement: Measurement) -> Any:
        """The last measurement of that class, if it has the same t_rx_ns."""
        held = self._last_values.get(kind)
        return held if held is not None and held.stamp.t_rx_ns == measurement.stamp.t_rx_ns else None

    # ----------------------------------------------------------------------------------------------------- autopilot

    def _attitude(self, m: Attitude) -> list[Any]:
        if m.roll is None or m.pitch is None or not m.valid:
            return []
        imu = self._simultaneous(ImuSample, m)
        rates = imu.gyro_b if imu and imu.gyro_b else (math.nan,) * 3
        yaw = math.nan if m.heading is None else wrap_half_turn(m.heading)
        return [common.MAVLink_attitude_message(_boot_ms(m.stamp), m.roll, m.pitch, yaw, *rates)]

    def _imu(self, m: ImuSample) -> list[Any]:
        if m.accel_b is None:
            return []
        fields, values = self._inertial(m)
        return [common.MAVLink_highres_imu_message(_boot_us(m.stamp), *values, 0.0, 0.0, 0.0, 0.0, fields)]

    def _inertial(self, m: ImuSample) -> tuple[int, tuple[float, ...]]:
        """Bits of the known fields, and nine values; unknown ones are 0."""
        mag = self._simultaneous(MagneticField, m)
        parts = (
            (sensors.IMU_ACCEL, m.accel_b),
            (sensors.IMU_GYRO, m.gyro_b),
            (sensors.IMU_MAG, tuple(b / sensors.GAUSS for b in mag.field_b) if mag else None),
        )
        fields = sum(bits for bits, vector in parts if vector)
        return fields, tuple(value for _, vector in parts for value in vector or (0.0,) * 3)

    def _position(self, m: Position) -> list[Any]:
        velocity = self._simultaneous(Velocity, m)
        is_complete = None not in (m.lat, m.lon, m.alt, m.alt_msl)
        receiver = [self._gps_raw(m, velocity)] if is_complete or not m.valid else []
        if m.lat is None or m.lon is None:
            return receiver
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
        hdop, vdop, used = self._quality(m)
        return common.MAVLink_gps_raw_int_message(
            time_usec=_boot_us(m.stamp),
            fix_type=FIX_3D if m.valid else 1,
            lat=_e7(m.lat or 0.0),
            lon=_e7(m.lon or 0.0),
            alt=round((m.alt_msl or 0.0) * 1000),
            eph=hdop,
            epv=vdop,
            vel=_speed_u16(speed),
            cog=_course(track),
            satellites_visible=used,
            alt_ellipsoid=round((m.alt or 0.0) * 1000),
            h_acc=round((m.horizontal_sd or 0.0) * 1000),
            v_acc=round((m.vertical_sd or 0.0) * 1000),
        )

    def _quality(self, m: Position) -> tuple[int, int, int]:
        """HDOP and VDOP [1/100] and satellites of the same t_rx_ns."""
        sky = self._simultaneous(Satellites, m)
        if sky is None:
            return UNKNOWN_U16, UNKNOWN_U16, NO_SATELLITES
        hdop, vdop = (UNKNOWN_U16 if x is None else _limited(x * 100, 0, UNKNOWN_U16 - 1) for x in (sky.hdop, sky.vdop))
        return hdop, vdop, NO_SATELLITES if sky.used is None else min(sky.used, NO_SATELLITES - 1)

    def _pressure(self, m: StaticPressure) -> list[Any]:
        impact = self._simultaneous(ImpactPressure, m)
        q_c = impact.q_c / HECTOPASCAL if impact else math.nan
        return [common.MAVLink_scaled_pressure_message(_boot_ms(m.stamp), m.p_static / HECTOPASCAL, q_c, 0)]

    def _distance(self, m: Range | RadioHeight) -> list[Any]:
        kind, value = (sensors.RADAR, m.height_agl) if isinstance(m, RadioHeight) else (sensors.LASER, m.slant_range)
        current = 0 if value is None else _limited(value * 100, DISTANCE_MIN_CM, UNKNOWN_U16)
        variance = (
            sensors.UNKNOWN_VARIANCE if m.sd is None else _limited((m.sd * 100) ** 2, 1, sensors.UNKNOWN_VARIANCE - 1)
        )
        return [
            common.MAVLink_distance_sensor_message(
                _boot_ms(m.stamp), DISTANCE_MIN_CM, DISTANCE_MAX_CM, current, kind, 0, sensors.DOWNWARD, variance,
                signal_quality=100 if m.valid else sensors.INVALID_SIGNAL,
            )
        ]  # fmt: skip

    def _time(self, m: DeviceTime) -> list[Any]:
        unix_us = device_time_ns(m.stamp, TimeScale.UTC) // 1000
        return [common.MAVLink_system_time_message(unix_us, _boot_ms(m.stamp))]

    def _heartbeat(self, m: DeviceStatus) -> list[Any]:
        """Heartbeat of a fixed-wing aircraft, if the flags name a state."""
        state = next((STATES.index(flag) for flag in m.flags if flag in STATES), None)
        if state is None:
            return []
        modes = sum(bit for bit, name in MODES.items() if name in m.flags)
        autopilot = common.MAV_AUTOPILOT_GENERIC
        return [common.MAVLink_heartbeat_message(common.MAV_TYPE_FIXED_WING, autopilot, modes, 0, state, 3)]

    # ----------------------------------------------------------------------------------------------------- simulator

    def _hil_sensor(self, m: ImuSample) -> list[Any]:
        """HIL_SENSOR with magnetic field and pressures of the same t_rx_ns."""
        fields, values = self._inertial(m)
        static, impact = self._simultaneous(StaticPressure, m), self._simultaneous(ImpactPressure, m)
        fields |= (sensors.IMU_ABS if static else 0) | (sensors.IMU_DIFF if impact else 0)
        p_static = static.p_static / HECTOPASCAL if static else 0.0
        q_c = impact.q_c / HECTOPASCAL if impact else 0.0
        return [common.MAVLink_hil_sensor_message(_boot_us(m.stamp), *values, p_static, q_c, 0.0, 0.0, fields)]

    def _hil_gps(self, m: Position) -> list[Any]:
        velocity = self._simultaneous(Velocity, m)
        vel = _speeds(velocity) if m.valid else [0, 0, 0]
        if m.valid and (m.lat is None or m.lon is None or m.alt_msl is None or vel is None):
            return []
        speed, track = _polar(velocity)
        hdop, vdop, used = self._quality(m)
        return [
            common.MAVLink_hil_gps_message(
                _boot_us(m.stamp), FIX_3D if m.valid else 1, _e7(m.lat or 0.0), _e7(m.lon or 0.0),
                round((m.alt_msl or 0.0) * 1000), hdop, vdop, _speed_u16(speed), *(vel or ()), _course(track), used,
            )
        ]  # fmt: skip


class GroundStationRequests:
    """Requests of a ground station to the emulated autopilot: message intervals, and single messages."""

    def __init__(self) -> None:
        self._framer = Framer(Frames("common", None).measure, Counters(), limit=FRAME_MAX)
        self._intervals: dict[int, int] = {}  # message -> ns; negative: never
        self._last_sent_ns: dict[int, int] = {}
        self._last: dict[int, Any] = {}

    def is_due(self, message: Any, t_ns: int) -> bool:
        """Is this message due?"""
        number = message.get_msgId()
        self._last[number] = message
        interval = self._intervals.get(number, 0)
        since = t_ns - self._last_sent_ns.get(number, t_ns - interval)
        if interval < 0 or since < MIN_INTERVAL_FRACTION * interval:
            return False
        self._last_sent_ns[number] = t_ns
        return True

    def respond(self, data: bytes) -> list[Any]:
        """Answers to the requests that these bytes complete."""
        answers: list[Any] = []
        for _, frame in self._framer.feed(data, 0):
            message = layout("common", header(frame).message)
            if message is not None and header(frame).message == COMMAND_LONG:
                answers += self._execute(message.fields(payload(frame)), header(frame).system, header(frame).component)
        return answers

    def _execute(self, m: Any, system: int, component: int) -> list[Any]:
        """Execute a command; a single message is the last one of its number."""
        requested = self._last.get(m.param1)
        result, extra = common.MAV_RESULT_ACCEPTED, []
        if m.command == SET_MESSAGE_INTERVAL and all_finite(m.param1, m.param2):
            self._intervals[int(m.param1)] = int(m.param2 * 1000)
        elif m.command == REQUEST_MESSAGE and requested is not None:
            extra = [requested]
        else:
            result = common.MAV_RESULT_UNSUPPORTED
        ack = common.MAVLink_command_ack_message(m.command, result, target_system=system, target_component=component)
        return [ack, *extra]


def _boot_us(stamp: Stamp) -> int:
    return device_time_ns(stamp, TimeScale.BOOT) // 1000


def _boot_ms(stamp: Stamp) -> int:
    return device_time_ns(stamp, TimeScale.BOOT) // 1_000_000 & 0xFFFF_FFFF


def _limited(value: float, low: int, high: int) -> int:
    return max(low, min(high, round(value)))


def _e7(angle: float) -> int:
    return round(angle / DEGREE * 1e7)


def _speed_u16(speed: float | None) -> int:
    return UNKNOWN_U16 if speed is None else _limited(speed * 100, 0, UNKNOWN_U16 - 1)


def _course(track: float | None) -> int:
    return UNKNOWN_U16 if track is None else round(track / DEGREE * 100) % 36_000


def _speeds(velocity: Velocity | None) -> list[int] | None:
    """North, east, down [cm/s]; None unless all are known: the message has no unknown value."""
    if velocity is None or velocity.north is None or velocity.east is None or velocity.down is None:
        return None
    return [_limited(v * 100, -0x8000, 0x7FFF) for v in (velocity.north, velocity.east, velocity.down)]


def _polar(velocity: Velocity | None) -> tuple[float | None, float | None]:
    """Ground speed and track, from north and east if known."""
    if velocity is None:
        return None, None
    if velocity.north is None or velocity.east is None:
        return velocity.ground_speed, velocity.track
    return math.hypot(velocity.north, velocity.east), wrap_heading(math.atan2(velocity.east, velocity.north))
