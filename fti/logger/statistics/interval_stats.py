"""Times between the messages of one topic, in a fixed memory: how regular they are, and where there were gaps."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SECOND_NS = 1_000_000_000
#: The classes of the histogram: from 1 us to 1e7 s, each 1 % wide.
MIN_INTERVAL_NS, RATIO, CLASSES = 1_000, 1.01, 3_010
_LOG_RATIO = math.log(RATIO)
#: A gap is longer than so many usual intervals.
GAP_FACTOR = 5.0
#: The usual interval is kept by this share of all: so bursts (three messages, then a pause) are no gaps.
USUAL_SHARE = 0.95
#: Messages closer to each other came together: that is no interval to measure gaps by, where there are others.
MAX_SIMULTANEOUS_NS = 100_000
MAX_GAPS = 200
_FIRST_SEPARATE_CLASS = math.ceil(math.log(MAX_SIMULTANEOUS_NS / MIN_INTERVAL_NS) / math.log(RATIO))


class TimeGap(NamedTuple):
    """A silence: its begin (the message before it) and its length [ns]."""

    begin_ns: int
    length_ns: int


class Intervals:
    """Fed with times in order of arrival; a time before an earlier one counts as an interval of 0."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._counts = np.zeros(CLASSES, np.int64)
        self._sums = np.zeros(CLASSES)
        self._squares = np.zeros(CLASSES)
        self._longest = np.zeros((0, 2), np.int64)  # length, begin

    def add(self, times: NDArray[np.int64]) -> None:
        """Add messages [ns]."""
        known = times if self._last is None else np.concatenate(([self._last], times))
        known = np.maximum.accumulate(known)
        self._last = int(known[-1])
        intervals = np.diff(known)
        if len(intervals):
            self._classify(intervals)
            self._keep(intervals, known[:-1])

    def _classify(self, intervals: NDArray[np.int64]) -> None:
        classes = (np.log(np.maximum(intervals, MIN_INTERVAL_NS) / MIN_INTERVAL_NS) / _LOG_RATIO).astype(np.int64)
        classes = np.minimum(classes, CLASSES - 1)
        lengths = intervals / SECOND_NS
        self._counts += np.bincount(classes, minlength=CLASSES)
        self._sums += np.bincount(classes, lengths, CLASSES)
        self._squares += np.bincount(classes, lengths**2, CLASSES)

    def _keep(self, intervals: NDArray[np.int64], begins: NDArray[np.int64]) -> None:
        """Remember the longest."""
        both = np.concatenate((self._longest, np.stack((intervals, begins), axis=1)))
        if len(both) > MAX_GAPS:
            both = both[np.argpartition(both[:, 0], -MAX_GAPS)[-MAX_GAPS:]]
        self._longest = both

    @property
    def count(self) -> int:
        """Number of intervals."""
        return int(self._counts.sum())

    @property
    def longest(self) -> TimeGap | None:
        """The longest interval."""
        return TimeGap(*map(int, self._longest[self._longest[:, 0].argmax()][::-1])) if len(self._longest) else None

    def quantile_s(self, share: float, first: int = 0, end: int = CLASSES) -> float | None:
        """The interval [s], to 1 %, that a share of those in the classes from first to end do not exceed."""
        counts = self._counts[first:end]
        total = int(counts.sum())
        if not total:
            return None
        place = first + int(np.searchsorted(np.cumsum(counts), int(share * (total - 1)), side="right"))
        return float(self._sums[place] / self._counts[place])

    @property
    def usual_s(self) -> float | None:
        """The interval that 95 % keep [s]."""
        apart = self.quantile_s(USUAL_SHARE, _FIRST_SEPARATE_CLASS)
        return self.quantile_s(USUAL_SHARE) if apart is None else apart

    @property
    def _first_gap_class(self) -> int:
        """The first class that is longer than five usual intervals."""
        usual = self.usual_s
        if usual is None:
            return CLASSES
        limit = max(GAP_FACTOR * usual * SECOND_NS / MIN_INTERVAL_NS, RATIO)
        return min(math.ceil(math.log(limit) / _LOG_RATIO), CLASSES)

    @property
    def gap_limit_s(self) -> float | None:
        """A gap is as long or longer [s]: five usual intervals, to 1 %.  None with fewer than two messages."""
        return None if self.usual_s is None else MIN_INTERVAL_NS * RATIO**self._first_gap_class / SECOND_NS

    @property
    def gap_count(self) -> int:
        """Number of all gaps."""
        return int(self._counts[self._first_gap_class :].sum())

    @property
    def gaps(self) -> list[TimeGap]:
        """The gaps in order of time; the longest 200 when there are more."""
        limit = (self.gap_limit_s or math.inf) * SECOND_NS
        return sorted(TimeGap(int(begin), int(length)) for length, begin in self._longest if length >= limit)

    @property
    def sd_s(self) -> float | None:
        """Standard deviation of the intervals that are no gaps [s]."""
        regular = slice(0, self._first_gap_class)
        count = int(self._counts[regular].sum())
        if not count:
            return None
        mean = float(self._sums[regular].sum()) / count
        return math.sqrt(max(float(self._squares[regular].sum()) / count - mean**2, 0.0))

    @property
    def p99_s(self) -> float | None:
        """The interval that 99 % of those that are no gaps do not exceed [s]."""
        return self.quantile_s(0.99, end=self._first_gap_class)
