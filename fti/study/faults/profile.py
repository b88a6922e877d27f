"""A quantity over time that moves smoothly between values: continuous to its second derivative."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array


class SmoothProfile:
    """Values at ascending times [s], joined by quintic steps S(x) = x^3 (10 - 15 x + 6 x^2); constant outside."""

    def __init__(self, times: list[float], values: list[float]) -> None:
        self._times, self._values = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
        self._spans, self._steps = np.diff(self._times), np.diff(self._values)
        areas = self._spans * (self._values[:-1] + 0.5 * self._steps)
        self._areas = np.concatenate(([0.0], np.cumsum(areas)))

    def _locate(self, t: Array) -> tuple[NDArray[np.intp], Array]:
        """Index of the span of each time, and the elapsed share of it."""
        k = np.clip(np.searchsorted(self._times, t, side="right") - 1, 0, len(self._spans) - 1)
        return k, np.clip((t - self._times[k]) / self._spans[k], 0.0, 1.0)

    def value(self, t: Array) -> Array:
        """At times (n,) [s]."""
        k, x = self._locate(t)
        return np.asarray(self._values[k] + self._steps[k] * x**3 * (10.0 + x * (6.0 * x - 15.0)))

    def slope(self, t: Array) -> Array:
        """Derivative by time."""
        k, x = self._locate(t)
        return np.asarray(self._steps[k] / self._spans[k] * 30.0 * (x * (1.0 - x)) ** 2)

    def integral(self, t: Array) -> Array:
        """Integral from the first time on; earlier times are not allowed."""
        k, x = self._locate(t)
        inside = self._values[k] * x + self._steps[k] * x**4 * (2.5 + x * (x - 3.0))
        beyond = np.maximum(t - self._times[-1], 0.0) * self._values[-1]
        return np.asarray(self._areas[k] + self._spans[k] * inside + beyond)
