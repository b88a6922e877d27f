"""Latency of outputs: from the timestamp of a frame to the publication of its last output."""

from __future__ import annotations

from fti.latency_histogram import LatencyHistogram
from fti.messages.health import OutputDelay

PERIOD_NS = 5_000_000_000


class OutputLatency:
    """Latency percentiles over the last complete period."""

    def __init__(self, now_ns: int) -> None:
        self._current = LatencyHistogram()
        self._since_ns = now_ns
        self._published: OutputDelay | None = None

    def add(self, stamp_ns: int, out_ns: int) -> None:
        """Add one latency.  stamp_ns : timestamp of a frame; out_ns : publication of its last output [ns]"""
        self._current.add((out_ns - stamp_ns) / 1e9)

    def percentiles(self, now_ns: int) -> OutputDelay | None:
        """None without outputs, and before the end of the first period."""
        if now_ns - self._since_ns >= PERIOD_NS:
            late = self._current.summary
            percentiles = OutputDelay(p50_ms=late.p50_ms, p99_ms=late.p99_ms, max_ms=late.max_ms)
            self._published = percentiles if late.messages else None
            self._current, self._since_ns = LatencyHistogram(), now_ns
        return self._published
