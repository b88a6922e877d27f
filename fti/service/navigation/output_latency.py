"""How long after the stamp of a frame what navigation made of it was out."""

from __future__ import annotations

from fti.latency_histogram import LatencyHistogram

PERIOD_NS = 5_000_000_000


class OutputLatency:
    """Percentiles over the last whole period."""

    def __init__(self, now_ns: int) -> None:
        self._running = LatencyHistogram()
        self._since_ns = now_ns
        self._published: dict[str, float] | None = None

    def add(self, stamp_ns: int, out_ns: int) -> None:
        """Stamp of a frame, and when the last output that it led to was out [ns]."""
        self._running.add((out_ns - stamp_ns) / 1e9)

    def percentiles(self, now_ns: int) -> dict[str, float] | None:
        """``p50_ms``, ``p99_ms``, ``max_ms`` [ms]; None when nothing was out, and before the first period is over."""
        if now_ns - self._since_ns >= PERIOD_NS:
            late = self._running.lateness
            told = {"p50_ms": late.p50_ms, "p99_ms": late.p99_ms, "max_ms": late.max_ms}
            self._published = told if late.messages else None
            self._running, self._since_ns = LatencyHistogram(), now_ns
        return self._published
