"""The beat of a loop: every 20 ms one look at all its sockets, and then whatever else belongs to the beat.

The kernel stamps what it queues, so nothing is gained by reading each datagram at once; and a process that wakes for
each finds its memory cold and pays for that many times what the reading costs.  Where more was waiting than one call
takes, the next look is soon, so that no receive buffer overflows.

An urgent link has all sockets looked at when it receives: all that arrived before its bytes is handed on with them.
That happens once between two beats for each link, and only where the beat is far away: a busy bus must not wake the
process for each frame.  Of a link that brings many messages it does not happen at all: the first one behind a beat
would wake the process each time, and seldom be the altimeter's.  A line brings a frame in pieces, so it is looked at a
moment after the first one.
"""

from __future__ import annotations

import asyncio
import select
from collections.abc import Callable

from fti.clock import next_beat
from fti.types import TICK_PERIOD_NS

BEAT_S = TICK_PERIOD_NS / 1e9
BUSY_POLL_DELAY_S = 0.005
#: A frame of a line comes within this time: 23 bytes at 115200 baud.
EARLY_POLL_DELAY_S = 0.002
#: A look that is earlier than the beat by less is not worth its cost (docs/decisions/0009-the-beat.md).
MIN_EARLY_GAIN_S = 0.008

#: Reads what is there; true when there may be more.
ReadCallback = Callable[[], bool]


class BeatScheduler:
    """The sockets of one loop.

    calls, early_calls : called behind the look at the sockets with each beat, and behind each look before it
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._epoll = select.epoll()
        self._reads: dict[int, ReadCallback] = {}
        self._urgent: dict[int, Callable[[], bool]] = {}
        self.calls: list[Callable[[], None]] = []
        self.early_calls: list[Callable[[], None]] = []
        self._lines_looked: set[object] = set()  # that have had their early look since the last beat
        self._sockets_looked: set[int] = set()  # that do not wake the loop
        self._early: asyncio.Handle | None = None
        self._reading = False
        self._beat_s = 0.0  # when the next one is due
        self._busy = False  # more was waiting than one call takes
        self._next: asyncio.Handle = loop.call_soon(self._poll_sockets)

    @property
    def is_empty(self) -> bool:
        """No socket is left, and nobody else wants the beat."""
        return not (self._reads or self.calls)

    def add(self, fd: int, read: ReadCallback, *, is_early: Callable[[], bool] | None = None) -> None:
        """Look at this socket too.

        is_early : asked behind a beat whether the next look may be as soon as it has something; None: never
        """
        self._reads[fd] = read
        self._epoll.register(fd, select.EPOLLIN)
        if is_early:
            self._urgent[fd] = is_early
            self._loop.add_reader(fd, self._wake, fd)

    def remove(self, fd: int) -> None:
        """Leave it alone, before it is closed."""
        if self._reads.pop(fd, None):
            self._epoll.unregister(fd)
        if fd in self._urgent:
            del self._urgent[fd]
            self._sockets_looked.discard(fd)
            self._loop.remove_reader(fd)

    def close(self) -> None:
        """End."""
        self._next.cancel()
        if self._early:
            self._early.cancel()
        self._epoll.close()

    def schedule_early_poll(self, link: object) -> None:
        """Look before the beat, when the rest of a frame has come: called while a link without a socket receives."""
        if not self._reading and link not in self._lines_looked:
            self._lines_looked.add(link)
            if self._early is None and self._is_worth_it(EARLY_POLL_DELAY_S):
                self._early = self._loop.call_later(EARLY_POLL_DELAY_S, self._poll_early)

    def _wake(self, fd: int) -> None:
        """An urgent socket has something; until the next beat it does not wake the loop again."""
        self._sockets_looked.add(fd)
        self._loop.remove_reader(fd)
        if self._is_worth_it(0.0):
            self._poll_early()

    def _is_worth_it(self, later_s: float) -> bool:
        """Is a look after that time well before the beat?"""
        return self._beat_s - self._loop.time() - later_s > MIN_EARLY_GAIN_S

    def _poll_sockets(self) -> None:
        more = self._read_all()
        now = self._loop.time()  # read once: what decides on the beat must plan the next one
        if now >= self._beat_s and not (more and now < self._beat_s + BUSY_POLL_DELAY_S):
            self._beat_s = next_beat(now, BEAT_S)
            self._allow_early()
            for call in tuple(self.calls):
                self._call_safely(call)
        if not self._epoll.closed:  # by one of them
            self._plan(more, now)

    def _poll_early(self) -> None:
        if self._early:
            self._early.cancel()  # a socket was quicker
            self._early = None
        if self._read_all():  # what still waits may be older: the beat hands it on in order
            return
        for call in tuple(self.early_calls):
            self._call_safely(call)

    def _allow_early(self) -> None:
        """Once for each link until the next beat."""
        self._lines_looked.clear()
        for fd in [fd for fd in self._sockets_looked if self._urgent[fd]()]:
            self._sockets_looked.remove(fd)
            self._loop.add_reader(fd, self._wake, fd)
        if self._early:  # what it is for is handed on now
            self._early.cancel()
            self._early = None

    def _read_all(self) -> bool:
        """Read every socket that has something; true when there may be more."""
        more, self._reading = False, True
        for fd, _ in self._epoll.poll(0):
            if read := self._reads.get(fd):
                more |= bool(self._call_safely(read))
        self._reading = False
        return more

    def _call_safely(self, call: Callable[[], bool | None]) -> bool | None:
        """Whatever one of them does, the others are looked at, and the beat goes on."""
        try:
            return call()
        except Exception as error:  # noqa: BLE001  the loop's handler is told, as it is of any callback
            self._loop.call_exception_handler({"message": "a look at the sockets", "exception": error})
            return None

    def _plan(self, more: bool, now: float) -> None:
        if more:
            self._next = self._loop.call_soon(self._poll_sockets)
        else:
            due = min(now + BUSY_POLL_DELAY_S, self._beat_s) if self._busy else self._beat_s
            self._next = self._loop.call_at(due, self._poll_sockets)
        self._busy = more


_schedulers: dict[asyncio.AbstractEventLoop, BeatScheduler] = {}


def _running_scheduler() -> BeatScheduler:
    """That of the running loop."""
    loop = asyncio.get_running_loop()
    if loop not in _schedulers:
        _schedulers[loop] = BeatScheduler(loop)
    return _schedulers[loop]


def _close_empty() -> None:
    loop = asyncio.get_running_loop()
    if _schedulers[loop].is_empty:
        _schedulers.pop(loop).close()


def watch(fd: int, read: ReadCallback, *, is_early: Callable[[], bool] | None = None) -> None:
    """Call ``read`` with a beat when the socket has something, or before it (see ``add``), from the running loop."""
    _running_scheduler().add(fd, read, is_early=is_early)


def unwatch(fd: int) -> None:
    """No longer, and before the socket is closed."""
    _running_scheduler().remove(fd)
    _close_empty()


def schedule_early_poll(link: object) -> None:
    """What a link without a socket receives now, in the running loop, does not wait for the beat."""
    if poll := _schedulers.get(asyncio.get_running_loop()):
        poll.schedule_early_poll(link)


def add_beat_callbacks(call: Callable[[], None], early: Callable[[], None]) -> None:
    """From the running loop, behind the look at the sockets: call this with every beat, and ``early`` before it."""
    poll = _running_scheduler()
    poll.calls.append(call)
    poll.early_calls.append(early)


def remove_beat_callbacks(call: Callable[[], None], early: Callable[[], None]) -> None:
    """No longer."""
    poll = _running_scheduler()
    poll.calls.remove(call)
    poll.early_calls.remove(early)
    _close_empty()
