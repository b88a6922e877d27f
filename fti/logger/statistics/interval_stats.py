"""Statistics of the intervals between the messages of one topic, in constant memory: jitter and gaps."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.constants import SECOND_NS

#: The classes of the histogram: from 1 us to 1e7 s, each 1 % wide.
MIN_INTERVAL_NS, RATIO, CLASSES = 1_000, 1.01, 3_010
_LOG_RATIO = math.log(RATIO)
#: Ratio of a gap to the usual interval.
GAP_FACTOR = 5.0
#: Quantile of the usual interval: the pauses between bursts (three messages, then a pause) are not gaps.
USUAL_SHARE = 0.95
#: Shorter intervals, of messages that came together, do not define the usual interval if there are others.
MAX_SIMULTANEOUS_NS = 100_000
MAX_GAPS = 200
_FIRST_SEPARATE_CLASS = math.ceil(math.log(MAX_SIMULTANEOUS_NS / MIN_INTERVAL_NS) / math.log(RATIO))


class TimeGap(NamedTuple):
    """A gap: its begin (the message before it) and its length [ns]."""

    begin_ns: int
    length_ns: int


class Intervals:
    """Receives times in order of arrival; a time before an earlier one counts as an interval of 0."""

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
        """Keep the longest intervals."""
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
        """Quantile ``share`` of the intervals in the classes from first to end [s], to 1 %."""
        counts = self._counts[first:end]
        total = int(counts.sum())
        if not total:
            return None
        bin_class = first + int(np.searchsorted(np.cumsum(counts), int(share * (total - 1)), side="right"))
        return float(self._sums[bin_class] / self._counts[bin_class])

    @property
    def usual_s(self) -> float | None:
        """The usual interval: the 95 % quantile [s]."""
        separate = self.quantile_s(USUAL_SHARE, _FIRST_SEPARATE_CLASS)
        return self.quantile_s(USUAL_SHARE) if separate is None else separate

    @property
    def _first_gap_class(self) -> int:
        """The first class above five usual intervals."""
        usual = self.usual_s
        if usual is None:
            return CLASSES
        limit = max(GAP_FACTOR * usual * SECOND_NS / MIN_INTERVAL_NS, RATIO)
        return min(math.ceil(math.log(limit) / _LOG_RATIO), CLASSES)

    @property
    def gap_limit_s(self) -> float | None:
        """Minimum length of a gap [s]: five usual intervals, to 1 %.  None with fewer than two messages."""
        return None if self.usual_s is None else MIN_INTERVAL_NS * RATIO**self._first_gap_class / SECOND_NS

    @property
    def gap_count(self) -> int:
        """Number of all gaps."""
        return int(self._counts[self._first_gap_class :].sum())

    @property
    def gaps(self) -> list[TimeGap]:
        """The gaps in order of time, at most the longest 200."""
        limit = (self.gap_limit_s or math.inf) * SECOND_NS
        return sorted(TimeGap(int(begin), int(length)) for length, begin in self._longest if length >= limit)

    @property
    def sd_s(self) -> float | None:
        """Standard deviation of the intervals without gaps [s]."""
        regular = slice(0, self._first_gap_class)
        count = int(self._counts[regular].sum())
        if not count:
            return None
        mean = float(self._sums[regular].sum()) / count
        return math.sqrt(max(float(self._squares[regular].sum()) / count - mean**2, 0.0))

    @property
    def p99_s(self) -> float | None:
        """The 99 % quantile of the intervals without gaps [s]."""
        return self.quantile_s(0.99, end=self._first_gap_class)
