"""Errors of simulated sensors: slow ones that wander, white ones that do not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KNOT_S = 1.0


def slow(t: Array, sd: float, period_s: float, rng: np.random.Generator) -> Array:
    """A first-order Gauss-Markov process with standard deviation sd and correlation time period_s, shape of t.

    Drawn once a second and joined by straight lines: it is slow.
    """
    knots = np.arange(t[0], t[-1] + 2 * KNOT_S, KNOT_S)
    keep = np.exp(-KNOT_S / period_s)
    kicks = rng.normal(0.0, sd * np.sqrt(1.0 - keep**2), len(knots))
    values = np.empty(len(knots))
    values[0] = rng.normal(0.0, sd)
    for k in range(1, len(knots)):
        values[k] = keep * values[k - 1] + kicks[k]
    return np.asarray(np.interp(t, knots, values))


def white(t: Array, sd: float, rng: np.random.Generator) -> Array:
    """Independent errors with standard deviation sd, shape of t."""
    return rng.normal(0.0, sd, len(t))
