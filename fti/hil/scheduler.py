"""One deadline scheduler for everything that the emulator sends.

Each stream names its next instant; a heap holds one entry per stream.  Nothing is sent early, and how late each
message went out is kept, because a bench that is late must say so.
"""

from __future__ import annotations

import asyncio
import heapq
from array import array
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from fti.hil.ports.pty import Sent

#: Longest sleep [s], so that a request to stop is seen; and messages sent before other tasks are let in.
MAX_SLEEP_S = 0.05
BURST = 32


class Stream(Protocol):
    """Messages of one sender, in the order of their instants."""

    def due_s(self) -> float | None:
        """Instant of the next message [s] after the start; None when there is no more."""

    async def send(self) -> None:
        """Send the message that is due and step to the next one."""


@dataclass(frozen=True, slots=True)
class Lateness:
    """How late messages were sent [ms]."""

    messages: int
    p50_ms: float
    p99_ms: float
    max_ms: float


@dataclass(frozen=True, slots=True)
class Report:
    """What was sent, per link, and how late."""

    links: Mapping[str, Sent]
    lateness: Lateness


def lateness_of(late_s: Sequence[float]) -> Lateness:
    """Percentiles (nearest rank) of delays [s]."""
    ordered = sorted(late_s)
    if not ordered:
        return Lateness(0, 0.0, 0.0, 0.0)

    def rank(share: float) -> float:
        return 1e3 * ordered[min(int(share * len(ordered)), len(ordered) - 1)]

    return Lateness(len(ordered), rank(0.5), rank(0.99), 1e3 * ordered[-1])


class Scheduler:
    """Sends streams at their instants.  now : time since the start [s]; sleep : as asyncio.sleep."""

    def __init__(self, now: Callable[[], float], sleep: Callable[[float], Awaitable[None]] = asyncio.sleep) -> None:
        self._now = now
        self._sleep = sleep
        self._late = array("d")

    @property
    def lateness(self) -> Lateness:
        """How late the messages so far were."""
        return lateness_of(self._late)

    async def run(self, streams: Sequence[Stream], stop: asyncio.Event, until_s: float = float("inf")) -> None:
        """Send until the streams end, ``until_s`` has passed or ``stop`` is set."""
        heap = [(due, i) for i, stream in enumerate(streams) if (due := stream.due_s()) is not None]
        heapq.heapify(heap)
        sent = 0
        while heap and heap[0][0] <= until_s and not stop.is_set():
            due, i = heap[0]
            if await self._waited(due) or stop.is_set():
                continue
            self._late.append(self._now() - due)
            await streams[i].send()
            following = streams[i].due_s()
            if following is None:
                heapq.heappop(heap)
            else:
                heapq.heapreplace(heap, (following, i))
            sent += 1
            if sent % BURST == 0:
                await self._sleep(0)

    async def _waited(self, due: float) -> bool:
        """Sleep a part of the time that is left; False when the instant has come."""
        left = due - self._now()
        if left <= 0:
            return False
        await self._sleep(min(left, MAX_SLEEP_S))
        return True
