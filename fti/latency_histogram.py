"""Latency percentiles from a histogram of fixed size, for any number of messages."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

#: Bins are 1 us wide below 32 us, and above that at most 1/16 of the latency: a percentile has a resolution of 6 %.
STEPS = 16
MAX_LATENCY_US = 2**30  # 18 minutes; larger latencies count in the last bin, the maximum is exact
BINS = STEPS * (MAX_LATENCY_US.bit_length() - 3)


@dataclass(frozen=True, slots=True)
class LatencySummary:
    """Latency of messages [ms]; p50 and p99 are upper bounds, at most 6 % (or 1 us) too large."""

    messages: int
    p50_ms: float
    p99_ms: float
    max_ms: float


class LatencyHistogram:
    """Histogram of latencies [s].  ``add`` takes about 1 us, ``summary`` some 10 us."""

    def __init__(self) -> None:
        self._counts = [0] * BINS
        self._messages = 0
        self._max_s = 0.0

    def add(self, latency_s: float) -> None:
        """Add one message; a negative latency counts as zero."""
        late_us = min(int(latency_s * 1e6), MAX_LATENCY_US) if latency_s > 0.0 else 0
        shift = max(late_us.bit_length() - 5, 0)
        self._counts[STEPS * shift + (late_us >> shift)] += 1
        self._messages += 1
        self._max_s = max(self._max_s, latency_s)

    @classmethod
    def merge(cls, parts: Iterable[LatencyHistogram]) -> LatencyHistogram:
        """The latencies of all parts."""
        merged = cls()
        for part in parts:
            merged._counts = [a + b for a, b in zip(merged._counts, part._counts, strict=True)]
            merged._messages += part._messages
            merged._max_s = max(merged._max_s, part._max_s)
        return merged

    @property
    def summary(self) -> LatencySummary:
        """The percentiles so far (nearest rank)."""
        return LatencySummary(self._messages, self._percentile_ms(0.5), self._percentile_ms(0.99), 1e3 * self._max_s)

    def _percentile_ms(self, share: float) -> float:
        """Upper edge of the bin that contains the percentile, or the maximum if smaller [ms]."""
        rank, total = min(int(share * self._messages), self._messages - 1), 0
        for index, count in enumerate(self._counts):
            total += count
            if total > rank:
                shift = max(index // STEPS - 1, 0)
                return min(1e-3 * ((index - STEPS * shift + 1) << shift), 1e3 * self._max_s)
        return 0.0
