"""Extreme quantiles of a sample: empirical with enough exceedances, else by a generalised-Pareto tail.

    beyond u :  P(X > x | X > u) = (1 - k (x - u) / a)^(1/k)        k shape (> 0: bounded), a scale
    a_0 = mean y,  a_1 = mean of (1 - p_i) y_i ascending,  p_i = (i - 0.35) / m        y = x - u of the m exceedances
    k = a_0 / (a_0 - 2 a_1) - 2         a = 2 a_0 a_1 / (a_0 - 2 a_1)

u is exceeded by the largest tenth of the sample, at least 20 values.  The estimate is at least the largest value if the
expected number of exceedances of the quantile is less than one.
Sources: Hosking and Wallis 1987, Technometrics 29 (probability-weighted moments); Pickands 1975 (the tail).
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array

#: Minimum number of exceedances for the empirical quantile.
MIN_EXCEEDANCES = 10
TAIL_SHARE, MIN_TAIL = 0.1, 20
BOOTSTRAPS = 500


def upper_quantile(sample: Array, beyond: float) -> float:
    """The value that is exceeded with the probability ``beyond``, 0 < beyond < 1.  sample : shape (n,), n >= 5."""
    ordered = np.sort(sample)
    n = len(ordered)
    if n * beyond >= MIN_EXCEEDANCES:
        return float(np.quantile(ordered, 1.0 - beyond))
    m = min(n - 1, max(MIN_TAIL, round(TAIL_SHARE * n)))
    threshold = float(ordered[n - m - 1])
    shape, scale = pareto_tail(ordered[n - m :] - threshold)
    share = min(beyond * n / m, 1.0)
    above = scale * (1.0 - share**shape) / shape if abs(shape) > 1e-6 else -scale * np.log(share)
    value = threshold + float(above)
    return max(value, float(ordered[-1])) if n * beyond < 1.0 else value


def pareto_tail(excess: Array) -> tuple[float, float]:
    """Shape k and scale a of a generalised-Pareto distribution, from ascending exceedances, shape (m,)."""
    m = len(excess)
    mean = float(excess.mean())
    weighted = float(np.mean((1.0 - (np.arange(1, m + 1) - 0.35) / m) * excess))
    if mean <= 0.0:
        return 1.0, 0.0  # all values are equal: no tail
    difference = mean - 2.0 * weighted
    return mean / difference - 2.0, 2.0 * mean * weighted / difference


def bootstrap_interval(sample: Array, beyond: float, rng: np.random.Generator) -> tuple[float, float]:
    """95 % bootstrap interval of ``upper_quantile``."""
    values = [upper_quantile(rng.choice(sample, len(sample)), beyond) for _ in range(BOOTSTRAPS)]
    low, high = np.quantile(values, (0.025, 0.975))
    return float(low), float(high)
