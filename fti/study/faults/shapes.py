"""Shapes of faults over time: displacement that grows, values that repeat, sensors that stick or saturate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array, Mask


@dataclass(frozen=True, slots=True)
class FaultWindow:
    """From begin_s to before end_s."""

    begin_s: float
    end_s: float

    def covers(self, t: Array) -> Mask:
        """Which times (n,) [s] lie in it."""
        return np.asarray((t >= self.begin_s) & (t < self.end_s))


def ramp(elapsed: Array, rate: float, onset: float) -> tuple[Array, Array]:
    """Displacement [m] and its derivative [m/s] at times since the beginning [s]; zero before it.

    The derivative grows with the acceleration ``onset`` [m/s^2] up to ``rate`` [m/s]; an infinite onset is sharp.
    """
    duration = np.maximum(elapsed, 0.0)
    if np.isinf(onset):
        return rate * duration, np.where(elapsed >= 0.0, rate, 0.0)
    growth = min(rate / onset, np.inf)
    growing = np.minimum(duration, growth)
    return 0.5 * onset * growing**2 + rate * (duration - growing), onset * growing


def repeated_indices(active: Mask) -> NDArray[np.intp]:
    """Index of the sample that each sample repeats: itself, and while active the last one before."""
    return np.asarray(np.maximum.accumulate(np.where(active, 0, np.arange(len(active)))))


def direction(azimuth: float) -> Array:
    """Unit vector north, east, down (3,) of an azimuth [rad]."""
    return np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
