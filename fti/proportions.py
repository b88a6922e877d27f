"""Shares of runs: confidence limits, and the number of failures by chance."""

from __future__ import annotations

import math

#: Two-sided 95 %.
Z = 1.959964


def wilson(successes: int, n: int) -> tuple[float, float]:
    """95 % interval of a probability with ``successes`` in n runs; (0, 1) without runs.

    Source: Wilson 1927.
    """
    if n == 0:
        return 0.0, 1.0
    share, extra = successes / n, Z**2 / n
    middle = (share + extra / 2.0) / (1.0 + extra)
    half = Z * math.sqrt(share * (1.0 - share) / n + extra / (4.0 * n)) / (1.0 + extra)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def max_failures_by_chance(n: int, p: float, level: float = 0.95) -> int:
    """The least k with P(X <= k) >= level for X binomial with n runs of probability p."""
    total, k = 0.0, -1
    while total < level:
        k += 1
        total += math.exp(
            math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)
            + k * math.log(p) + (n - k) * math.log1p(-p)
        )  # fmt: skip
    return k
