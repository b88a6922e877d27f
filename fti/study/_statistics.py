"""Criteria for random results.  The unit of each is a run, a flight or a terrain, never a sample."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

RESAMPLINGS = 4000
#: One-sided level of all sign tests of a study together; m of them have an m-th of it each.
LEVEL = 0.01


def sign_test(positive: int, n: int) -> float:
    """p that ``positive`` of n differences, or more, are positive when either sign is as likely: one-sided."""
    return sum(math.comb(n, k) for k in range(positive, n + 1)) / 2.0**n


def min_positive(n: int, level: float) -> int:
    """How many of n must be positive for p < level; all of them where n is too small for that."""
    return next((k for k in range(n) if sign_test(k, n) < level), n)


def pooled_ratio(above: ArrayLike, below: ArrayLike) -> float:
    """Root of the ratio of two sums of mean squares, one of each unit."""
    return float(np.sqrt(np.sum(above) / np.sum(below)))


def ratio_interval(above: ArrayLike, below: ArrayLike, rng: np.random.Generator) -> tuple[float, float]:
    """95 % interval of ``pooled_ratio`` by drawing units again (bootstrap, percentiles)."""
    low, high = np.percentile(_resample(above, below, rng), [2.5, 97.5])
    return float(low), float(high)


def ratio_bound(above: ArrayLike, below: ArrayLike, rng: np.random.Generator) -> float:
    """One-sided upper 95 % bound of ``pooled_ratio``, by the same bootstrap."""
    return float(np.percentile(_resample(above, below, rng), 95.0))


def _resample(above: ArrayLike, below: ArrayLike, rng: np.random.Generator) -> Array:
    upper, lower = np.asarray(above, dtype=np.float64), np.asarray(below, dtype=np.float64)
    drawn = rng.integers(0, len(upper), (RESAMPLINGS, len(upper)))
    return np.asarray(np.sqrt(upper[drawn].sum(axis=1) / lower[drawn].sum(axis=1)))


def mean_interval(values: ArrayLike, rng: np.random.Generator) -> tuple[float, float]:
    """95 % interval of the mean of values, one of each unit, by drawing units again (bootstrap, percentiles)."""
    each = np.asarray(values, dtype=np.float64)
    means = each[rng.integers(0, len(each), (RESAMPLINGS, len(each)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)
