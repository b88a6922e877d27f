"""The flight: a quintic spline down a published approach, with attitude derived from it.

Knots are laid along the glide path once a second: path length from a speed with gusts, offset from wander and
manoeuvre, height from the glide path and wander.  Position is the spline in the local frame of the glide path intercept
point; velocity and acceleration are its derivatives.  The aeroplane flies coordinated: it banks against the side
acceleration, points into the wind (crab), and pitches to the air-relative path plus the angle of attack it needs.

Below ``LEVEL_HEIGHT`` the path bends into level flight over the runway, so that a flight may be longer than its
approach.  Source: Spiegel 2018, 7.1 (spline trajectory, derived attitude).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.geodesy.local import LocalFrame
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.hil.flight.spline import QuinticSpline

Array = NDArray[np.float64]

KNOT_S = 1.0
MARGIN_KNOTS = 8  # beyond both ends, where the spline's end conditions have died away
GRAVITY = 9.80665
#: Level flight over the runway [m above the intercept point], and how softly the glide path bends into it [m].
LEVEL_HEIGHT = 10.0
LEVEL_SOFTNESS = 2.0
#: Angle of attack at the reference speed in straight flight [rad].
TRIM_AOA = np.deg2rad(4.0)
RATE_STEP_S = 0.005
WANDER_PERIODS_S = (11.0, 17.0, 26.0, 41.0)


class Path(Protocol):
    """What the flight needs to know of the published approach."""

    def geodetic(self, s: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """lat, lon [rad] at path length s before the intercept point and offset y right of the track [m]."""

    def alt_path(self, s: ArrayLike) -> Array:
        """Height of the glide path above the ellipsoid [m]."""


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """A side step: out by ``offset`` [m, right positive] at ``out_s``, and back from ``back_s`` on [s]."""

    offset: float
    out_s: float
    back_s: float
    turn_s: float = 20.0

    def at(self, t: Array) -> Array:
        """Offset at t [m]."""
        out = _minimum_jerk((t - self.out_s) / self.turn_s + 1.0)
        back = _minimum_jerk((t - self.back_s) / self.turn_s)
        return np.asarray(self.offset * (out - back))


@dataclass(frozen=True, slots=True)
class Plan:
    """How the approach is flown.

    start        : distance before the threshold at t = 0 [m];  duration [s];  speed over ground [m/s]
    wander, wander_height, gust : standard deviations of offset, height [m] and speed [m/s] about the plan
    wind_n       : wind velocity, north and east [m/s] (where it blows to)
    """

    start: float = 4500.0
    duration: float = 82.0
    speed: float = 60.0
    wander: float = 3.0
    wander_height: float = 1.5
    gust: float = 0.7
    wind_n: tuple[float, float] = (0.0, 0.0)
    manoeuvres: tuple[Manoeuvre, ...] = ()


@dataclass(frozen=True, slots=True)
class State:
    """Truth at times t, shape (n,): position [rad, m], velocity [m/s], attitude [rad].

    ``accel_e`` is the second derivative of the earth-fixed position [m/s^2]; ``omega_nb_b`` the turn rate of the
    body against n in body axes [rad/s]; ``tas`` true airspeed [m/s]; ``aoa`` angle of attack [rad].
    """

    t: Array
    lat: Array
    lon: Array
    alt: Array
    vel_n: Array
    accel_e: Array
    roll: Array
    pitch: Array
    heading: Array
    omega_nb_b: Array
    tas: Array
    aoa: Array


@dataclass(frozen=True, slots=True)
class _Motion:
    """Attitude and air flow before they are differentiated."""

    roll: Array
    pitch: Array
    heading: Array
    tas: Array
    aoa: Array

    def mat_nb(self) -> Array:
        return mat_from_rpy(self.roll, self.pitch, self.heading)


class Trajectory:
    """One flight.  path : the approach; threshold_s : path length of the threshold [m]; seed : of wander and gusts."""

    def __init__(self, path: Path, threshold_s: float, plan: Plan, seed: int) -> None:
        self.plan = plan
        self._path = path
        rng = np.random.default_rng([seed, 7])
        t = np.arange(-MARGIN_KNOTS, np.ceil(plan.duration / KNOT_S) + MARGIN_KNOTS + 1) * KNOT_S
        s = threshold_s + plan.start - plan.speed * t - _gust_distance(t, plan.gust, rng)
        y = _wander(t, plan.wander, rng) + sum((m.at(t) for m in plan.manoeuvres), np.zeros_like(t))
        lat, lon = path.geodetic(s, y)
        alt = _levelled(path, s) + _wander(t, plan.wander_height, rng)
        self._frame = LocalFrame(float(lat[-1]), float(lon[-1]), float(alt[-1]))
        self._spline = QuinticSpline(float(t[0]), KNOT_S, self._frame.to_local(lat, lon, alt))

    def state(self, t: ArrayLike) -> State:
        """Truth at t, shape (n,) [s], within the flight."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        lat, lon, alt = self._frame.to_geodetic(self._spline(times))
        now = self._motion(times)
        return State(
            t=times,
            lat=lat,
            lon=lon,
            alt=alt,
            vel_n=self._in_n(self._spline(times, 1), lat, lon),
            accel_e=np.asarray(self._spline(times, 2) @ self._frame.mat_le),
            roll=now.roll,
            pitch=now.pitch,
            heading=now.heading,
            omega_nb_b=self._turn_rate(times, now),
            tas=now.tas,
            aoa=now.aoa,
        )

    def _in_n(self, vector_l: Array, lat: Array, lon: Array) -> Array:
        mat_nl = np.swapaxes(self._frame.mat_ln(lat, lon), -1, -2)
        return np.asarray(np.einsum("nij,nj->ni", mat_nl, vector_l))

    def _motion(self, times: Array) -> _Motion:
        lat, lon, _ = self._frame.to_geodetic(self._spline(times))
        vel_n = self._in_n(self._spline(times, 1), lat, lon)
        accel_n = self._in_n(self._spline(times, 2), lat, lon)
        air_n = vel_n - np.array([*self.plan.wind_n, 0.0])
        heading = np.arctan2(air_n[:, 1], air_n[:, 0])
        side = -accel_n[:, 0] * np.sin(heading) + accel_n[:, 1] * np.cos(heading)
        lift = GRAVITY - accel_n[:, 2]
        roll = np.arctan2(side, lift)
        tas = np.linalg.norm(air_n, axis=1)
        aoa = TRIM_AOA * np.hypot(side, lift) / GRAVITY * (self.plan.speed / tas) ** 2
        gamma = np.arctan2(-air_n[:, 2], np.hypot(air_n[:, 0], air_n[:, 1]))
        return _Motion(roll, gamma + aoa * np.cos(roll), heading % (2 * np.pi), tas, aoa)

    def _turn_rate(self, times: Array, now: _Motion) -> Array:
        """omega_nb in body axes, from the attitude a little before and after."""
        before, after = self._motion(times - RATE_STEP_S).mat_nb(), self._motion(times + RATE_STEP_S).mat_nb()
        skew = np.einsum("nji,njk->nik", now.mat_nb(), after - before) / (2.0 * RATE_STEP_S)
        return np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)


def earth_frame_velocity(state: State) -> Array:
    """Velocity against the Earth in e axes [m/s], shape (n, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", mat_en(state.lat, state.lon), state.vel_n))


def _minimum_jerk(u: Array) -> Array:
    """From 0 to 1 while u goes from 0 to 1, with speed and acceleration zero at both ends."""
    x = np.clip(u, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 + x * (6.0 * x - 15.0)))


def _levelled(path: Path, s: Array) -> Array:
    """The glide path, bent softly into level flight over the runway [m]."""
    alt_g = path.alt_path(0.0)
    height = path.alt_path(s) - alt_g
    over = LEVEL_SOFTNESS * np.logaddexp(0.0, (height - LEVEL_HEIGHT) / LEVEL_SOFTNESS)
    return np.asarray(alt_g + LEVEL_HEIGHT + over)


def _tones(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Angular frequencies, phases and amplitudes of a wander of unit variance; slow parts are the larger ones."""
    periods = np.array(WANDER_PERIODS_S) * rng.uniform(0.9, 1.1, len(WANDER_PERIODS_S))
    weight = periods * np.sqrt(2.0) / np.linalg.norm(periods)
    return 2.0 * np.pi / periods, rng.uniform(0.0, 2.0 * np.pi, len(periods)), weight


def _wander(t: Array, sd: float, rng: np.random.Generator) -> Array:
    """A smooth disturbance with standard deviation sd."""
    omega, phase, weight = _tones(rng)
    return np.asarray(sd * np.sin(np.outer(t, omega) + phase) @ weight)


def _gust_distance(t: Array, sd: float, rng: np.random.Generator) -> Array:
    """Path flown more than planned because of speed variations with standard deviation sd [m]; 0 at t = 0."""
    omega, phase, weight = _tones(rng)
    swing = (np.cos(phase) - np.cos(np.outer(t, omega) + phase)) / omega
    return np.asarray(sd * swing @ weight)
