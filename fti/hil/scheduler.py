"""One deadline scheduler for all streams of the emulator.

Each stream names its next due time; a heap holds one entry per stream.  Nothing is sent early or left out.  The
lateness of each message is recorded and includes its encoding at the due time.  The event loop determines the
precision of sleeps (``fti.hil.event_loop``).  Idle time is used to prepare messages, several of a stream in a row: the
earliest ones whose preparation fits into the time until the next due message.
"""

from __future__ import annotations

import asyncio
import heapq
from bisect import insort
from collections.abc import Awaitable, Callable, Sequence
from typing import Protocol, runtime_checkable

from fti.latency_histogram import LatencyHistogram, LatencySummary

#: Longest sleep [s], so that a stop request is noticed; and messages sent before other tasks run.
MAX_SLEEP_S = 0.05
MAX_BATCH_MESSAGES = 32
#: Messages are prepared at most MAX_LEAD_S before they are due [s]: an answer of the device waits as long.
#: A stream prepares again when its prepared messages last at most REFILL_S [s], which is longer than any sleep.
MAX_LEAD_S, REFILL_S = 0.1, 0.06


class Stream(Protocol):
    """Messages of one sender, in the order of their instants."""

    def due_s(self) -> float | None:
        """Due time of the next message [s] after the start; None when there is none."""

    async def send(self) -> None:
        """Send the message that is due and advance to the next one."""


@runtime_checkable
class MeteredStream(Protocol):
    """A stream that records the lateness of its own messages."""

    def note(self, due_s: float, late_s: float) -> None:
        """Record that the next message was due at due_s [s] and leaves late_s later."""


@runtime_checkable
class PreparableStream(Protocol):
    """A stream that can encode its next messages before they are due."""

    def unprepared_s(self) -> float | None:
        """Due time of the first message that can be prepared and is not; None when there is none."""

    def prepare(self, within_s: float, until_s: float) -> bool:
        """Encode messages due by until_s, in at most within_s [s].  Returns whether one was encoded."""

    def complete(self) -> None:
        """Encode the next message, which is due, unless it is prepared."""


class PreparationQueue:
    """First unprepared messages of all preparable streams, in the order of their due times."""

    def __init__(self, streams: Sequence[Stream]) -> None:
        self._preparable = {i: stream for i, stream in enumerate(streams) if isinstance(stream, PreparableStream)}
        self._first: dict[int, float | None] = dict.fromkeys(self._preparable)
        self._waiting: list[tuple[float, int]] = []
        for i in self._preparable:
            self.update(i)

    def update(self, index: int) -> None:
        """Update the entry of a stream that has prepared or sent messages."""
        if index not in self._preparable:
            return
        first, before = self._preparable[index].unprepared_s(), self._first[index]
        if first != before:
            if before is not None:
                self._waiting.remove((before, index))
            if first is not None:
                insort(self._waiting, (first, index))
            self._first[index] = first

    def complete(self, index: int) -> None:
        """Encode the next message of a stream, which is due, unless it is prepared."""
        if index in self._preparable:
            self._preparable[index].complete()

    def prepare_next(self, now: float, within_s: float) -> bool:
        """Prepare messages of the first stream for which there is time; False when there is none."""
        for first, i in self._waiting:
            if first > now + REFILL_S:
                return False
            if self._preparable[i].prepare(within_s, now + MAX_LEAD_S):
                self.update(i)
                return True
        return False


class Scheduler:
    """Sends the messages of streams at their due times.

    now         : time since the start [s]; sleep : as asyncio.sleep
    can_prepare : prepare messages in idle time; useless with a simulated clock
    """

    def __init__(
        self,
        now: Callable[[], float],
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
        *,
        can_prepare: bool = False,
    ) -> None:
        self._now = now
        self._sleep = sleep
        self._can_prepare = can_prepare
        self._late = LatencyHistogram()
        self._preparation = PreparationQueue(())

    @property
    def lateness(self) -> LatencySummary:
        """Lateness of the messages so far."""
        return self._late.summary

    async def run(self, streams: Sequence[Stream], stop: asyncio.Event, until_s: float = float("inf")) -> None:
        """Send until the streams end, ``until_s`` has passed or ``stop`` is set."""
        heap = [(due, i) for i, stream in enumerate(streams) if (due := stream.due_s()) is not None]
        heapq.heapify(heap)
        meters = [stream if isinstance(stream, MeteredStream) else None for stream in streams]
        self._preparation = PreparationQueue(streams if self._can_prepare else ())
        sent = 0
        while heap and heap[0][0] <= until_s and not stop.is_set():
            due, i = heap[0]
            if await self._wait(due) or stop.is_set():
                continue
            self._preparation.complete(i)
            self._note(due, meters[i])
            await streams[i].send()
            following = streams[i].due_s()
            self._preparation.update(i)
            if following is None:
                heapq.heappop(heap)
            else:
                heapq.heapreplace(heap, (following, i))
            sent += 1
            if sent % MAX_BATCH_MESSAGES == 0:
                await self._sleep(0)

    def _note(self, due: float, meter: MeteredStream | None) -> None:
        late = self._now() - due
        self._late.add(late)
        if meter is not None:
            meter.note(due, late)

    async def _wait(self, due: float) -> bool:
        """Prepare messages or sleep for a part of the remaining time; False when the message is due."""
        now = self._now()
        left = due - now
        if left <= 0:
            return False
        if not self._preparation.prepare_next(now, left):
            await self._sleep(min(left, MAX_SLEEP_S))
        return True
