"""Recorded flights as splines, and free inertial navigation on ideal samples of flights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.geodesy.quaternions import mat_from_quat
from fti.geodesy.rotations import mat_en
from fti.hil.flight.random_routes import random_flight, s_turn_flight
from fti.hil.flight.smoothing import FlightFit, angle_between, fit
from fti.hil.flight.trajectory import FlightSamples, SplineFlight
from fti.hil.sensors.free_inertial import true_motion
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.nav.inertial.strapdown import Motion, integrate

#: Of samples: start, accel_b, gyro_b, step [s], of how many one is returned.
Integrator = Callable[[Motion, Array, Array, float, int], Motion]
HOUR_S = 3600.0
FIT_S, RECORD_S, SMOOTH_S = 600.0, 0.1, 2.0
TURNS_S, STEPS_S = 600.0, (0.16, 0.08, 0.04, 0.02)
STEP_S = 0.01


@dataclass(frozen=True, eq=False)
class Closure:
    """Free inertial navigation minus the flight, at t, shape (m,) [s].

    pos_n : north, east, down [m], shape (m, 3); vel_n : likewise [m/s]; angle : of the attitudes [rad], shape (m,)
    """

    t: Array
    pos_n: Array
    vel_n: Array
    angle: Array

    @property
    def horizontal(self) -> float:
        """Maximum horizontal error [m]."""
        return float(np.hypot(self.pos_n[:, 0], self.pos_n[:, 1]).max())

    @property
    def vertical(self) -> float:
        """Maximum height error [m]."""
        return float(np.abs(self.pos_n[:, 2]).max())

    @property
    def velocity(self) -> float:
        """Maximum velocity error [m/s]."""
        return float(np.linalg.norm(self.vel_n, axis=1).max())


def fly(seed: int, run: int) -> tuple[FlightFit, Closure, Array]:
    """A fit, an hour without aid, and the errors after S-turns."""
    return fit_flight(seed, run), close_hour(seed, run), s_turn_errors(seed, run)


def fit_flight(seed: int, run: int) -> FlightFit:
    """A recorded flight, filtered and splined."""
    return fit(sample_recording(random_flight(np.random.default_rng([seed, run, 1]), FIT_S), RECORD_S), SMOOTH_S)


def close_hour(seed: int, run: int) -> Closure:
    """An hour of free inertial navigation."""
    return close(random_flight(np.random.default_rng([seed, run, 2]), HOUR_S), STEP_S, HOUR_S)


def s_turn_errors(seed: int, run: int, by: Integrator = integrate) -> Array:
    """Greatest horizontal error after S-turns [m], by step."""
    flight = s_turn_flight(np.random.default_rng([seed, run, 3]))
    return np.array([close(flight, step, TURNS_S, by).horizontal for step in STEPS_S])


def close(flight: SplineFlight, step: float, duration: float, by: Integrator = integrate) -> Closure:
    """Integrate ideal inertial samples of a flight, ``step`` [s] apart, and compare about once a second."""
    t = step * np.arange(round(duration / step) + 1, dtype=np.float64)
    every = max(1, round(1.0 / step))
    state = flight.state(t)
    true = true_motion(flight.state(t[::every]))
    start = Motion(true.pos_e[0], true.vel_e[0], true.quat_eb[0])
    found = by(start, specific_force_b(state), angular_rate_b(state), step, every)
    mat_ne = np.swapaxes(mat_en(state.lat[::every], state.lon[::every]), 1, 2)
    return Closure(
        t[::every],
        np.einsum("nij,nj->ni", mat_ne, found.pos_e - true.pos_e),
        np.einsum("nij,nj->ni", mat_ne, found.vel_e - true.vel_e),
        angle_between(mat_from_quat(true.quat_eb), mat_from_quat(_unit(found.quat_eb))),
    )


def _unit(quats: Array) -> Array:
    return np.asarray(quats / np.linalg.norm(quats, axis=1, keepdims=True))


def sample_recording(flight: SplineFlight, step: float) -> FlightSamples:
    """The flight as a recorder stores it: radians in single precision."""
    t = np.arange(0.0, flight.end, step)
    state = flight.state(t)
    names = ("lat", "lon", "roll", "pitch", "heading")
    angles = {name: getattr(state, name).astype(np.float32).astype(np.float64) for name in names}
    return FlightSamples(t=t, alt=state.alt, **angles)
