"""Test whether a filter is lost: the residuals of the last samples are larger than the filter predicts.

The sum of residual^2 over variance of ``SAMPLES`` samples has a chi-square distribution with as many degrees of
freedom when the filter and its model are right.  A filter that follows a wrong hill has residuals of many sigma within
a few samples.  Every sum is tested; sums that overlap are not independent, so the level is that of one sum.

Source: Bar-Shalom, Li, Kirubarajan 2001, section 5.4 (consistency of a filter by its innovations).
"""

from __future__ import annotations

import math
from collections import deque

from scipy.special import chdtri

SAMPLES = 10
#: Probability that a sum of a filter that is right is larger than the limit.
FALSE_ALARM = 1e-5
LIMIT = float(chdtri(SAMPLES, FALSE_ALARM))


class ResidualTest:
    """On one flight."""

    def __init__(self) -> None:
        self._last: deque[float] = deque(maxlen=SAMPLES)

    def add(self, residual_2: float) -> bool:
        """Whether the filter is lost.  residual_2 : residual^2 over variance of a sample; NaN: unknown ground"""
        if not math.isnan(residual_2):
            self._last.append(residual_2)
        return sum(self._last) > LIMIT

    def clear(self) -> None:
        """Begin anew."""
        self._last.clear()
