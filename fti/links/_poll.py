"""One look at all sockets of a loop, every 5 ms while something comes.

The kernel stamps what it queues, so nothing is gained by reading each datagram at once; and the wake-up of a process
costs more than the reading.  The first datagram wakes the loop as ever; from then on the sockets are looked at
together, until there is nothing any more.
"""

from __future__ import annotations

import asyncio
import select
from collections.abc import Callable

PERIOD_S = 0.005

#: Reads what is there; true when there may be more.
Read = Callable[[], bool]


class SocketPoll:
    """The sockets of one loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._epoll = select.epoll()
        self._reads: dict[int, Read] = {}
        self._next: asyncio.TimerHandle | asyncio.Handle | None = None
        loop.add_reader(self._epoll.fileno(), self._wake)

    @property
    def empty(self) -> bool:
        """No socket is left."""
        return not self._reads

    @property
    def resting(self) -> bool:
        """Nothing comes; the next datagram wakes it."""
        return self._next is None

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
        if self._next:
            self._next.cancel()
        self._loop.remove_reader(self._epoll.fileno())  # first: the loop knows it by its number
        self._epoll.close()

    def _wake(self) -> None:
        """Something has come."""
        self._loop.remove_reader(self._epoll.fileno())
        self._look()

    def _look(self) -> None:
        more = [read() for fd, _ in self._epoll.poll(0) if (read := self._reads.get(fd))]
        if self._epoll.closed:  # by one of them
            return
        if any(more):
            self._next = self._loop.call_soon(self._look)
        elif more:
            self._next = self._loop.call_later(PERIOD_S, self._look)
        else:
            self._next = None
            self._loop.add_reader(self._epoll.fileno(), self._wake)


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
