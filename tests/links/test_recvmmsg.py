"""Many datagrams with one call: complete, with own stamp, sender and flags, without data of the previous call."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Iterator

import pytest

from fti.links._recvmmsg import MAX_DATAGRAMS, NO_STAMP, ReceiveBatch
from fti.links.sockets import SO_RCVBUFFORCE, prepare


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Who receives, and who sends."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        receiver.bind(("127.0.0.1", 0))
        prepare(receiver)
        sender.bind(("127.0.0.1", 0))
        sender.connect(receiver.getsockname())
        yield receiver, sender


Pair = tuple[socket.socket, socket.socket]


@pytest.mark.parametrize("step", [0, 17])
@pytest.mark.parametrize("count", [1, 2, MAX_DATAGRAMS])
def test_each_has_its_bytes_and_its_stamp(pair: Pair, count: int, step: int) -> None:
    receiver, sender = pair
    batch, sent = ReceiveBatch(), [bytes([i]) * (9 + step * i) for i in range(count)]
    before = time.time_ns()
    for data in sent:
        sender.send(data)
    after = time.time_ns()
    assert batch.receive(receiver.fileno()) == count
    assert list(batch.frames()) == sent
    stamps = batch.stamps()
    assert len(stamps) == count
    assert stamps == sorted(stamps)
    assert before <= stamps[0] <= stamps[-1] <= after
    assert list(batch.flags()) == [0] * count
    assert batch.drops() is None


def test_nothing_is_not_an_error(pair: Pair) -> None:
    batch = ReceiveBatch()
    assert batch.receive(pair[0].fileno()) == 0
    assert batch.receive(pair[0].fileno()) == 0


def test_more_than_a_batch_comes_with_the_next_calls(pair: Pair) -> None:
    receiver, sender = pair
    batch, sent = ReceiveBatch(), [i.to_bytes(2, "little") for i in range(2 * MAX_DATAGRAMS + 3)]
    for data in sent:
        sender.send(data)
    found, counts = list[bytes](), list[int]()
    while count := batch.receive(receiver.fileno()):
        counts.append(count)
        found += batch.frames()
    assert found == sent
    assert counts == [MAX_DATAGRAMS, MAX_DATAGRAMS, 3]


def test_the_largest_datagrams_are_whole(pair: Pair) -> None:
    receiver, sender = pair
    batch, sent = ReceiveBatch(), [bytes([i]) * (65507 - i) for i in range(8)]
    for data in sent:
        sender.send(data)
    assert batch.receive(receiver.fileno()) == len(sent)
    assert list(batch.frames()) == sent
    assert not any(flags & socket.MSG_TRUNC for flags in batch.flags())


def test_senders_are_distinguished(pair: Pair) -> None:
    receiver, sender = pair
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.2", 0))
        sender.send(b"a")
        other.sendto(b"b", receiver.getsockname())
        sender.send(b"c")
        batch = ReceiveBatch()
        assert batch.receive(receiver.fileno()) == 3
        assert [name[4:8] for name in batch.senders()] == [bytes([127, 0, 0, n]) for n in (1, 2, 1)]
        ports = [int.from_bytes(name[2:4], "big") for name in batch.senders()]
        assert ports == [sock.getsockname()[1] for sock in (sender, other, sender)]


def test_a_socket_without_stamps_gets_none_of_the_socket_before(pair: Pair) -> None:
    receiver, sender = pair
    batch = ReceiveBatch()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bare:
        bare.bind(("127.0.0.1", 0))
        for _ in range(3):
            sender.send(b"x")
            sender.sendto(b"y", bare.getsockname())
        assert batch.receive(receiver.fileno()) == 3
        assert min(batch.stamps()) > 0
        assert batch.receive(bare.fileno()) == 3
        assert list(batch.frames()) == [b"y"] * 3
        assert batch.stamps(10) == [NO_STAMP] * 3


def test_what_the_kernel_dropped_before_a_datagram(pair: Pair) -> None:
    receiver, sender = pair
    receiver.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 5000)
    for _ in range(300):
        sender.send(bytes(100))
    batch, found = ReceiveBatch(), 0
    while count := batch.receive(receiver.fileno()):
        found += count
    sender.send(b"next")
    assert batch.receive(receiver.fileno()) == 1
    assert batch.drops() == 300 - found > 0


def test_what_is_no_socket_is_an_error() -> None:
    read_end, write_end = os.pipe()
    with pytest.raises(OSError, match="Socket operation on non-socket"):
        ReceiveBatch().receive(read_end)
    os.close(read_end)
    os.close(write_end)
