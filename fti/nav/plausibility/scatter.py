"""Test ``scatter``: the variance of fixes about the path of the stated velocity against the stated variance.

Of n values, once a second over a minute, with measured correlation rho from one to the next:

    n_eff = n (1 - rho) / (1 + rho),   variance / expected > chi2_isf(P, n_eff - 1) / (n_eff - 1)  is a finding

Only the upper side is tested: slow errors scatter less in a minute than their sigma.
chi2_isf: Wilson and Hilferty 1931, which is conservative for one or two degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from statistics import NormalDist

from fti.nav.plausibility.budget import P_SCATTER

Z = NormalDist().inv_cdf(1.0 - P_SCATTER)
MIN_VALUES = 30
MIN_EFFECTIVE = 2.0


def variance_ratio_limit(n_eff: float) -> float:
    """Largest nominal ratio of sample variance to true variance for an effective number of samples."""
    freedom = max(n_eff, MIN_EFFECTIVE) - 1.0
    part = 2.0 / (9.0 * freedom)
    return float((1.0 - part + Z * part**0.5) ** 3)


def sample_variance(values: Sequence[float]) -> tuple[float, float]:
    """Variance [m^2] and effective number of samples."""
    n = len(values)
    mean = sum(values) / n
    off = [value - mean for value in values]
    total = sum(o * o for o in off)
    if total == 0.0:
        return 0.0, float(n)
    rho = sum(a * b for a, b in pairwise(off)) / total
    rho = min(max(rho, 0.0), 0.999)
    return total / (n - 1), max(n * (1.0 - rho) / (1.0 + rho), MIN_EFFECTIVE)


def excess(values: Sequence[float], expected: float) -> tuple[float, float] | None:
    """Ratio of variances and its limit when the limit is exceeded; None otherwise, or for too few values."""
    if len(values) < MIN_VALUES or expected <= 0.0:
        return None
    variance, n_eff = sample_variance(values)
    ratio, limit = variance / expected, variance_ratio_limit(n_eff)
    return (ratio, limit) if ratio > limit else None
