"""Short flights over a surface, and what navigation says of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.second_receiver.geometry import body_to_enu
from tests.second_receiver.ground import Surface

Array = NDArray[np.float64]

HIGHEST_M, LOWEST_M = 400.0, 40.0
GRAVITY = 9.81


@dataclass(frozen=True, slots=True)
class StatedSigmas:
    """One sigma of navigation's errors, as it states them: slow ones, and white ones of a sixth.

    horizontal, vertical : of one axis [m];  attitude : of roll and of pitch [rad];  heading [rad]
    """

    horizontal: float = 1.5
    vertical: float = 2.0
    attitude: float = float(np.deg2rad(0.2))
    heading: float = float(np.deg2rad(0.5))


@dataclass(frozen=True, eq=False)
class Flight:
    """Samples of a flight: truth, and what is navigated of it.  place (n, 3) east, north, up [m]; angles (n,) [rad]."""

    t: Array
    place: Array
    velocity: Array
    roll: Array
    pitch: Array
    heading: Array

    def axes(self) -> Array:
        """Body to east, north, up (n, 3, 3)."""
        return body_to_enu(self.roll, self.pitch, self.heading)

    def some(self, which: NDArray[np.bool_]) -> Flight:
        """Those samples."""
        columns = (self.t, self.place, self.velocity, self.roll, self.pitch, self.heading)
        return Flight(*(column[which] for column in columns))


def wander(t: Array, sd: float, tau: float, rng: np.random.Generator) -> Array:
    """A first-order Gauss-Markov process at equally spaced times (n,), correlated over tau [s]."""
    keep = float(np.exp(-(t[1] - t[0]) / tau))
    steps = rng.normal(0.0, sd, len(t))
    found = np.empty(len(t))
    found[0] = steps[0]
    for k in range(1, len(t)):
        found[k] = keep * found[k - 1] + np.sqrt(1.0 - keep**2) * steps[k]
    return found


def fly(surface: Surface, rng: np.random.Generator, *, period: float = 2.0, n: int = 12) -> Flight:
    """Past the origin, straight or weaving, 40 to 400 m above ground; banks of up to 28, pitch of -7 to 9 degrees.

    Samples below 40 m and above 400 m are left out.
    """
    t = np.asarray((np.arange(n) - 0.5 * (n - 1)) * period, dtype=np.float64)
    speed = rng.uniform(60.0, 80.0)
    bank, turned = np.deg2rad(rng.uniform(0.0, 28.0)), 2.0 * np.pi / rng.uniform(12.0, 30.0)
    roll = bank * np.sin(turned * t + rng.uniform(0.0, 2.0 * np.pi))
    heading = rng.uniform(0.0, 2.0 * np.pi) + np.cumsum(GRAVITY / speed * np.tan(roll)) * period
    pitch = np.deg2rad(rng.uniform(-3.0, 5.0) + rng.uniform(0.0, 4.0) * np.sin(turned * 0.7 * t))
    east, north = (np.cumsum(f(heading)) * speed * period for f in (np.sin, np.cos))
    east, north = east - east[n // 2] + rng.uniform(-300.0, 300.0), north - north[n // 2] + rng.uniform(-300.0, 300.0)
    below = surface.height(east, north)
    climb = rng.uniform(-3.0, 1.0)
    level = np.quantile(below, 0.9) + np.exp(rng.uniform(np.log(50.0), np.log(330.0)))
    place = np.stack((east, north, level + climb * t), -1)
    velocity = np.stack((speed * np.sin(heading), speed * np.cos(heading), np.full(n, climb)), -1)
    clear = place[:, 2] - below
    return Flight(t, place, velocity, roll, pitch, heading).some((clear > LOWEST_M) & (clear < HIGHEST_M))


def navigate(flight: Flight, stated: StatedSigmas, rng: np.random.Generator) -> Flight:
    """The flight as it is navigated: every error of the sigma that is stated, 97 % of its variance slow."""
    t = flight.t
    white = 1.0 / 6.0
    slow = np.sqrt(1.0 - white**2)

    def error(sd: float, tau: float) -> Array:
        return wander(t, slow * sd, tau, rng) + rng.normal(0.0, white * sd, len(t))

    level, high = stated.horizontal, stated.vertical
    place = flight.place + np.stack((error(level, 60.0), error(level, 60.0), error(high, 60.0)), -1)
    roll, pitch = (angle + error(stated.attitude, 30.0) for angle in (flight.roll, flight.pitch))
    velocity = flight.velocity + rng.normal(0.0, 0.1, flight.velocity.shape)
    return Flight(t, place, velocity, roll, pitch, flight.heading + error(stated.heading, 60.0))
