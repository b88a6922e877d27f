"""Reception events: standstills of the recorder, frames dropped by the kernel, refused kernel timestamps.

The beat of the recorder comes every 20 ms.  A beat that is a second late means that the process had no processor, or
was stopped: it neither read nor wrote in that time.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from fti.links.base import LinkStatus

#: A loop cycle that comes later than this ends a pause of the process.
MIN_PAUSE_NS = 1_000_000_000
#: Drops counted within this time after a pause are attributed to it.
PAUSE_EFFECT_NS = 2_000_000_000
#: Minimum time between two events of a counter; a counter that keeps rising is reported at this period.
EVENT_PERIOD_NS = 10_000_000_000

STAMPS_REFUSED = (
    "they may be from before a step of the real-time clock, or are outside the time since the last frame; the frames "
    "have the time of the read"
)
#: Level, source, text.
EventFields = tuple[str, str, str]


class ProcessPause(NamedTuple):
    """A standstill of the process: its length and its end [ns, FTI time]."""

    length_ns: int
    ended_ns: int


@dataclass(slots=True)
class _Counter:
    """One counter of one link: last value, last reported value, time of the last report.

    rising_ns : time of the first unreported increase; None if all is reported
    pause     : the pause that ended just before that
    """

    last: int = 0
    reported: int = 0
    reported_ns: int | None = None
    rising_ns: int | None = None
    pause: ProcessPause | None = None

    def report(self, count: int, now_ns: int, pause: ProcessPause | None, *, final: bool) -> int:
        """The increase to report now: when the counter has stopped rising, or has risen for too long."""
        rising, self.last = count > self.last, count
        if count == self.reported:
            return 0
        if self.rising_ns is None:
            self.rising_ns, self.pause = now_ns, pause
        incomplete = rising and now_ns - self.rising_ns < EVENT_PERIOD_NS
        recent = self.reported_ns is not None and now_ns - self.reported_ns < EVENT_PERIOD_NS
        if (incomplete or recent) and not final:
            return 0
        fresh = count - self.reported
        self.reported, self.reported_ns, self.rising_ns = count, now_ns, None
        return fresh


class ReceptionMonitor:
    """Checks each cycle of the recorder's loop (at least every 20 ms) and the counters of the links."""

    def __init__(self) -> None:
        self._cycle_ns: int | None = None
        self._pause: ProcessPause | None = None
        self._unreported: list[ProcessPause] = []
        self._counters: defaultdict[tuple[str, str], _Counter] = defaultdict(_Counter)

    def on_cycle(self, now_ns: int) -> float:
        """Length of the pause that ends with this cycle [s]; 0.0 when the cycle was in time."""
        before, self._cycle_ns = self._cycle_ns, now_ns
        if before is None or now_ns - before < MIN_PAUSE_NS:
            return 0.0
        self._pause = ProcessPause(now_ns - before, now_ns)
        self._unreported.append(self._pause)
        return (now_ns - before) / 1e9

    def events(
        self, now_ns: int, links: Iterable[tuple[str, LinkStatus]], *, final: bool = False
    ) -> Iterator[EventFields]:
        """The events to report now; call it twice a second.  final : report everything."""
        pauses, self._unreported = self._unreported, []
        for pause in pauses:
            yield "warning", "recorder", f"stood still for {_seconds(pause)}: no data were read or written"
        recent = self._pause if self._pause and now_ns - self._pause.ended_ns <= PAUSE_EFFECT_NS else None
        for name, status in links:
            drops = self._counters[name, "drops"]
            if count := drops.report(status.socket_dropped, now_ns, recent, final=final):
                yield "warning", name, f"the kernel dropped {count} frames: {_describe_cause(drops.pause)}"
            stamps = self._counters[name, "stamps"]
            if count := stamps.report(status.stamp_refused, now_ns, recent, final=final):
                yield "warning", name, f"{count} kernel timestamps were refused: {STAMPS_REFUSED}"


def _describe_cause(pause: ProcessPause | None) -> str:
    if pause:
        return f"the recorder stood still for {_seconds(pause)}, and the receive queue was full"
    return "the receive queue was full before the recorder read it"


def _seconds(pause: ProcessPause) -> str:
    return f"{pause.length_ns / 1e9:.1f} s"
