"""Quintic spline through points at arbitrary times: four continuous derivatives, hence a smooth jerk.

The spline is a sum of B-splines of degree 5.  Its knots are the times of the points except three at either end
(not-a-knot condition), so that polynomials of degree 5 are reproduced exactly.  A derivative is a spline of lower
degree whose coefficients are divided differences; large coordinates do not reduce its precision.

Source: de Boor, A Practical Guide to Splines, 1978, ch. IX, X, XIII.  Checked against: scipy's ``make_interp_spline``,
polynomials, finite differences, tests/hil/flight/test_spline.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.arrays import Array
from fti.hil.flight.banded_solver import solve_banded

DEGREE = 5
#: Tolerance for times outside the points, for rounding errors [s].
ROUNDING_S = 1e-9


class QuinticSpline:
    """Spline through points.

    t       : ndarray, shape (n,) [s], increasing, n >= 6
    points  : ndarray, shape (n, d)
    Raises ValueError for fewer points, or times that do not increase.
    """

    def __init__(self, t: ArrayLike, points: ArrayLike) -> None:
        times, values = np.asarray(t, dtype=np.float64), np.asarray(points, dtype=np.float64)
        if values.ndim != 2 or times.shape != values.shape[:1] or len(values) <= DEGREE:
            raise ValueError(f"a quintic spline needs at least 6 points of shape (n, d), not {values.shape}")
        if not np.all(np.diff(times) > 0.0):
            raise ValueError("the times of a spline must increase")
        self.start, self.end = float(times[0]), float(times[-1])
        ends = np.ones(DEGREE + 1)
        knots = np.concatenate((ends * times[0], times[3:-3], ends * times[-1]))
        self._levels = [(knots, _coefficients(knots, times, values))]  # by derivative

    def __call__(self, t: ArrayLike, derivative: int = 0) -> Array:
        """Value or derivative (up to the fifth) at t, shape (m,) [s]: shape (m, d).  ValueError outside the points."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        if times.size and (times.min() < self.start - ROUNDING_S or times.max() > self.end + ROUNDING_S):
            raise ValueError(
                f"time {times.min():.3f} to {times.max():.3f} s is outside {self.start:.3f} to {self.end:.3f} s"
            )
        knots, coefficients = self._level(derivative)
        degree = DEGREE - derivative
        last, weights = _basis(knots, degree, np.clip(times, self.start, self.end))
        result = np.zeros((len(times), coefficients.shape[1]))
        for j in range(degree + 1):
            result += weights[:, j, None] * coefficients[last - degree + j]
        return result

    def _level(self, derivative: int) -> tuple[Array, Array]:
        """Knots and coefficients of a derivative."""
        while len(self._levels) <= derivative:
            knots, coefficients = self._levels[-1]
            degree = DEGREE + 1 - len(self._levels)
            span = knots[degree + 1 : -1] - knots[1 : -degree - 1]
            self._levels.append((knots[1:-1], degree * np.diff(coefficients, axis=0) / span[:, None]))
        return self._levels[derivative]


def _basis(knots: Array, degree: int, t: Array) -> tuple[NDArray[np.intp], Array]:
    """The last of the degree + 1 B-splines that do not vanish at t, shape (n,), and their values, (n, degree + 1)."""
    last = np.clip(np.searchsorted(knots, t, side="right") - 1, degree, len(knots) - degree - 2)
    weights = np.zeros((len(t), degree + 1))
    weights[:, 0] = 1.0
    for p in range(1, degree + 1):
        carried = np.zeros(len(t))
        for j in range(p):
            left, right = knots[last - p + 1 + j], knots[last + 1 + j]
            share = weights[:, j] / (right - left)
            weights[:, j] = carried + share * (right - t)
            carried = share * (t - left)
        weights[:, p] = carried
    return last, weights


def _coefficients(knots: Array, t: Array, values: Array) -> Array:
    last, weights = _basis(knots, DEGREE, t)
    band = np.zeros((len(t), 2 * DEGREE + 1))
    row = np.arange(len(t))
    for j in range(DEGREE + 1):
        band[row, last - row + j] = weights[:, j]  # column last - DEGREE + j, relative to the diagonal
    return solve_banded(band, values)
