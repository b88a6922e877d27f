"""The beat of an event loop: every 20 ms it polls all sockets, then calls the beat callbacks.

The kernel stamps queued datagrams, so reading each one at once gains nothing; a process that wakes for each datagram
has cold caches, which cost many times the reading itself.  If more data were waiting than one call reads, the next poll
follows soon, so that no receive buffer overflows.

When an urgent link receives, all sockets are polled early: all frames that arrived before its bytes are handed on with
them.  This happens once between two beats for each link, and only if the beat is not near: a busy bus must not wake the
process for each frame.  A link with a high message rate gets no early polls: the first message after a beat would wake
the process each time, and seldom be the altimeter's.  A serial line delivers a frame in pieces, so it is polled a
moment after the first piece.
"""

from __future__ import annotations

import asyncio
import select
from collections.abc import Callable

from fti.clock import next_beat
from fti.messages.frames import TICK_PERIOD_NS

BEAT_S = TICK_PERIOD_NS / 1e9
BUSY_POLL_DELAY_S = 0.005
#: Time for a frame of a serial line: 23 bytes at 115200 baud.
EARLY_POLL_DELAY_S = 0.002
#: A poll that precedes the beat by less is not worth its cost (docs/decisions/0009-the-beat.md).
MIN_EARLY_GAIN_S = 0.008

#: Reads the available data; true when there may be more.
ReadCallback = Callable[[], bool]


class BeatScheduler:
    """The sockets of one loop.

    calls, early_calls : called after the poll of the sockets with each beat, and after each early poll
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._epoll = select.epoll()
        self._reads: dict[int, ReadCallback] = {}
        self._urgent: dict[int, Callable[[], bool]] = {}
        self.calls: list[Callable[[], None]] = []
        self.early_calls: list[Callable[[], None]] = []
        self._early_links: set[object] = set()  # links with an early poll since the last beat
        self._unarmed_sockets: set[int] = set()  # urgent sockets that do not wake the loop
        self._early: asyncio.Handle | None = None
        self._reading = False
        self._beat_s = 0.0  # time of the next beat
        self._busy = False  # more was waiting than one call reads
        self._next: asyncio.Handle = loop.call_soon(self._poll_sockets)

    @property
    def is_empty(self) -> bool:
        """Are there neither sockets nor callbacks?"""
        return not (self._reads or self.calls)

    def add(self, fd: int, read: ReadCallback, *, is_early: Callable[[], bool] | None = None) -> None:
        """Add a socket.

        is_early : called after a beat: may the socket trigger an early poll when it receives?  None: never
        """
        self._reads[fd] = read
        self._epoll.register(fd, select.EPOLLIN)
        if is_early:
            self._urgent[fd] = is_early
            self._loop.add_reader(fd, self._wake, fd)

    def remove(self, fd: int) -> None:
        """Remove a socket before it is closed."""
        if self._reads.pop(fd, None):
            self._epoll.unregister(fd)
        if fd in self._urgent:
            del self._urgent[fd]
            self._unarmed_sockets.discard(fd)
            self._loop.remove_reader(fd)

    def close(self) -> None:
        """Stop the beat."""
        self._next.cancel()
        if self._early:
            self._early.cancel()
        self._epoll.close()

    def schedule_early_poll(self, link: object) -> None:
        """Schedule a poll for when the rest of a frame has arrived; called while a link without a socket receives."""
        if not self._reading and link not in self._early_links:
            self._early_links.add(link)
            if self._early is None and self._is_worth_it(EARLY_POLL_DELAY_S):
                self._early = self._loop.call_later(EARLY_POLL_DELAY_S, self._poll_early)

    def _wake(self, fd: int) -> None:
        """An urgent socket has received; until the next beat it does not wake the loop again."""
        self._unarmed_sockets.add(fd)
        self._loop.remove_reader(fd)
        if self._is_worth_it(0.0):
            self._poll_early()

    def _is_worth_it(self, later_s: float) -> bool:
        """Is a poll after that time early enough before the beat?"""
        return self._beat_s - self._loop.time() - later_s > MIN_EARLY_GAIN_S

    def _poll_sockets(self) -> None:
        more = self._read_all()
        now = self._loop.time()  # read once: the decision on the beat and the next beat must use the same time
        if now >= self._beat_s and not (more and now < self._beat_s + BUSY_POLL_DELAY_S):
            self._beat_s = next_beat(now, BEAT_S)
            self._allow_early()
            for call in tuple(self.calls):
                self._call_safely(call)
        if not self._epoll.closed:  # a callback may close it
            self._plan(more, now)

    def _poll_early(self) -> None:
        if self._early:
            self._early.cancel()  # a socket triggered first
            self._early = None
        if self._read_all():  # remaining frames may be older: the beat hands them on in order
            return
        for call in tuple(self.early_calls):
            self._call_safely(call)

    def _allow_early(self) -> None:
        """Allow one early poll for each link until the next beat."""
        self._early_links.clear()
        for fd in [fd for fd in self._unarmed_sockets if self._urgent[fd]()]:
            self._unarmed_sockets.remove(fd)
            self._loop.add_reader(fd, self._wake, fd)
        if self._early:  # the beat hands its frames on now
            self._early.cancel()
            self._early = None

    def _read_all(self) -> bool:
        """Read every readable socket; true when there may be more."""
        more, self._reading = False, True
        for fd, _ in self._epoll.poll(0):
            if read := self._reads.get(fd):
                more |= bool(self._call_safely(read))
        self._reading = False
        return more

    def _call_safely(self, call: Callable[[], bool | None]) -> bool | None:
        """Call it; an exception of one callback must not stop the others or the beat."""
        try:
            return call()
        except Exception as error:  # noqa: BLE001  reported to the loop's handler, like any callback
            self._loop.call_exception_handler({"message": "polling the sockets", "exception": error})
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
    loop = asyncio.get_running_loop()
    if loop not in _schedulers:
        _schedulers[loop] = BeatScheduler(loop)
    return _schedulers[loop]


def _close_empty() -> None:
    loop = asyncio.get_running_loop()
    if _schedulers[loop].is_empty:
        _schedulers.pop(loop).close()


def watch(fd: int, read: ReadCallback, *, is_early: Callable[[], bool] | None = None) -> None:
    """Call ``read`` with a beat, or early (see ``add``), when the socket is readable; from the running loop."""
    _running_scheduler().add(fd, read, is_early=is_early)


def unwatch(fd: int) -> None:
    """Undo ``watch``, before the socket is closed."""
    _running_scheduler().remove(fd)
    _close_empty()


def schedule_early_poll(link: object) -> None:
    """Schedule an early poll for a link without a socket that receives now, in the running loop."""
    if scheduler := _schedulers.get(asyncio.get_running_loop()):
        scheduler.schedule_early_poll(link)


def add_beat_callbacks(call: Callable[[], None], early: Callable[[], None]) -> None:
    """In the running loop, after the sockets: call ``call`` with every beat, and ``early`` after every early poll."""
    scheduler = _running_scheduler()
    scheduler.calls.append(call)
    scheduler.early_calls.append(early)


def remove_beat_callbacks(call: Callable[[], None], early: Callable[[], None]) -> None:
    """Undo ``add_beat_callbacks``."""
    scheduler = _running_scheduler()
    scheduler.calls.remove(call)
    scheduler.early_calls.remove(early)
    _close_empty()
