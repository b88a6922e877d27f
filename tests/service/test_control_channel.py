"""The control channel: complete messages in order, without blocking, and detection of the other side's end."""

import socket
from concurrent.futures import ThreadPoolExecutor

from hypothesis import given
from hypothesis import strategies as st

from fti.service.control_channel import MAX_PENDING_BYTES, ControlChannel, make_memory_file, read_memory_file
from tests.helpers import until


def _pair() -> tuple[ControlChannel, ControlChannel]:
    left, right = socket.socketpair()
    return ControlChannel(left), ControlChannel(right)


@given(st.lists(st.dictionaries(st.text(), st.integers() | st.text() | st.none(), max_size=5), max_size=20))
def test_messages_arrive_whole_and_in_order(messages: list[dict[str, object]]) -> None:
    left, right = _pair()
    for message in messages:
        assert left.send(message)
    assert right.receive() == messages
    left.close()
    right.close()


def test_a_reader_that_does_not_read_costs_no_time_and_bounded_memory() -> None:
    left, right = _pair()
    sent = 0
    while left.send({"n": sent, "text": "x" * 10_000}):
        sent += 1
        assert sent * 10_000 < 8 * MAX_PENDING_BYTES
    assert left.send({"n": sent}, is_kept=True), "what is sent once still waits"
    assert not left.send({"n": -1})
    found: list[dict[str, object]] = []
    while len(found) <= sent and not right.has_ended:
        found += right.receive()
        left.flush()
    assert [m["n"] for m in found] == list(range(sent + 1))
    left.close()
    right.close()


def test_the_end_of_the_other_side_is_seen_after_its_last_word() -> None:
    left, right = _pair()
    left.send({"last": True})
    left.close()
    assert right.receive() == [{"last": True}]
    right.receive()
    assert right.has_ended
    assert not right.send({"anyone": "there"})
    right.close()


def test_a_memory_file_carries_any_amount() -> None:
    data = bytes(range(256)) * 40_000
    assert read_memory_file(make_memory_file("test", data)) == data


def test_the_last_messages_of_the_other_side_are_received_though_sending_fails() -> None:
    left, right = _pair()
    right.send({"last": "words"})
    right.close()
    assert not left.send({"who": "is there"})
    assert left.receive() == [{"last": "words"}]
    assert left.has_ended
    left.close()


def test_threads_do_not_tear_each_others_messages() -> None:
    """The socket is small, so that nearly every message is handed over in pieces."""
    left, right = socket.socketpair()
    left.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2048)
    sender, receiver = ControlChannel(left), ControlChannel(right)
    found: list[dict[str, object]] = []
    with ThreadPoolExecutor(3) as pool:
        jobs = [pool.submit(_send_many, sender, who) for who in range(3)]
        until(lambda: _received(receiver, sender, found) == 900, what="900 messages")
        for job in jobs:
            job.result()
    for who in range(3):
        assert [m["n"] for m in found if m["who"] == who] == list(range(300))
    sender.close()
    receiver.close()


def _send_many(sender: ControlChannel, who: int) -> None:
    for n in range(300):
        assert sender.send({"who": who, "n": n, "text": "x" * 500})


def _received(receiver: ControlChannel, sender: ControlChannel, found: list[dict[str, object]]) -> int:
    sender.flush()
    found += receiver.receive()
    return len(found)
