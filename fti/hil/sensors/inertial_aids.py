"""The slower messages of an inertial navigation system: receiver, air data, magnetometer, standard deviations, status.

A message is sent only if the options of the device enable it, with every divider-th sample, or at the rate of the aid
if the divider is 0.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fti.arrays import Array
from fti.devices import BoundDevice
from fti.drivers.imar_ixcom.deviations import ITEMS
from fti.drivers.imar_ixcom.options import Options
from fti.drivers.imar_ixcom.status import HEALTHY
from fti.hil.environment import Environment, mounting
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.air_data import STANDARD_PA, AirData
from fti.hil.sensors.avionics import HeadingReference
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.sensors.inertial_solution import InsOutput
from fti.hil.sensors.magnetometer import earth_field_b
from fti.messages.measurements import (
    Airspeed,
    DeviceStatus,
    MagneticField,
    Measurement,
    PressureAltitude,
    Reading,
    Stamp,
)

Measure = Callable[[int, Stamp], list[Measurement]]

#: Rates of new data of the aids [Hz].
AID_RATES_HZ = {"GNSSSOL": 5.0, "AIRDATA": 10.0, "MAGDATA": 10.0, "EKFSTDDEV": 1.0, "SYSSTAT": 1.0}
FIELD_SD, FIELD_BIAS_SD = 1e-7, 3e-7  # [T], noise and residual error after calibration
AIDED_STATUS = (*HEALTHY, "in_motion", "ekf_levelling_complete", "ekf_stationary_align_complete", "ekf_position_valid")
FREE_STATUS = (*("position_medium" if flag == "position_high" else flag for flag in AIDED_STATUS), "gnss_invalid")
#: One sigma of the other states of the filter: accelerometer [m/s^2] and gyro bias [rad/s], scale factors.
ACCEL_BIAS_SD, GYRO_BIAS_SD, SCALE_SD = 5e-4, 5e-8, 5e-5


class AidingMessages:
    """The slower messages of one system.

    output : solution of the system with its standard deviations
    """

    def __init__(
        self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator, *, output: InsOutput
    ) -> None:
        logs = bound.options.logs if isinstance(bound.options, Options) else {}
        state, rate_hz = world.state(t), 1.0 / float(np.median(np.diff(t))) if len(t) > 1 else 1.0
        makers: dict[str, Callable[[], Measure]] = {
            "GNSSSOL": lambda: _receiver(HeadingReference(bound, state, world, t, rng)),
            "AIRDATA": lambda: _air_data(AirData(bound, state, world, t, rng)),
            "MAGDATA": lambda: _magnetometer(bound, state, t, rng),
            "EKFSTDDEV": lambda: _filter(output.deviations),
            "SYSSTAT": lambda: lambda k, stamp: [status(stamp, is_free=bool(output.is_free[k]))],
        }
        self._aids = [
            (logs[name] or max(round(rate_hz / AID_RATES_HZ[name]), 1), make())
            for name, make in makers.items()
            if name in logs
        ]

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The messages due with sample k."""
        return [m for every, measure in self._aids if k % every == 0 for m in measure(k, stamp)] if self._aids else []


def _receiver(reference: HeadingReference) -> Measure:
    def measure(k: int, stamp: Stamp) -> list[Measurement]:
        return [reference.satellites(k, stamp), reference.velocity(k, stamp), reference.position(k, stamp)]

    return measure


def _air_data(air: AirData) -> Measure:
    def measure(k: int, stamp: Stamp) -> list[Measurement]:
        measurements = air.measure(k, stamp)
        standard = [m for m in measurements if not isinstance(m, PressureAltitude) or m.setting_pa == STANDARD_PA]
        return sorted(standard, key=lambda m: isinstance(m, Airspeed))  # which completes the message

    return measure


def _magnetometer(bound: BoundDevice, state: FlightState, t: Array, rng: np.random.Generator) -> Measure:
    bias = np.stack([gauss_markov_noise(t, FIELD_BIAS_SD, 300.0, rng) for _ in range(3)], axis=1)
    field = (earth_field_b(state) + bias) @ mounting(bound.device) + rng.normal(0.0, FIELD_SD, (len(t), 3))

    def measure(k: int, stamp: Stamp) -> list[Measurement]:
        x, y, z = map(float, field[k])
        return [MagneticField(stamp=stamp, field_b=(x, y, z))]

    return measure


def _filter(deviations: Array) -> Measure:
    fixed = (*[ACCEL_BIAS_SD] * 3, *[GYRO_BIAS_SD] * 3, *[SCALE_SD] * 6, 1.0)

    def measure(k: int, stamp: Stamp) -> list[Measurement]:
        values = (*deviations[k].tolist(), *fixed)
        return [
            Reading(stamp=stamp, name=item.name, unit=item.unit, value=float(value))
            for item, value in zip(ITEMS, values, strict=True)
        ]

    return measure


def status(stamp: Stamp, *, is_free: bool) -> DeviceStatus:
    """Status of the system; is_free : not aided by satellites"""
    return DeviceStatus(stamp=stamp, ok=True, flags=FREE_STATUS if is_free else AIDED_STATUS)
