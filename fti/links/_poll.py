"""The beat of a loop: every 20 ms one look at all its sockets, and then whatever else belongs to the beat.

The kernel stamps what it queues, so nothing is gained by reading each datagram at once; and a process that wakes for
each finds its memory cold and pays for that many times what the reading costs.  Where more was waiting than one call
takes, the next look is soon, so that no receive buffer overflows.
"""

from __future__ import annotations

import asyncio
import select
from collections.abc import Callable

from fti.clock import next_beat
from fti.types import TICK_PERIOD_NS

BEAT_S = TICK_PERIOD_NS / 1e9
SOON_S = 0.005

#: Reads what is there; true when there may be more.
Read = Callable[[], bool]


class SocketPoll:
    """The sockets of one loop, and what is called with each beat, behind the look at them."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._epoll = select.epoll()
        self._reads: dict[int, Read] = {}
        self.calls: list[Callable[[], None]] = []
        self._beat_s = 0.0  # when the next one is due
        self._busy = False  # more was waiting than one call takes
        self._next: asyncio.Handle = loop.call_soon(self._look)

    @property
    def empty(self) -> bool:
        """No socket is left, and nobody else wants the beat."""
        return not (self._reads or self.calls)

    def add(self, fd: int, read: Read) -> None:
        """Look at this socket too."""
        self._reads[fd] = read
        self._epoll.register(fd, select.EPOLLIN)

    def remove(self, fd: int) -> None:
        """Leave it alone, before it is closed."""
        if self._reads.pop(fd, None):
            self._epoll.unregister(fd)

    def close(self) -> None:
        """End."""
        self._next.cancel()
        self._epoll.close()

    def _look(self) -> None:
        more = False
        for fd, _ in self._epoll.poll(0):
            if read := self._reads.get(fd):
                more |= bool(self._safely(read))
        now = self._loop.time()  # read once: what decides on the beat must plan the next one
        if now >= self._beat_s and not (more and now < self._beat_s + SOON_S):
            self._beat_s = next_beat(now, BEAT_S)
            for call in tuple(self.calls):
                self._safely(call)
        if not self._epoll.closed:  # by one of them
            self._plan(more, now)

    def _safely(self, call: Callable[[], bool | None]) -> bool | None:
        """Whatever one of them does, the others are looked at, and the beat goes on."""
        try:
            return call()
        except Exception as error:  # noqa: BLE001  the loop's handler is told, as it is of any callback
            self._loop.call_exception_handler({"message": "a look at the sockets", "exception": error})
            return None

    def _plan(self, more: bool, now: float) -> None:
        if more:
            self._next = self._loop.call_soon(self._look)
        else:
            due = min(now + SOON_S, self._beat_s) if self._busy else self._beat_s
            self._next = self._loop.call_at(due, self._look)
        self._busy = more


_polls: dict[asyncio.AbstractEventLoop, SocketPoll] = {}


def _poll() -> SocketPoll:
    """That of the running loop."""
    loop = asyncio.get_running_loop()
    if loop not in _polls:
        _polls[loop] = SocketPoll(loop)
    return _polls[loop]


def _close_empty() -> None:
    loop = asyncio.get_running_loop()
    if _polls[loop].empty:
        _polls.pop(loop).close()


def watch(fd: int, read: Read) -> None:
    """Call ``read`` with a beat when the socket has something, from the running loop."""
    _poll().add(fd, read)


def forget(fd: int) -> None:
    """No longer, and before the socket is closed."""
    _poll().remove(fd)
    _close_empty()


def with_beat(call: Callable[[], None]) -> None:
    """Call this with every beat, behind the look at the sockets, from the running loop."""
    _poll().calls.append(call)


def without_beat(call: Callable[[], None]) -> None:
    """No longer."""
    _poll().calls.remove(call)
    _close_empty()
