"""One look at all sockets of a loop with each beat: every 20 ms, shortly before the tick.

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
    """The sockets of one loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._epoll = select.epoll()
        self._reads: dict[int, Read] = {}
        self._busy = False  # more was waiting than one call takes
        self._next: asyncio.Handle = loop.call_soon(self._look)

    @property
    def empty(self) -> bool:
        """No socket is left."""
        return not self._reads

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
        more = [read() for fd, _ in self._epoll.poll(0) if (read := self._reads.get(fd))]
        if self._epoll.closed:  # by one of them
            return
        if any(more):
            self._busy = True
            self._next = self._loop.call_soon(self._look)
        else:
            now, beat = self._loop.time(), next_beat(self._loop.time(), BEAT_S)
            self._next = self._loop.call_at(min(now + SOON_S, beat) if self._busy else beat, self._look)
            self._busy = False


_polls: dict[asyncio.AbstractEventLoop, SocketPoll] = {}


def watch(fd: int, read: Read) -> None:
    """Call ``read`` when the socket has something, from the running loop."""
    loop = asyncio.get_running_loop()
    if loop not in _polls:
        _polls[loop] = SocketPoll(loop)
    _polls[loop].add(fd, read)


def forget(fd: int) -> None:
    """No longer, and before the socket is closed."""
    loop = asyncio.get_running_loop()
    if poll := _polls.get(loop):
        poll.remove(fd)
        if poll.empty:
            _polls.pop(loop).close()
