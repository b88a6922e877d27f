"""One deadline scheduler for everything that the emulator sends.

Each stream names its next instant; a heap holds one entry per stream.  Nothing is sent early, nothing is left out, and
how late each message goes out is kept, because a bench that is late must say so: what its own making takes at its
instant belongs to that.  How fine a sleep is, is the loop's: ``fti.hil.event_loop``.  Where there is time until the next
instant, messages are made ahead, several of a stream in a row: the soonest of those whose making fits in.
"""

from __future__ import annotations

import asyncio
import heapq
from bisect import insort
from collections.abc import Awaitable, Callable, Sequence
from typing import Protocol, runtime_checkable

from fti.latency_histogram import LatencyHistogram, LatencySummary

#: Longest sleep [s], so that a request to stop is seen; and messages sent before other tasks are let in.
MAX_SLEEP_S = 0.05
MAX_BATCH_MESSAGES = 32
#: Messages are made so much before their instant at most [s]: so long an answer of their device may have to wait.
#: A stream goes on with making when what it has made lasts no longer than REFILL_S, which no sleep passes over.
MAX_LEAD_S, REFILL_S = 0.1, 0.06


class Stream(Protocol):
    """Messages of one sender, in the order of their instants."""

    def due_s(self) -> float | None:
        """Instant of the next message [s] after the start; None when there is no more."""

    async def send(self) -> None:
        """Send the message that is due and step to the next one."""


@runtime_checkable
class MeteredStream(Protocol):
    """A stream that keeps how late its own messages are."""

    def note(self, due_s: float, late_s: float) -> None:
        """The next message was due at due_s [s] and goes out so much later."""


@runtime_checkable
class PreparableStream(Protocol):
    """A stream that can make its next messages before they are due."""

    def unprepared_s(self) -> float | None:
        """Instant of the first message that could be made ahead and is not; None when there is none."""

    def prepare(self, within_s: float, until_s: float) -> bool:
        """Make messages that are due until then, in no more than within_s [s]; was one made?"""

    def complete(self) -> None:
        """The next message is due: make it, unless it is made."""


class PreparationQueue:
    """The first messages that are not made, of all streams that can make them ahead, soonest first."""

    def __init__(self, streams: Sequence[Stream]) -> None:
        self._makers = {i: stream for i, stream in enumerate(streams) if isinstance(stream, PreparableStream)}
        self._first: dict[int, float | None] = dict.fromkeys(self._makers)
        self._waiting: list[tuple[float, int]] = []
        for i in self._makers:
            self.update(i)

    def update(self, index: int) -> None:
        """A stream has made or sent something: which is the first now?"""
        if index not in self._makers:
            return
        first, before = self._makers[index].unprepared_s(), self._first[index]
        if first != before:
            if before is not None:
                self._waiting.remove((before, index))
            if first is not None:
                insort(self._waiting, (first, index))
            self._first[index] = first

    def complete(self, index: int) -> None:
        """Its next message is due: it is made now, unless it was before."""
        if index in self._makers:
            self._makers[index].complete()

    def prepare_next(self, now: float, within_s: float) -> bool:
        """Make messages of the soonest stream for which there is time; false when there is none."""
        for first, i in self._waiting:
            if first > now + REFILL_S:
                return False
            if self._makers[i].prepare(within_s, now + MAX_LEAD_S):
                self.update(i)
                return True
        return False


class Scheduler:
    """Sends streams at their instants.

    now   : time since the start [s]; sleep : as asyncio.sleep
    ahead : make messages ahead; nothing is gained by a clock that stands still meanwhile
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
        self._ahead = can_prepare
        self._late = LatencyHistogram()
        self._preparation = PreparationQueue(())

    @property
    def lateness(self) -> LatencySummary:
        """How late the messages so far were."""
        return self._late.lateness

    async def run(self, streams: Sequence[Stream], stop: asyncio.Event, until_s: float = float("inf")) -> None:
        """Send until the streams end, ``until_s`` has passed or ``stop`` is set."""
        heap = [(due, i) for i, stream in enumerate(streams) if (due := stream.due_s()) is not None]
        heapq.heapify(heap)
        meters = [stream if isinstance(stream, MeteredStream) else None for stream in streams]
        self._preparation = PreparationQueue(streams if self._ahead else ())
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
        """Use or sleep a part of the time that is left; False when the instant has come."""
        now = self._now()
        left = due - now
        if left <= 0:
            return False
        if not self._preparation.prepare_next(now, left):
            await self._sleep(min(left, MAX_SLEEP_S))
        return True
