"""Stamps of one socket never decrease, for any stamps and clocks of the kernel."""

from __future__ import annotations

import socket
from collections.abc import Iterator, Sequence

import pytest

from fti.clock import FakeClock, StampWindow
from fti.links._recvmmsg import MAX_DATAGRAMS
from fti.links.base import LinkStatus
from fti.links.sockets import Arrival, prepare

NOW = 10**18
MS = 1_000_000


class Windows(FakeClock):
    """A clock whose windows are given."""

    def __init__(self, *windows: StampWindow) -> None:
        super().__init__(NOW)
        self._windows = iter(windows)
        self.window_starts: list[int] = []

    def stamp_window(self, since_ns: int) -> StampWindow:
        self.window_starts.append(since_ns)
        return next(self._windows)


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    a, b = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with a, b:
        b.setblocking(False)
        yield a, b


def read(arrival: Arrival, pair: tuple[socket.socket, socket.socket], stamps: list[int]) -> Sequence[int]:
    """Times of a batch with these stamps."""
    for _ in stamps:
        pair[0].send(b"x")
    arrival.batch.stamps = lambda offset_ns=0: [stamp + offset_ns for stamp in stamps]  # type: ignore[method-assign]
    try:
        return arrival.read(pair[1].fileno())[1]
    finally:
        del arrival.batch.stamps


def test_a_refused_stamp_is_not_later_than_the_accepted_one_behind_it(
    pair: tuple[socket.socket, socket.socket],
) -> None:
    """After a step some of a batch are from before it."""
    status = LinkStatus()
    arrival = Arrival(Windows(StampWindow(0, NOW - 10 * MS, NOW)), status)
    stamps = [NOW - 3600_000 * MS, NOW - 8 * MS, NOW - 3600_000 * MS, NOW - 5 * MS, NOW + 7200_000 * MS]
    assert read(arrival, pair, stamps) == [NOW - 8 * MS, NOW - 8 * MS, NOW - 5 * MS, NOW - 5 * MS, NOW]
    assert status.stamp_refused == 3


def test_a_batch_does_not_begin_before_the_end_of_the_last(pair: tuple[socket.socket, socket.socket]) -> None:
    """The clocks were read 10 us apart for the first, or its stamps were refused."""
    first, second = StampWindow(10_000, 0, NOW), StampWindow(0, 0, NOW)
    arrival = Arrival(Windows(first, second), LinkStatus())
    assert read(arrival, pair, [NOW - 5 * MS, NOW - 4 * MS])[-1] == NOW - 4 * MS + 10_000
    assert read(arrival, pair, [NOW - 4 * MS + 2000, NOW - 3 * MS]) == [NOW - 4 * MS + 10_000, NOW - 3 * MS]


def test_stamps_of_two_processors_keep_the_order_of_the_queue(pair: tuple[socket.socket, socket.socket]) -> None:
    status = LinkStatus()
    arrival = Arrival(Windows(StampWindow(0, 0, NOW)), status)
    assert read(arrival, pair, [NOW - 9, NOW - 5, NOW - 7, NOW - 2]) == [NOW - 9, NOW - 5, NOW - 5, NOW - 2]
    assert status.stamp_refused == 0


def test_a_stamp_may_be_as_old_as_the_last_frame_that_was_read(pair: tuple[socket.socket, socket.socket]) -> None:
    """However long nobody reads: a queue hands out in order."""
    clock = Windows(StampWindow(0, 0, NOW), StampWindow(0, 0, NOW))
    arrival = Arrival(clock, LinkStatus())
    clock.advance(130)
    read(arrival, pair, [NOW - 5 * MS, NOW - 4 * MS])
    read(arrival, pair, [NOW - 3 * MS])
    assert clock.window_starts == [NOW, NOW - 4 * MS]


def test_the_age_is_counted_from_when_the_queue_was_seen_empty() -> None:
    """A device that speaks once a minute: a step of half a minute ago casts no doubt on its next stamp."""
    clock = Windows(StampWindow(0, 0, 2 * NOW))
    arrival = Arrival(clock, LinkStatus())
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock,
    ):
        sock.bind(("127.0.0.1", 0))
        prepare(sock)
        clock.advance(30)
        arrival.ask_drops(sock)
        sender.sendto(b"waits", sock.getsockname())
        clock.advance(30)
        arrival.ask_drops(sock)
        assert list(arrival.read(sock.fileno())[0]) == [b"waits"]
    assert clock.window_starts == [NOW + 30_000 * MS]


def test_refused_stamps_before_good_ones_that_still_wait_do_not_move_those(
    pair: tuple[socket.socket, socket.socket],
) -> None:
    """A step in the middle of a long pause: a full batch from before it, and behind it what came after."""
    status = LinkStatus()
    window = StampWindow(0, NOW - 60_000 * MS, NOW)
    clock = Windows(window, window)
    clock.advance(-60)
    arrival = Arrival(clock, status)
    clock.advance(60)
    before = read(arrival, pair, [NOW - 3600_000 * MS] * MAX_DATAGRAMS)
    after = [NOW - 50_000 * MS + i * MS for i in range(MAX_DATAGRAMS // 2)]
    assert read(arrival, pair, after) == after
    assert list(before) == sorted(before)
    assert status.stamp_refused == MAX_DATAGRAMS
