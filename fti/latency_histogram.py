"""How late something was, told in percentiles: a histogram of fixed size, however long it goes on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

#: Bins are 1 us wide below 32 us, and above at most a sixteenth of the delay: 6 % is the resolution of a percentile.
STEPS = 16
MAX_LATENCY_US = 2**30  # 18 minutes; later is counted as that, its maximum is exact all the same
BINS = STEPS * (MAX_LATENCY_US.bit_length() - 3)


@dataclass(frozen=True, slots=True)
class LatencySummary:
    """How late messages were [ms]; p50 and p99 are upper bounds, at most 6 % (or 1 us) above."""

    messages: int
    p50_ms: float
    p99_ms: float
    max_ms: float


class LatencyHistogram:
    """Delays [s].  Adding costs a microsecond, asking some tens."""

    def __init__(self) -> None:
        self._counts = [0] * BINS
        self._messages = 0
        self._max_s = 0.0

    def add(self, latency_s: float) -> None:
        """One more message; what is early counts as punctual."""
        late_us = min(int(latency_s * 1e6), MAX_LATENCY_US) if latency_s > 0.0 else 0
        shift = max(late_us.bit_length() - 5, 0)
        self._counts[STEPS * shift + (late_us >> shift)] += 1
        self._messages += 1
        self._max_s = max(self._max_s, latency_s)

    @classmethod
    def merge(cls, parts: Iterable[LatencyHistogram]) -> LatencyHistogram:
        """The delays of all of them."""
        whole = cls()
        for part in parts:
            whole._counts = [a + b for a, b in zip(whole._counts, part._counts, strict=True)]
            whole._messages += part._messages
            whole._max_s = max(whole._max_s, part._max_s)
        return whole

    @property
    def lateness(self) -> LatencySummary:
        """The percentiles so far (nearest rank)."""
        return LatencySummary(self._messages, self._percentile_ms(0.5), self._percentile_ms(0.99), 1e3 * self._max_s)

    def _percentile_ms(self, share: float) -> float:
        """The upper edge of the bin in which the percentile lies, or the maximum [ms]."""
        rank, seen = min(int(share * self._messages), self._messages - 1), 0
        for index, count in enumerate(self._counts):
            seen += count
            if seen > rank:
                shift = max(index // STEPS - 1, 0)
                return min(1e-3 * ((index - STEPS * shift + 1) << shift), 1e3 * self._max_s)
        return 0.0
