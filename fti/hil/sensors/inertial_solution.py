"""Solution of an inertial navigation system over a flight, aided by satellites or free.

An aided system has small, slow errors of the stated size.  Their values are assumed (without data sheet), for a
navigation-grade system whose receiver has no corrections, and for the other grades.  A free system (from a given time,
or while its receiver has no signals) continues from its last solution with the samples of its unit, and its standard
deviations grow with its errors.  The constant errors of the unit that the filter has estimated are removed; the
residuals have the stated standard deviations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from fti.arrays import Array, Mask
from fti.config.keys import NO_UNIT, key
from fti.constants import STANDARD_GRAVITY
from fti.geodesy.formulas import SEMI_MAJOR
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.faults.gnss import GnssFaults
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.air_data import AirSettings
from fti.hil.sensors.errors import gauss_markov_noise, white_noise
from fti.hil.sensors.free_inertial import TAU_S, DriftSigmas, InertialSolution, drift_sd, run_free
from fti.hil.sensors.imu import Imu
from fti.hil.sensors.imu_grades import GRADES, GradeName, calibrate_gyros
from fti.hil.tables.fault_base import NotNegative

POSITION_PERIOD_S, VELOCITY_PERIOD_S, ATTITUDE_PERIOD_S = 60.0, 20.0, 100.0
#: Drift of a barometric height since it was set to the last fix [m], and correlation time [s]: assumed.
BARO_SD, BARO_PERIOD_S = 3.0, 300.0
#: One sigma of an aided system: tilt and heading [deg], velocity [m/s], position and height [m].
AIDED_SIGMAS: dict[GradeName, tuple[float, float, float, float, float]] = {
    "navigation": (0.03, 0.08, 0.03, 1.0, 0.8),
    "tactical": (0.05, 0.2, 0.03, 1.0, 0.8),
    "mems": (0.3, 1.0, 0.1, 1.5, 1.2),
}
#: Time from the return of the signals to the next fix [s].
REACQUIRE_S = 2.0
#: Smallest number of samples for a free interval.
MIN_SAMPLES = 6


class InertialSettings(AirSettings):
    """Inertial navigation systems."""

    grade: Annotated[GradeName, key("grade of the inertial unit", NO_UNIT)] = "navigation"
    mode: Annotated[
        Literal["aided", "free"],
        key("aided: by satellites, except in outages of its receiver; free: not aided from free_from_s on", NO_UNIT),
    ] = "aided"
    free_from_s: Annotated[NotNegative, key("in free mode: time of the flight at which aiding ends", "s")] = 0.0


def drift_sigmas(grade: GradeName) -> DriftSigmas:
    """One sigma of an aided system; of its unit, errors that a filter cannot separate from tilt and noise."""
    tilt_deg, heading_deg, velocity, position, height = AIDED_SIGMAS[grade]
    tilt, unit = math.radians(tilt_deg), calibrate_gyros(GRADES[grade])
    accel = min(unit.accel.turn_on, STANDARD_GRAVITY * tilt)
    heading = math.radians(heading_deg)
    return DriftSigmas(accel, unit.accel.in_run, unit.gyro.turn_on, tilt, heading, velocity, position, height)


@dataclass(frozen=True, eq=False)
class InsOutput:
    """Solution of a system with its standard deviations.

    solution      : at all samples
    deviations    : one sigma of east, north, height [m], velocity north, east, down [m/s], tilt north, east, down
                    [rad], shape (n, 9)
    is_free       : not aided, shape (n,)
    """

    solution: InertialSolution
    deviations: Array
    is_free: Mask


def aided_output(
    state: FlightState, sigmas: DriftSigmas, offsets: tuple[Array, Array], rng: np.random.Generator
) -> InsOutput:
    """Truth plus drifting errors.  offsets : of the satellites' position [m] and velocity [m/s], in n."""
    t = state.t
    roll = state.roll + gauss_markov_noise(t, sigmas.tilt, ATTITUDE_PERIOD_S, rng)
    pitch = state.pitch + gauss_markov_noise(t, sigmas.tilt, ATTITUDE_PERIOD_S, rng)
    heading = state.heading + gauss_markov_noise(t, sigmas.heading, ATTITUDE_PERIOD_S, rng)
    vel_n = state.vel_n + offsets[1]
    vel_n = vel_n + np.stack([gauss_markov_noise(t, sigmas.velocity, VELOCITY_PERIOD_S, rng) for _ in range(3)], axis=1)
    north, east = (gauss_markov_noise(t, sigmas.position, POSITION_PERIOD_S, rng) + offsets[0][:, i] for i in range(2))
    alt = (
        state.alt
        - offsets[0][:, 2]
        + gauss_markov_noise(t, sigmas.height, POSITION_PERIOD_S, rng)
        + white_noise(t, 0.02, rng)
    )
    lat, lon = state.lat + north / SEMI_MAJOR, state.lon + east / SEMI_MAJOR / np.cos(state.lat)
    solution = InertialSolution(lat, lon, alt, vel_n, np.stack([roll, pitch, heading % (2 * np.pi)], axis=1))
    row = [*[sigmas.position] * 2, sigmas.height, *[sigmas.velocity] * 3, *[sigmas.tilt] * 2, sigmas.heading]
    return InsOutput(solution, np.tile(row, (len(t), 1)), np.zeros(len(t), dtype=bool))


@dataclass(frozen=True, eq=False)
class InertialUnitSamples:
    """The inertial unit of a system at its own samples; the system uses every ``every``-th of them.

    force_b, rate_b : measured;  true_force_b, true_rate_b : true values, shape (m, 3);  baro : height [m], (m,)
    """

    imu: Imu
    every: int
    step: float
    force_b: Array
    rate_b: Array
    true_force_b: Array
    true_rate_b: Array
    baro: Array


def free_mask(t: Array, settings: InertialSettings, faults: GnssFaults) -> Mask:
    """Mask of the times without aiding, at t, shape (n,) [s]."""
    jamming_mask = faults.jamming_mask(t, REACQUIRE_S)
    return jamming_mask | (t >= settings.free_from_s) if settings.mode == "free" else jamming_mask


def add_free_intervals(
    output: InsOutput, is_free: Mask, unit: InertialUnitSamples, sigmas: DriftSigmas, rng: np.random.Generator
) -> InsOutput:
    """Replace the solution by free inertial navigation where ``is_free``, each time from the last aided solution."""
    parts = output.solution.lat, output.solution.lon, output.solution.alt, output.solution.vel_n, output.solution.rpy
    columns, deviations, applied = [part.copy() for part in parts], output.deviations.copy(), np.zeros_like(is_free)
    for begin, end in _runs(is_free):
        if (end - begin) * unit.every < MIN_SAMPLES:
            continue
        free = _free(
            output.solution.at(begin), slice(begin * unit.every, (end - 1) * unit.every + 1), unit, sigmas, rng
        )
        now = slice(begin, end)
        for column, values in zip(columns, (free.lat, free.lon, free.alt, free.vel_n, free.rpy), strict=True):
            column[now] = values[:: unit.every]
        deviations[now] = _drift_deviations(
            np.linspace(0.0, unit.step * unit.every * (end - begin - 1), end - begin), sigmas
        )
        applied[now] = True
    return InsOutput(InertialSolution(*columns), deviations, applied)


def _runs(mask: Mask) -> Iterator[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(int)))
    return zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _free(
    start: InertialSolution, here: slice, unit: InertialUnitSamples, sigmas: DriftSigmas, rng: np.random.Generator
) -> InertialSolution:
    """Free inertial navigation from one sample on, with the residual constant errors of the unit."""
    residual_f, residual_w = rng.normal(0.0, sigmas.accel, 3), rng.normal(0.0, sigmas.gyro, 3)
    force = unit.force_b[here] - unit.imu.accel.constant_error(unit.true_force_b[here][0]) + residual_f
    rate = unit.rate_b[here] - unit.imu.gyro.constant_error(unit.true_rate_b[here][0]) + residual_w
    down = mat_from_rpy(*start.rpy[0])[2]
    baro = unit.baro[here] - unit.baro[here][0] + start.alt[0]
    return run_free(start, force, rate, step=unit.step, baro=baro, known=float(down @ residual_f))


def _drift_deviations(since: Array, sigmas: DriftSigmas) -> Array:
    """Deviations as in ``InsOutput``, ``since`` the last fix, shape (n,) [s].

    The height contains the drift of the barometric height, and the response of the vertical loop to an error of the
    vertical velocity and to a change of the bias: flicker noise drifts by about twice its floor in minutes.
    """
    position, velocity = drift_sd(since, sigmas)
    baro = BARO_SD * np.sqrt(2.0 * (1.0 - np.exp(-since / BARO_PERIOD_S)))
    fading = since * np.exp(-since / TAU_S)
    rise, fall = sigmas.velocity * (1.0 - 0.5 * since / TAU_S) * fading, sigmas.in_run * since * fading
    height = np.linalg.norm((np.full_like(since, sigmas.height), baro, rise, fall), axis=0)
    tilt, heading = (np.hypot(sd, sigmas.gyro * since) for sd in (sigmas.tilt, sigmas.heading))
    down = np.full_like(since, sigmas.velocity)
    return np.stack([position, position, height, velocity, velocity, down, tilt, tilt, heading], axis=1)
