"""One deadline scheduler for everything that the emulator sends.

Each stream names its next instant; a heap holds one entry per stream.  Nothing is sent early, nothing is left out, and
how late each message goes out is kept, because a bench that is late must say so: what its own making takes at its
instant belongs to that.  How fine a sleep is, is the loop's: ``fti.hil.looping``.  Where there is time until the next
instant, messages are made ahead: the soonest of those whose making fits in.
"""

from __future__ import annotations

import asyncio
import heapq
from bisect import insort
from collections.abc import Awaitable, Callable, Sequence
from typing import Protocol, runtime_checkable

from fti.hil.lateness import Histogram, Lateness

#: Longest sleep [s], so that a request to stop is seen; and messages sent before other tasks are let in.
MAX_SLEEP_S = 0.05
BURST = 32
#: Messages are made so much before their instant at most [s]: so long an answer of their device may have to wait.
AHEAD_S = 0.2


class Stream(Protocol):
    """Messages of one sender, in the order of their instants."""

    def due_s(self) -> float | None:
        """Instant of the next message [s] after the start; None when there is no more."""

    async def send(self) -> None:
        """Send the message that is due and step to the next one."""


@runtime_checkable
class Metered(Protocol):
    """A stream that keeps how late its own messages are."""

    def note(self, due_s: float, late_s: float) -> None:
        """The next message was due at due_s [s] and goes out so much later."""


@runtime_checkable
class Preparing(Protocol):
    """A stream that can make its next message before it is due."""

    def prepare(self, within_s: float) -> bool:
        """Make it, unless that takes longer than within_s [s]; false when it was not tried for that."""

    def complete(self) -> None:
        """It is due: make it, unless it is made."""


class Unmade:
    """The next messages of all streams that can make them ahead, soonest first, until they are made."""

    def __init__(self, streams: Sequence[Stream]) -> None:
        self._makers = {i: stream for i, stream in enumerate(streams) if isinstance(stream, Preparing)}
        self._waiting: list[tuple[float, int]] = []

    def add(self, due: float | None, index: int) -> None:
        """The next message of a stream; None when there is none.  The one before it has left."""
        if index in self._makers and due is not None:
            insort(self._waiting, (due, index))

    def complete(self, due: float, index: int) -> None:
        """It is due: it is made now, unless it was before."""
        if (due, index) in self._waiting:
            self._waiting.remove((due, index))
        if index in self._makers:
            self._makers[index].complete()

    def make(self, within_s: float, until_s: float) -> bool:
        """Make the soonest one that is due until then and for which there is time; false when there is none."""
        for entry in self._waiting:
            if entry[0] > until_s:
                return False
            if self._makers[entry[1]].prepare(within_s):
                self._waiting.remove(entry)
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
        ahead: bool = False,
    ) -> None:
        self._now = now
        self._sleep = sleep
        self._ahead = ahead
        self._late = Histogram()
        self._unmade = Unmade(())

    @property
    def lateness(self) -> Lateness:
        """How late the messages so far were."""
        return self._late.lateness

    async def run(self, streams: Sequence[Stream], stop: asyncio.Event, until_s: float = float("inf")) -> None:
        """Send until the streams end, ``until_s`` has passed or ``stop`` is set."""
        heap = [(due, i) for i, stream in enumerate(streams) if (due := stream.due_s()) is not None]
        heapq.heapify(heap)
        meters = [stream if isinstance(stream, Metered) else None for stream in streams]
        self._unmade = Unmade(streams if self._ahead else ())
        for first, i in heap:
            self._unmade.add(first, i)
        sent = 0
        while heap and heap[0][0] <= until_s and not stop.is_set():
            due, i = heap[0]
            if await self._waited(due) or stop.is_set():
                continue
            self._unmade.complete(due, i)
            self._note(due, meters[i])
            await streams[i].send()
            following = streams[i].due_s()
            self._unmade.add(following, i)
            if following is None:
                heapq.heappop(heap)
            else:
                heapq.heapreplace(heap, (following, i))
            sent += 1
            if sent % BURST == 0:
                await self._sleep(0)

    def _note(self, due: float, meter: Metered | None) -> None:
        late = self._now() - due
        self._late.add(late)
        if meter is not None:
            meter.note(due, late)

    async def _waited(self, due: float) -> bool:
        """Use or sleep a part of the time that is left; False when the instant has come."""
        now = self._now()
        left = due - now
        if left <= 0:
            return False
        if not self._unmade.make(left, now + AHEAD_S):
            await self._sleep(min(left, MAX_SLEEP_S))
        return True
