"""Backlog policy of the navigation process, and the events about skipped frames.

1. Navigation processes its whole backlog, however long that takes: after a burst, a start or a compilation it is late,
   but loses no frame.
2. When the ring has overrun navigation, frames are lost anyway.  From then on it skips to the newest frames whenever
   they have waited longer than ``MAX_WAIT_NS``, until it has been idle for a while.
"""

from __future__ import annotations

from fti.constants import SECOND_NS
from fti.messages.outputs import Event

#: Outputs of frames that have waited longer are late for every consumer.
MAX_WAIT_NS = SECOND_NS // 2
#: Skipping ends when the ring was found empty this often, over this time, since the last skip.
MIN_IDLE_COUNT, MIN_IDLE_NS = 50, SECOND_NS
#: Minimum time between two events.
EVENT_PERIOD_NS = 30 * SECOND_NS


class BacklogPolicy:
    """Decides whether frames may wait."""

    def __init__(self) -> None:
        self._overrun = False
        self._idle_count = 0
        self._since_ns = 0  # first time that the ring was found empty

    def on_overrun(self) -> None:
        """Frames were lost or skipped."""
        self._overrun = True
        self._idle_count = 0

    def on_idle(self, t_ns: int) -> None:
        """The ring was found empty."""
        if not self._idle_count:
            self._since_ns = t_ns
        self._idle_count += 1
        if self._idle_count >= MIN_IDLE_COUNT and t_ns - self._since_ns >= MIN_IDLE_NS:
            self._overrun = False

    def must_skip(self, waited_ns: int) -> bool:
        """Must the backlog be skipped?  waited_ns : waiting time of the last frame [ns]"""
        return self._overrun and waited_ns > MAX_WAIT_NS


class SkipReporter:
    """Events about skipped frames: the first at once, later ones combined."""

    def __init__(self) -> None:
        self._reported_ns: int | None = None
        self._times = self._frames = self._span_ns = 0

    def add(self, frames: int, span_ns: int) -> None:
        """Count skipped frames and their time span [ns]."""
        self._times += 1
        self._frames += frames
        self._span_ns += span_ns

    def take_event(self, t_ns: int) -> Event | None:
        """The event about unreported frames, when it is due."""
        due = self._reported_ns is None or t_ns - self._reported_ns >= EVENT_PERIOD_NS
        return self.flush(t_ns) if due else None

    def flush(self, t_ns: int) -> Event | None:
        """The event about unreported frames; None if there are none."""
        if not self._times:
            return None
        steps = f" in {self._times} steps" if self._times > 1 else ""
        text = (
            f"does not follow: {self._frames} frames ({self._span_ns / SECOND_NS:.1f} s) were skipped{steps} to be in "
            "time again; the recording has them"
        )
        self._reported_ns = t_ns
        self._times = self._frames = self._span_ns = 0
        return Event(t_ns=t_ns, level="warning", source="navigation", text=text)
