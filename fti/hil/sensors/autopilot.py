"""An autopilot: attitude at its own rate; position, pressure, rangefinder and heartbeat at lower rates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.devices import BoundDevice
from fti.hil.environment import Environment, mounting
from fti.hil.sensors.air_data import AirData
from fti.hil.sensors.avionics import HeadingReference
from fti.hil.sensors.errors import white_noise
from fti.hil.sensors.imu_grades import ImuSettings
from fti.hil.sensors.inertial import inertial_samples
from fti.hil.sensors.magnetometer import earth_field_b
from fti.hil.sensors.sensor_settings import settings_of
from fti.messages.measurements import (
    DeviceStatus,
    ImpactPressure,
    ImuSample,
    MagneticField,
    Measurement,
    Range,
    Stamp,
    StaticPressure,
    TimeScale,
)


class AutopilotUnit:
    """Stamps are the time since power-on; with a rangefinder if the device is an altimeter."""

    rate_hz = 50.0
    time_scale = TimeScale.BOOT

    RANGE_EVERY, POSITION_EVERY, PRESSURE_EVERY, HEARTBEAT_EVERY = 2, 5, 10, 50  # samples
    LASER_SD, FIELD_SD = 0.05, 0.3e-6
    LASER_RANGE_M = (0.2, 500.0)

    def __init__(
        self, bound: BoundDevice, world: Environment, t: NDArray[np.float64], rng: np.random.Generator
    ) -> None:
        state, limits = world.state(t), bound.device.altimeter
        self._reference = HeadingReference(bound, state, world, t, rng)
        self._air = AirData(bound, state, world, t, rng)
        grade = settings_of(ImuSettings, world.scenario, bound.device.name).grade
        self._accel, self._gyro = (
            values_b @ mounting(bound.device) for values_b in inertial_samples(grade, bound, world, state, rng)
        )
        self._field = earth_field_b(state) @ mounting(bound.device) + rng.normal(0.0, self.FIELD_SD, (len(t), 3))
        self._limits = limits.range_m if limits else self.LASER_RANGE_M
        self._ranges = world.laser_ranges(t, bound.device) + white_noise(t, self.LASER_SD, rng) if limits else None

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The measurements of cycle k."""
        ax, ay, az = self._accel[k].tolist()
        gx, gy, gz = self._gyro[k].tolist()
        mx, my, mz = self._field[k].tolist()
        measurements: list[Measurement] = [
            MagneticField(stamp=stamp, field_b=(mx, my, mz)),
            ImuSample(stamp=stamp, accel_b=(ax, ay, az), gyro_b=(gx, gy, gz)),
            self._reference.attitude(k, stamp),
        ]
        if self._ranges is not None and k % self.RANGE_EVERY == 0:
            measurements.append(self._range(float(self._ranges[k]), stamp))
        if k % self.POSITION_EVERY == 0:
            reference = self._reference
            measurements += [reference.satellites(k, stamp), reference.velocity(k, stamp), reference.position(k, stamp)]
        if k % self.PRESSURE_EVERY == 0:
            measurements += [
                ImpactPressure(stamp=stamp, q_c=float(self._air.q_c[k])),
                StaticPressure(stamp=stamp, p_static=float(self._air.p_static[k])),
            ]
        if k % self.HEARTBEAT_EVERY == 0:
            measurements.append(DeviceStatus(stamp=stamp, ok=True, flags=("active", "armed", "auto")))
        return measurements

    def _range(self, slant_range: float, stamp: Stamp) -> Range:
        valid = self._limits[0] <= slant_range <= self._limits[1]
        return Range(stamp=stamp, slant_range=slant_range if valid else None, sd=self.LASER_SD, valid=valid)
