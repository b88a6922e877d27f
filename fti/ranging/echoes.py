"""Echoes of a laser pulse: the rays of its footprint, and their returns as resolved by a receiver."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array, Codes
from fti.ranging.frames import mat_sm
from fti.terrain.ray_outcome import RayOutcome

#: Rings of rays in a footprint that has a width: 1 + 6 + 12 rays.
RINGS = 2


class PulseEchoes(NamedTuple):
    """Echoes of n pulses, up to m each, (n, m): range [m], P_rx / P_tx, spread [m]; NaN is none."""

    ranges: Array
    power: Array
    spread: Array

    @classmethod
    def sharp(cls, ranges: Array, power: Array) -> PulseEchoes:
        """Echoes of single rays."""
        return cls(ranges, power, np.where(np.isnan(power), np.nan, 0.0))

    def extend_with(self, others: PulseEchoes) -> PulseEchoes:
        """These echoes and others of the same pulses."""
        return PulseEchoes(*(np.concatenate(pair, axis=1) for pair in zip(self, others, strict=True)))

    def select(self, received: NDArray[np.bool_], which: str) -> PulseEchoes:
        """The first or the last received echo, mask (n, m): (n, 1); with "both" (n, 2)."""
        only = PulseEchoes(*(np.where(received, values, np.nan) for values in self))
        if which != "both" and self.ranges.shape[1] == 1:
            return only
        first = np.where(received, self.ranges, np.inf).argmin(axis=1)
        last = np.where(received, self.ranges, -np.inf).argmax(axis=1)
        columns = np.stack({"first": [first], "last": [last], "both": [first, last]}[which], axis=1)
        return PulseEchoes(*(np.take_along_axis(values, columns, axis=1) for values in only))


def footprint_rays(divergence: float) -> Array:
    """Small angles (19, 2) [rad] across the beam of rays with equal solid angles, over a beam of that full width.

    Each ring lies at the root mean square radius of its share, so that the mean square of the radius is that of a
    uniform disc, 1/8 of the squared width, within 0.3 %.
    """
    counts = np.array([1 + 3 * ring * (ring + 1) for ring in range(RINGS + 1)])
    rings = [np.zeros((1, 2))]
    for ring in range(1, RINGS + 1):
        radius = 0.5 * divergence * np.sqrt((counts[ring - 1] + counts[ring]) / (2.0 * counts[-1]))
        angle = 2.0 * np.pi * np.arange(6 * ring) / (6 * ring)
        rings.append(radius * np.stack((np.cos(angle), np.sin(angle)), axis=-1))
    return np.concatenate(rings)


def beams(directions: Array, divergence: float) -> Array:
    """Unit vectors (n, m, 3) of the rays of beams around unit vectors (n, 3); without divergence these themselves."""
    if divergence == 0.0:
        return directions[:, None, :]
    across = footprint_rays(divergence)
    rays_m = np.concatenate((across, np.ones((len(across), 1))), axis=1)
    rays_m /= np.linalg.norm(rays_m, axis=1, keepdims=True)
    return np.asarray(rays_m @ np.swapaxes(mat_sm(directions), -1, -2))


def pulse_outcome(codes: Codes) -> Codes:
    """Outcome of pulses (n,) from their rays (n, m): an unknown one if any, else a hit if there is one."""
    worst, best = codes.max(axis=1), codes.min(axis=1)
    return np.asarray(np.where(worst > RayOutcome.NOTHING, worst, best), dtype=np.uint8)


def merge_echoes(ranges: Array, power: Array, resolution: float) -> PulseEchoes:
    """Rays of a footprint (n, m) as echoes (n, m): neighbours in range that are not resolved [m] are one echo.

    An echo's range is the mean of its rays, weighted by power; its spread their standard deviation about it.
    """
    order = np.argsort(ranges, axis=1)
    near = np.take_along_axis(ranges, order, axis=1)
    weight = np.nan_to_num(np.take_along_axis(power, order, axis=1))
    n, m = near.shape
    number = np.cumsum(np.diff(near, axis=1, prepend=near[:, :1]) > resolution, axis=1, dtype=np.intp)
    cell = (number + m * np.arange(n)[:, None]).ravel()

    def total(values: Array) -> Array:
        return np.asarray(np.bincount(cell, np.nan_to_num(values).ravel(), n * m).reshape(n, m), dtype=np.float64)

    together = total(weight)
    with np.errstate(invalid="ignore"):
        mean = total(weight * near) / together
        off = near - np.take_along_axis(mean, number, axis=1)
        return PulseEchoes(mean, together, np.sqrt(total(weight * off**2) / together))
