"""An inertial navigation system: attitude, velocity, position, inertial samples; and the inputs of inertial sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fti.arrays import Array
from fti.constants import STANDARD_GRAVITY
from fti.devices import BoundDevice
from fti.geodesy.formulas import EARTH_RATE
from fti.geodesy.gravity import normal_gravity, transport_rate
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.hil.environment import Environment, mounting
from fti.hil.faults.gnss import GnssFaults
from fti.hil.flight.trajectory import FlightState, earth_frame_velocity
from fti.hil.sensors.base import position_at, velocity_at
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.sensors.imu import Imu
from fti.hil.sensors.imu_grades import GRADES, GradeName, calibrate_gyros
from fti.hil.sensors.inertial_aids import AidingMessages, status
from fti.hil.sensors.inertial_solution import (
    BARO_PERIOD_S,
    BARO_SD,
    InertialSettings,
    InertialUnitSamples,
    InsOutput,
    add_free_intervals,
    aided_output,
    drift_sigmas,
    free_mask,
)
from fti.hil.sensors.sensor_settings import settings_of
from fti.hil.tables.fault_types import Fault, InertialBias
from fti.messages.measurements import Attitude, ImuSample, Measurement, Position, Stamp, TimeScale, Velocity

EARTH_RATE_E = np.array([0.0, 0.0, EARTH_RATE])


def specific_force_b(state: FlightState) -> Array:
    """Specific force of ideal accelerometers [m/s^2], shape (n, 3): Earth-fixed acceleration + Coriolis - gravity.

    Source: Spiegel 2018, eq. 7.2, in e.
    """
    coriolis_e = 2.0 * np.cross(EARTH_RATE_E, earth_frame_velocity(state))
    mat = mat_en(state.lat, state.lon)
    force_n = np.einsum("nji,nj->ni", mat, state.accel_e + coriolis_e)
    force_n[:, 2] -= normal_gravity(state.lat, state.alt)
    return np.asarray(np.einsum("nji,nj->ni", mat_from_rpy(state.roll, state.pitch, state.heading), force_n))


def angular_rate_b(state: FlightState) -> Array:
    """Angular rate of ideal gyros [rad/s], shape (n, 3): rates of the body + of the local level + of the Earth.

    Source: Spiegel 2018, eq. 7.3.
    """
    transport_n = transport_rate(state.lat, state.alt, state.vel_n)
    earth_n = np.einsum("nji,j->ni", mat_en(state.lat, state.lon), EARTH_RATE_E)
    mat_nb = mat_from_rpy(state.roll, state.pitch, state.heading)
    return np.asarray(state.omega_nb_b + np.einsum("nji,nj->ni", mat_nb, transport_n + earth_n))


def inertial_samples(
    grade: GradeName, bound: BoundDevice, world: Environment, state: FlightState, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Specific force [m/s^2] and angular rate [rad/s] measured by a unit of a grade, in b, shape (n, 3)."""
    force, rate = Imu(calibrate_gyros(GRADES[grade]), rng).measure(
        state.t, specific_force_b(state), angular_rate_b(state)
    )
    return _with_steps(force, rate, state.t, bound, world)


def _with_steps(force: Array, rate: Array, t: Array, bound: BoundDevice, world: Environment) -> tuple[Array, Array]:
    """Add the bias steps of faults, which are in axes of the device; values in b, shape (n, 3)."""
    force_s, rate_s = bias_steps(bound.device.name, world.scenario.fault, t)
    mat_sb = mounting(bound.device).T
    return force + force_s @ mat_sb, rate + rate_s @ mat_sb


class InertialNavigation:
    """A system of a grade, aided by satellites or free; its messages state its errors."""

    rate_hz = 100.0
    time_scale = TimeScale.UTC

    #: Minimum sample rate of its unit, independent of the message rate [Hz].
    UNIT_HZ = 100.0

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        state, name = world.state(t), bound.device.name
        settings = settings_of(InertialSettings, world.scenario, name)
        faults, sigmas = GnssFaults(name, world.scenario.fault), drift_sigmas(settings.grade)
        output, (own,) = aided_output(state, sigmas, faults.offset_n(t), rng), rng.spawn(1)
        unit = _unit(settings.grade, bound, world, t, own)
        inertial = (values_b[:: unit.every] @ mounting(bound.device) for values_b in (unit.force_b, unit.rate_b))
        output = add_free_intervals(output, free_mask(t, settings, faults), unit, sigmas, own)
        self._is_free, self._undulation = output.is_free.tolist(), world.undulation
        self._rows = np.column_stack([*inertial, *_solution_columns(output, state, bound)])
        self._aids = AidingMessages(bound, world, t, rng, output=output)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Inertial sample, attitude, velocity, position: the content of one message; then the slower messages."""
        row, is_free = self._rows[k].tolist(), self._is_free[k]
        ax, ay, az, gx, gy, gz, roll, pitch, heading, north, east, down, *position, h_sd, v_sd, velocity_sd = row
        return [
            # the status when the system loses or regains its satellites; later messages repeat it
            *([status(stamp, is_free=is_free)] if is_free != (self._is_free[k - 1] if k else False) else []),
            ImuSample(stamp=stamp, accel_b=(ax, ay, az), gyro_b=(gx, gy, gz)),
            Attitude(stamp=stamp, roll=roll, pitch=pitch, heading=heading),
            Velocity(stamp=stamp, north=north, east=east, down=down, sd=velocity_sd),
            self._position(stamp, *position, horizontal_sd=h_sd, vertical_sd=v_sd),
            *self._aids.measure(k, stamp),
        ]

    def _position(
        self, stamp: Stamp, lat: float, lon: float, alt: float, *, horizontal_sd: float, vertical_sd: float
    ) -> Position:
        return Position(
            stamp=stamp,
            lat=lat,
            lon=lon,
            alt=alt,
            alt_msl=alt - self._undulation,
            undulation=self._undulation,
            horizontal_sd=horizontal_sd,
            vertical_sd=vertical_sd,
        )


def _solution_columns(output: InsOutput, state: FlightState, bound: BoundDevice) -> tuple[Array, ...]:
    """Columns of the solution at the device, as ``InertialNavigation.measure`` takes them."""
    solution, arm_b = output.solution, bound.device.lever_arm_b
    arm_vel_n = velocity_at(state, arm_b) - state.vel_n
    device, reference = position_at(state, arm_b), (state.lat, state.lon, state.alt)
    arm = [to - at for to, at in zip(device, reference, strict=True)]
    position = (at + offset for at, offset in zip((solution.lat, solution.lon, solution.alt), arm, strict=True))
    return solution.rpy, solution.vel_n + arm_vel_n, *position, output.deviations[:, [0, 2, 3]]


def _unit(
    grade: GradeName, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator
) -> InertialUnitSamples:
    """Samples of the unit of a system that sends at t, shape (n,) [s, evenly spaced]."""
    period = float(t[-1] - t[0]) / max(len(t) - 1, 1) or 1.0
    every = max(math.ceil(InertialNavigation.UNIT_HZ * period - 1e-3), 1)
    unit_t = t[0] + period / every * np.arange((len(t) - 1) * every + 1)
    state, imu = world.state(np.minimum(unit_t, t[-1])), Imu(calibrate_gyros(GRADES[grade]), rng)
    force, rate = specific_force_b(state), angular_rate_b(state)
    measured = _with_steps(*imu.measure(unit_t, force, rate), unit_t, bound, world)
    baro = world.atmosphere.pressure_altitude(state.alt - world.undulation) + gauss_markov_noise(
        unit_t, BARO_SD, BARO_PERIOD_S, rng
    )
    return InertialUnitSamples(imu, every, period / every, *measured, force, rate, baro)


DEG_PER_HOUR = math.radians(1.0) / 3600.0


def bias_steps(device: str, faults: Sequence[Fault], t: Array) -> tuple[Array, Array]:
    """Biases added to specific force [m/s^2] and angular rate [rad/s] of a device, (n, 3), at t [s], shape (n,)."""
    force, rate = np.zeros((*t.shape, 3)), np.zeros((*t.shape, 3))
    for fault in faults:
        if isinstance(fault, InertialBias) and fault.includes_device(device):
            here = (t >= fault.from_s) & (t < fault.to_s)
            force[here] += 1e-3 * STANDARD_GRAVITY * np.array(fault.accel_mg)
            rate[here] += DEG_PER_HOUR * np.array(fault.gyro_degph)
    return force, rate
