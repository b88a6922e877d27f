"""Solver for banded systems of equations: an hour of samples at 100 Hz has 360 000 unknowns."""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.kernel import kernel


def solve_banded(band: Array, right: Array) -> Array:
    """Solution of A x = right by elimination without exchange of rows.

        band[i, w + j - i] = A[i, j],   |i - j| <= w

    band    : ndarray, shape (n, 2 w + 1); elements outside A are ignored
    right   : ndarray, shape (n, d)
    Returns : ndarray, shape (n, d)
    Valid for matrices that need no exchange of rows: totally positive ones (interpolation with B-splines) and
    symmetric, positive definite ones (smoothing).  Source: de Boor, A Practical Guide to Splines, 1978, ch. XIII.
    Checked against: numpy.linalg.solve, tests/hil/flight/test_banded_solver.py.
    """
    solution = np.array(right, dtype=np.float64)
    _solve(np.array(band, dtype=np.float64), solution)
    return solution


@kernel
def _solve(band: Array, x: Array) -> None:
    n, w = len(band), band.shape[1] // 2
    for i in range(n):
        for k in range(i + 1, min(i + w + 1, n)):
            factor = band[k, w + i - k] / band[i, w]
            for j in range(1, w + 1):
                band[k, w + i - k + j] -= factor * band[i, w + j]
            x[k] -= factor * x[i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, min(i + w + 1, n)):
            x[i] -= band[i, w + j - i] * x[j]
        x[i] /= band[i, w]
