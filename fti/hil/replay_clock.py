"""The clock of a replay, and the stream of its frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

from fti.constants import SECOND_NS
from fti.errors import MissingError
from fti.hil.ports.endpoints import Endpoint
from fti.latency_histogram import LatencyHistogram, LatencySummary
from fti.messages.frames import RawFrame

#: A longer pause is reported: in a snapshot it may last until the next trigger.
MIN_PAUSE_S = 5.0


class ReplayClock:
    """A clock that can be paused and stepped by one frame.  real_s : a clock [s]; time 0 is ``start``"""

    def __init__(self, real_s: Callable[[], float]) -> None:
        self._real_s = real_s
        self._zero_s = real_s()
        self._paused_at_s: float | None = None
        self._steps = 0
        self.next_s = 0.0  # when the next frame is due

    def start(self) -> None:
        """Set the time to 0."""
        self._zero_s = self._real_s()
        if self._paused_at_s is not None:
            self._paused_at_s = 0.0

    @property
    def is_paused(self) -> bool:
        """Whether the clock is paused."""
        return self._paused_at_s is not None

    def now_s(self) -> float:
        """The time [s]; while paused nothing is due, or with a pending step the next frame."""
        if self._paused_at_s is None:
            return self._real_s() - self._zero_s
        return max(self._paused_at_s, self.next_s) if self._steps else -math.inf

    def pause(self) -> None:
        """Pause, or resume."""
        if self._paused_at_s is None:
            self._paused_at_s = self._real_s() - self._zero_s
        else:
            self._zero_s = self._real_s() - self._paused_at_s
            self._paused_at_s, self._steps = None, 0

    def step(self) -> None:
        """Release one frame, then pause."""
        if self._paused_at_s is None:
            self.pause()
        self._steps += 1

    def advance(self) -> None:
        """Complete a step after its frame was sent."""
        if self._paused_at_s is not None and self._steps:
            self._steps -= 1
            self._paused_at_s = max(self._paused_at_s, self.next_s)


class FrameStream:
    """Frames as ``fti.hil.prefetch_process`` gives them, as a stream of the scheduler.

    speed    : 2 is twice as fast
    progress : called with a message at long pauses
    """

    def __init__(
        self,
        frames: Iterator[RawFrame],
        endpoints: Mapping[str, Endpoint],
        replay_clock: ReplayClock,
        speed: float = 1.0,
        progress: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._frames, self._endpoints, self._transport = frames, endpoints, replay_clock
        self._speed, self._progress = speed, progress
        self._late = {link: LatencyHistogram() for link in endpoints}
        self._next = next(frames, None)
        self._due = self.last_late_s = 0.0

    @property
    def link_lateness(self) -> dict[str, LatencySummary]:
        """Lateness of the frames of each link."""
        return {link: late.summary for link, late in self._late.items()}

    @property
    def elapsed_s(self) -> float:
        """Duration of the frames so far at the requested speed [s]."""
        return self._due

    def due_s(self) -> float | None:
        """Due time of the next frame; frames keep their order even if their stamps do not increase."""
        if self._next is None:
            return None
        self._due = max(self._due, self._next.t_rx_ns / SECOND_NS / self._speed)
        self._transport.next_s = self._due
        return self._due

    def note(self, due_s: float, late_s: float) -> None:
        """Record the lateness of the next frame."""
        assert self._next is not None
        self.last_late_s = late_s
        self._late.setdefault(self._next.link, LatencyHistogram()).add(late_s)

    async def send(self) -> None:
        """Send the frame, without loss."""
        assert self._next is not None
        endpoint = self._endpoints.get(self._next.link)
        if endpoint is None:
            raise MissingError(f"link {self._next.link!r} of the recording is not in the configuration")
        await endpoint.send_all(self._next.data)
        self._transport.advance()
        self._next = next(self._frames, None)
        before_s = self._due
        if (due_s := self.due_s()) is not None and due_s - before_s > MIN_PAUSE_S:
            self._progress(f"pause in the recording; the next frame follows in {due_s - before_s:.0f} s")
