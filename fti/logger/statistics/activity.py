"""Histogram of the messages of a topic over time, in constant memory: for a plot of the whole session."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

#: Initial width of the bins; it doubles whenever there are too many bins.
FIRST_WIDTH_NS = 2**20
MAX_BINS = 4096
INTERVALS_PER_CELL = 4
MIN_MESSAGES = 20


class Activity:
    """Counts in bins of equal width."""

    def __init__(self) -> None:
        self._width_ns = FIRST_WIDTH_NS
        self._bins: Counter[int] = Counter()

    def add(self, times: NDArray[np.int64]) -> None:
        """Add messages [ns]."""
        bins, counts = np.unique(times // self._width_ns, return_counts=True)
        self._bins.update(dict(zip(bins.tolist(), counts.tolist(), strict=True)))
        while len(self._bins) > MAX_BINS:
            self._widen()

    def _widen(self) -> None:
        self._width_ns *= 2
        wider: Counter[int] = Counter()
        for bin_index, count in self._bins.items():
            wider[bin_index // 2] += count
        self._bins = wider

    def counts(self, begin_ns: int, end_ns: int, cells: int) -> list[int]:
        """Messages in each of ``cells`` equal parts of a time span, with the resolution of a bin."""
        counts = [0] * cells
        span = max(end_ns - begin_ns, 1)
        for bin_index, count in self._bins.items():
            middle = bin_index * self._width_ns + self._width_ns // 2
            counts[min(max((middle - begin_ns) * cells // span, 0), cells - 1)] += count
        return counts

    def relative(self, begin_ns: int, end_ns: int, cells: int, usual_ns: float) -> list[float]:
        """The rate in each part, relative to the median of the parts with messages.

        Parts shorter than four usual intervals are merged with neighbours, except for topics with few messages.
        """
        counts = self.counts(begin_ns, end_ns, cells)
        group_size = round(INTERVALS_PER_CELL * usual_ns * cells / max(end_ns - begin_ns, 1))
        group = max(group_size, 1) if sum(counts) >= MIN_MESSAGES else 1
        parts = [counts[at : at + group] for at in range(0, cells, group)]
        rates = [sum(part) / len(part) for part in parts]
        median = float(np.median([rate for rate in rates if rate] or [1.0]))
        return [rate / median for part, rate in zip(parts, rates, strict=True) for _ in part]
