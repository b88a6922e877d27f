"""The flight down a published approach.

The flight has one knot per second along the glide path: path length from a speed with gusts, offset from wander and
manoeuvre, height from the glide path and wander.  The aeroplane flies coordinated: it banks into its turns, points
into the wind (crab), and pitches to the air-relative path plus the required angle of attack.

Below ``LEVEL_HEIGHT`` the path blends into level flight over the runway, so that a flight may be longer than its
approach.  Source: Spiegel 2018, 7.1 (spline trajectory, derived attitude).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.hil.flight.coordinated_flight import coordinated_flight
from fti.hil.flight.trajectory import PositionTrack, SplineFlight

KNOT_S = 1.0
MARGIN_KNOTS = 8  # beyond both ends, so that the end conditions of the spline have no effect
#: Level flight over the runway [m above the intercept point], and height scale of the blend [m].
LEVEL_HEIGHT = 10.0
LEVEL_SOFTNESS = 2.0
WANDER_PERIODS_S = (11.0, 17.0, 26.0, 41.0)


class PublishedPath(Protocol):
    """The geometry of the published approach that the flight needs."""

    def to_geodetic(self, s: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
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
class ApproachPlan:
    """Parameters of an approach flight.

    start        : distance before the threshold at t = 0 [m];  duration [s];  speed over ground [m/s]
    wander, wander_height, gust : standard deviations of offset, height [m] and speed [m/s] about the plan
    wind_n       : velocity of the air, north and east [m/s]
    """

    start: float = 4500.0
    duration: float = 82.0
    speed: float = 60.0
    wander: float = 3.0
    wander_height: float = 1.5
    gust: float = 0.7
    wind_n: tuple[float, float] = (0.0, 0.0)
    manoeuvres: tuple[Manoeuvre, ...] = ()


def approach_flight(path: PublishedPath, threshold_s: float, plan: ApproachPlan, seed: int) -> SplineFlight:
    """The flight along a path.  threshold_s : path length of the threshold [m]; seed : of wander and gusts."""
    rng = np.random.default_rng([seed, 7])
    t = np.arange(-MARGIN_KNOTS, np.ceil(plan.duration / KNOT_S) + MARGIN_KNOTS + 1) * KNOT_S
    s = threshold_s + plan.start - plan.speed * t - _gust_distance(t, plan.gust, rng)
    y = _wander(t, plan.wander, rng) + sum((m.at(t) for m in plan.manoeuvres), np.zeros_like(t))
    alt = _level_off(path, s) + _wander(t, plan.wander_height, rng)
    return coordinated_flight(PositionTrack.from_positions(t, *path.to_geodetic(s, y), alt), plan.wind_n, plan.speed)


def _minimum_jerk(u: Array) -> Array:
    """From 0 to 1 while u goes from 0 to 1, with speed and acceleration zero at both ends."""
    x = np.clip(u, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 + x * (6.0 * x - 15.0)))


def _level_off(path: PublishedPath, s: Array) -> Array:
    """The glide path, blended into level flight over the runway [m]."""
    alt_g = path.alt_path(0.0)
    height = path.alt_path(s) - alt_g
    excess = LEVEL_SOFTNESS * np.logaddexp(0.0, (height - LEVEL_HEIGHT) / LEVEL_SOFTNESS)
    return np.asarray(alt_g + LEVEL_HEIGHT + excess)


def _tones(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Angular frequencies, phases and amplitudes of a wander of unit variance; amplitudes grow with the period."""
    periods = np.array(WANDER_PERIODS_S) * rng.uniform(0.9, 1.1, len(WANDER_PERIODS_S))
    weight = periods * np.sqrt(2.0) / np.linalg.norm(periods)
    return 2.0 * np.pi / periods, rng.uniform(0.0, 2.0 * np.pi, len(periods)), weight


def _wander(t: Array, sd: float, rng: np.random.Generator) -> Array:
    """A smooth disturbance with standard deviation sd."""
    omega, phase, weight = _tones(rng)
    return np.asarray(sd * np.sin(np.outer(t, omega) + phase) @ weight)


def _gust_distance(t: Array, sd: float, rng: np.random.Generator) -> Array:
    """Path length beyond the plan from speed variations with standard deviation sd [m]; 0 at t = 0."""
    omega, phase, weight = _tones(rng)
    swing = (np.cos(phase) - np.cos(np.outer(t, omega) + phase)) / omega
    return np.asarray(sd * swing @ weight)
