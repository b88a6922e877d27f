"""Uniform quintic spline: four continuous derivatives, so that attitude and angular rate of a flight are smooth.

The spline is a sum of uniform quintic B-splines.  At a knot the values and derivatives are combinations of five
coefficients (value 1 26 66 26 1 / 120, third derivative -1 2 0 -2 1 / 2, fourth 1 -4 6 -4 1); the coefficients follow
from the points and from zero third and fourth derivatives at both ends.

Source: de Boor, A Practical Guide to Splines, 1978, ch. IX (uniform knots).  Checked against: polynomials and finite
differences, tests/hil/flight/test_spline.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

DEGREE = 5
VALUE = np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120.0
THIRD = np.array([-1.0, 2.0, 0.0, -2.0, 1.0]) / 2.0
FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])

#: Row j: the polynomial of the j-th B-spline on an interval, coefficients of u^0..u^5 times 120.
BASIS = (
    np.array(
        [
            [1.0, -5.0, 10.0, -10.0, 5.0, -1.0],
            [26.0, -50.0, 20.0, 20.0, -20.0, 5.0],
            [66.0, 0.0, -60.0, 0.0, 30.0, -10.0],
            [26.0, 50.0, 20.0, -20.0, -20.0, 10.0],
            [1.0, 5.0, 10.0, 10.0, 5.0, -5.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ]
    )
    / 120.0
)


class QuinticSpline:
    """Spline through points at equal steps.

    start, step : time of the first point and between points [s]
    points      : ndarray, shape (n, d), n >= 6
    """

    def __init__(self, start: float, step: float, points: ArrayLike) -> None:
        values = np.asarray(points, dtype=float)
        if values.ndim != 2 or len(values) <= DEGREE:
            raise ValueError(f"a quintic spline needs at least 6 points of shape (n, d), not {values.shape}")
        self.start, self.step = start, step
        coefficients = _coefficients(values)
        n = len(values) - 1
        windows = np.stack([coefficients[j : j + n] for j in range(DEGREE + 1)], axis=1)  # (n, 6, d)
        self._polynomials = np.einsum("jp,njd->npd", BASIS, windows)

    @property
    def end(self) -> float:
        """Time of the last point [s]."""
        return self.start + self.step * len(self._polynomials)

    def __call__(self, t: ArrayLike, derivative: int = 0) -> Array:
        """Value or derivative at t, shape (m,) [s]: shape (m, d).  ValueError outside the points."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        if times.size and (times.min() < self.start - 1e-9 or times.max() > self.end + 1e-9):
            raise ValueError(f"time {times.min():.3f}..{times.max():.3f} s is outside {self.start}..{self.end} s")
        x = (times - self.start) / self.step
        i = np.clip(x.astype(int), 0, len(self._polynomials) - 1)
        u = (x - i)[:, None]
        found = np.zeros((len(times), self._polynomials.shape[2]))
        for power in range(DEGREE, derivative - 1, -1):
            factor = float(np.prod(np.arange(power - derivative + 1, power + 1)))
            found = found * u + factor * self._polynomials[i, power]
        return np.asarray(found / self.step**derivative)


def _coefficients(values: Array) -> Array:
    n = len(values)
    matrix = np.zeros((n + 4, n + 4))
    for k in range(n):
        matrix[k + 2, k : k + 5] = VALUE
    matrix[0, :5], matrix[1, :5] = THIRD, FOURTH
    matrix[-2, -5:], matrix[-1, -5:] = THIRD, FOURTH
    right = np.zeros((n + 4, values.shape[1]))
    right[2:-2] = values
    return np.asarray(np.linalg.solve(matrix, right))
