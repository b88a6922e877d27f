"""A laser rangefinder: first return of seven rays in its footprint, along an axis that is off a little."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.second_receiver.ground import Surface

Array = NDArray[np.float64]

STEP_M = 2.0
FARTHEST_M = 900.0
BISECTIONS = 12


@dataclass(frozen=True, slots=True)
class Laser:
    """divergence : full [rad];  noise : one sigma [m];  passes : share of pulses that pass between crowns to the earth

    depth : mean way into a crown before enough of it returns [m];  step : of the output [m]
    """

    divergence: float = 2e-3
    noise: float = 0.1
    passes: float = 0.1
    depth: float = 0.4
    step: float = 0.01

    def sd(self, height: Array) -> Array:
        """One sigma that such an instrument states [m]."""
        return np.full(np.shape(height), self.noise)

    def measure(self, surface: Surface, place: Array, axes: Array, velocity: Array, rng: np.random.Generator) -> Array:
        """Ranges [m] (n,), NaN without a return; arguments as of the radar, ``axes`` with the error of alignment."""
        azimuth = np.arange(6) * np.pi / 3.0
        x = np.append(0.0, 0.5 * self.divergence * np.cos(azimuth))
        y = np.append(0.0, 0.5 * self.divergence * np.sin(azimuth))
        rays = np.einsum("nij,kj->nki", axes, np.stack((x, y, np.sqrt(1.0 - x**2 - y**2)), -1))
        to_top, to_earth = (_distances(of, place, rays) for of in (surface.height, surface.bare_height))
        top, earth = to_top.min(axis=1), to_earth.min(axis=1)
        on_crown = earth - top > 1.0
        inside = top + np.minimum(rng.exponential(self.depth, len(top)), earth - top)
        found = np.where(on_crown, np.where(rng.random(len(top)) < self.passes, earth, inside), top)
        found = np.rint((found + rng.normal(0.0, self.noise, len(found))) / self.step) * self.step
        return np.where(top < FARTHEST_M, found, np.nan)


def _distances(height: Callable[[Array, Array], Array], place: Array, rays: Array) -> Array:
    """Along rays (n, k, 3) from places (n, 3) to a surface (n, k) [m]: in steps of 2 m, then by bisection."""
    low, high = np.zeros(rays.shape[:2]), np.full(rays.shape[:2], FARTHEST_M)
    missing = np.ones(rays.shape[:2], dtype=bool)

    def above(along: Array, which: NDArray[np.intp]) -> Array:
        at = place[which[0]] + along[:, None] * rays[which[0], which[1]]
        return np.asarray(at[:, 2] - height(at[:, 0], at[:, 1]))

    for along in np.arange(STEP_M, FARTHEST_M, STEP_M):
        which = np.array(np.nonzero(missing))
        if not which.size:
            break
        hit = which[:, above(np.full(which.shape[1], along), which) <= 0.0]
        low[tuple(hit)], high[tuple(hit)], missing[tuple(hit)] = along - STEP_M, along, False
    values = np.array(np.nonzero(~missing))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        over = above(middle[tuple(values)], values) > 0.0
        low[tuple(values)] = np.where(over, middle[tuple(values)], low[tuple(values)])
        high[tuple(values)] = np.where(over, high[tuple(values)], middle[tuple(values)])
    return np.asarray(0.5 * (low + high))
