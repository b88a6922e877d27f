"""Criteria for random results.  The unit of each is a run, a flight or a terrain, never a sample."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array, Rng

RESAMPLINGS = 4000
#: One-sided level of all sign tests of a study together; each of m tests has the m-th part of it.
LEVEL = 0.01


def sign_test(positive: int, n: int) -> float:
    """One-sided p of ``positive`` or more positive values among n differences when both signs are equally likely."""
    return sum(math.comb(n, k) for k in range(positive, n + 1)) / 2.0**n


def min_positive(n: int, level: float) -> int:
    """Number of positive values among n for p < level; n where n is too small for that."""
    return next((k for k in range(n) if sign_test(k, n) < level), n)


def rms(values: ArrayLike) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def pooled_ratio(above: ArrayLike, below: ArrayLike) -> float:
    """Root of the ratio of two sums of mean squares, one value for each unit."""
    return float(np.sqrt(np.sum(above) / np.sum(below)))


def ratio_interval(above: ArrayLike, below: ArrayLike, rng: Rng, level: float = 0.95) -> tuple[float, float]:
    """Interval of ``pooled_ratio`` by resampling units (bootstrap, percentiles).  level : its probability"""
    low, high = np.percentile(_resample(above, below, rng), [50.0 * (1.0 - level), 50.0 * (1.0 + level)])
    return float(low), float(high)


def ratio_bound(above: ArrayLike, below: ArrayLike, rng: Rng) -> float:
    """One-sided upper 95 % bound of ``pooled_ratio``, by the same bootstrap."""
    return float(np.percentile(_resample(above, below, rng), 95.0))


def _resample(above: ArrayLike, below: ArrayLike, rng: Rng) -> Array:
    upper, lower = np.asarray(above, dtype=np.float64), np.asarray(below, dtype=np.float64)
    drawn = rng.integers(0, len(upper), (RESAMPLINGS, len(upper)))
    return np.asarray(np.sqrt(upper[drawn].sum(axis=1) / lower[drawn].sum(axis=1)))


def mean_interval(values: ArrayLike, rng: Rng, resamplings: int = RESAMPLINGS) -> tuple[float, float]:
    """95 % interval of the mean of values, one of each unit, by resampling units (bootstrap, percentiles)."""
    each = np.asarray(values, dtype=np.float64)
    means = each[rng.integers(0, len(each), (resamplings, len(each)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)
