"""When navigation gives up what waits for it in the ring, and what a person is told of it.

What waits is caught up with, however long that takes: a burst, a start, a cold compile cost lateness and no frame.
Only when the ring has overrun navigation is it shown that navigation cannot follow.  Frames are lost then anyway, and
from there on values in time are worth more than all values: what has waited for longer than a value may be old is
skipped too, until navigation has had to wait for frames, and not they for it, for a while.
"""

from __future__ import annotations

from fti.types import Event

SECOND_NS = 1_000_000_000
#: What has waited for longer is late for every consumer, whatever is made of it.
MAX_WAIT_NS = SECOND_NS // 2
#: Navigation follows again when it has found the ring empty so often, and for so long, since the last skip.
MIN_IDLE_COUNT, MIN_IDLE_NS = 50, SECOND_NS
#: A person is told at once, and then at most so often.
EVENT_PERIOD_NS = 30 * SECOND_NS


class BacklogPolicy:
    """Whether frames may wait."""

    def __init__(self) -> None:
        self._overrun = False
        self._pauses = 0
        self._since_ns = 0  # of the first pause

    def on_overrun(self) -> None:
        """Frames were skipped."""
        self._overrun = True
        self._pauses = 0

    def rest(self, t_ns: int) -> None:
        """The ring was found empty."""
        if not self._pauses:
            self._since_ns = t_ns
        self._pauses += 1
        if self._pauses >= MIN_IDLE_COUNT and t_ns - self._since_ns >= MIN_IDLE_NS:
            self._overrun = False

    def must_skip(self, waited_ns: int) -> bool:
        """Is what waits behind a frame that has waited so long [ns] to be skipped?"""
        return self._overrun and waited_ns > MAX_WAIT_NS


class SkipReporter:
    """Events on what was skipped: the first at once, those that follow together."""

    def __init__(self) -> None:
        self._reported_ns: int | None = None
        self._times = self._frames = self._span_ns = 0

    def note(self, frames: int, span_ns: int) -> None:
        """So many frames were skipped, and so much time with them [ns]."""
        self._times += 1
        self._frames += frames
        self._span_ns += span_ns

    def take_event(self, t_ns: int) -> Event | None:
        """What has not been told yet, when it is due."""
        due = self._reported_ns is None or t_ns - self._reported_ns >= EVENT_PERIOD_NS
        return self.rest(t_ns) if due else None

    def rest(self, t_ns: int) -> Event | None:
        """What has not been told yet."""
        if not self._times:
            return None
        often = f" in {self._times} steps" if self._times > 1 else ""
        text = (
            f"does not follow: {self._frames} frames ({self._span_ns / SECOND_NS:.1f} s) were skipped{often} to be in "
            "time again; the recording has them"
        )
        self._reported_ns = t_ns
        self._times = self._frames = self._span_ns = 0
        return Event(t_ns=t_ns, level="warning", source="navigation", text=text)
