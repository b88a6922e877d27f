"""Latency of outputs: from the timestamp of a frame to the publication of its last output."""

from __future__ import annotations

from fti.latency_histogram import LatencyHistogram

PERIOD_NS = 5_000_000_000


class OutputLatency:
    """Latency percentiles over the last complete period."""

    def __init__(self, now_ns: int) -> None:
        self._current = LatencyHistogram()
        self._since_ns = now_ns
        self._published: dict[str, float] | None = None

    def add(self, stamp_ns: int, out_ns: int) -> None:
        """Add one latency.  stamp_ns : timestamp of a frame; out_ns : publication of its last output [ns]"""
        self._current.add((out_ns - stamp_ns) / 1e9)

    def percentiles(self, now_ns: int) -> dict[str, float] | None:
        """``p50_ms``, ``p99_ms``, ``max_ms`` [ms]; None without outputs, and before the end of the first period."""
        if now_ns - self._since_ns >= PERIOD_NS:
            late = self._current.summary
            percentiles = {"p50_ms": late.p50_ms, "p99_ms": late.p99_ms, "max_ms": late.max_ms}
            self._published = percentiles if late.messages else None
            self._current, self._since_ns = LatencyHistogram(), now_ns
        return self._published
