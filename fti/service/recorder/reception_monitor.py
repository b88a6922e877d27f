"""Events of the reception: a recorder that stood still, frames that the kernel dropped, kernel stamps it refused.

The beat of the recorder comes every 20 ms.  A beat that comes a second late means that the process had no processor,
or was stopped: nothing was read, and nothing was written either, whatever the medium would have taken.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from fti.links.base import LinkStatus

#: A turn of the loop that comes later than this ends a pause of the process.
MIN_PAUSE_NS = 1_000_000_000
#: Drops that are counted within this time after a pause were caused by it.
PAUSE_EFFECT_NS = 2_000_000_000
#: Counters that go on rising are reported this often, and each counter of a link not more often.
EVENT_PERIOD_NS = 10_000_000_000

STAMPS_REFUSED = (
    "they may be from before a step of the real-time clock, or are not from the time since the last frame; the frames "
    "have the time at which they were read"
)
#: Level, source, text.
EventFields = tuple[str, str, str]


class ProcessPause(NamedTuple):
    """The process stood still for so long, until then [ns, FTI time]."""

    length_ns: int
    ended_ns: int


@dataclass(slots=True)
class _Counter:
    """One counter of one link: what was seen last and reported last, and when.

    rising_ns : the first look at a count that is not reported yet; None when all is
    pause     : what ended just before that
    """

    seen: int = 0
    reported: int = 0
    reported_ns: int | None = None
    rising_ns: int | None = None
    pause: ProcessPause | None = None

    def report(self, count: int, now_ns: int, pause: ProcessPause | None, *, final: bool) -> int:
        """What is to be reported now: all since the last report, when no more came with this look, or for too long."""
        rising, self.seen = count > self.seen, count
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
    """Sees each turn of the recorder's loop that comes at least every 20 ms, and now and then the counters of links."""

    def __init__(self) -> None:
        self._turn_ns: int | None = None
        self._pause: ProcessPause | None = None
        self._unreported: list[ProcessPause] = []
        self._counters: defaultdict[tuple[str, str], _Counter] = defaultdict(_Counter)

    def on_turn(self, now_ns: int) -> float:
        """Length of the pause of the process that ends with this turn [s]; 0.0 when the turn was in time."""
        before, self._turn_ns = self._turn_ns, now_ns
        if before is None or now_ns - before < MIN_PAUSE_NS:
            return 0.0
        self._pause = ProcessPause(now_ns - before, now_ns)
        self._unreported.append(self._pause)
        return (now_ns - before) / 1e9

    def events(
        self, now_ns: int, links: Iterable[tuple[str, LinkStatus]], *, final: bool = False
    ) -> Iterator[EventFields]:
        """What is to be told now; called twice a second.  final : nothing is kept back any more."""
        pauses, self._unreported = self._unreported, []
        for pause in pauses:
            yield "warning", "recorder", f"stood still for {_seconds(pause)}: nothing was read or written meanwhile"
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
