"""Numbers, ring and buffers: what arrives before a beat goes on together with it, first into the ring."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.buffers.ring import PAGE, Record, Ring, RingReader
from fti.buffers.triple import TripleBuffer
from fti.burst import entries
from fti.service.intake import FRAME_BYTES, MOST_BYTES, SLOT_NS, Intake

MS = 1_000_000


@pytest.fixture
def ring() -> Iterator[Ring]:
    made = Ring.create(16 * PAGE)
    yield made
    made.close()


def test_what_arrives_before_a_beat_is_numbered_in_order_and_goes_on_with_it(ring: Ring) -> None:
    intake, one, two = Intake(ring), TripleBuffer(), TripleBuffer()
    first, second = intake.sink(0, one), intake.sink(5, two)
    first((b"a", b"bb"), (10, 20))
    second([b"c"], [15])
    first([b"d"], [30])
    assert ring.next_seq == 0
    intake.hand_on()
    frames = [(0, 0, 10, b"a"), (0, 1, 20, b"bb"), (5, 2, 15, b"c"), (0, 3, 30, b"d")]
    assert RingReader(ring).read() == [Record(*frame) for frame in frames]
    assert list(entries(one.take())) == [(0, 10, b"a"), (1, 20, b"bb"), (3, 30, b"d")]
    assert list(entries(two.take())) == [(2, 15, b"c")]


def test_frames_of_different_links_are_numbered_as_they_arrived(ring: Ring) -> None:
    """To 5 ms; the frames of one link stay in their order, and in the bursts that fall into one slot."""
    intake, one, two = Intake(ring), TripleBuffer(), TripleBuffer()
    first, second = intake.sink(0, one), intake.sink(1, two)
    first([b"a", b"b", b"e"], [1 * MS, 2 * MS, 12 * MS])
    second([b"c", b"d"], [4 * MS, 9 * MS])
    first([b"f"], [13 * MS])
    intake.hand_on()
    assert b"".join(record.data for record in RingReader(ring).read()) == b"abcdef"
    assert list(entries(one.take())) == [
        (n, t * MS, d) for n, t, d in ((0, 1, b"a"), (1, 2, b"b"), (4, 12, b"e"), (5, 13, b"f"))
    ]
    assert [seq for seq, _, _ in entries(two.take())] == [2, 3]


@given(
    st.lists(st.tuples(st.integers(0, 2), st.lists(st.integers(0, 4 * SLOT_NS), min_size=1, max_size=8)), max_size=12)
)
def test_every_frame_is_handed_on_once_and_in_order(arrivals: list[tuple[int, list[int]]]) -> None:
    made = Ring.create(16 * PAGE)
    intake, newest = Intake(made), [0, 0, 0]
    buffers = [TripleBuffer() for _ in newest]
    sinks = [intake.sink(n, buffer) for n, buffer in enumerate(buffers)]
    given_to: list[list[tuple[int, bytes]]] = [[] for _ in newest]
    for link, offsets in arrivals:
        times = [newest[link] + offset for offset in sorted(offsets)]
        newest[link] = times[-1]
        frames = [b"%d" % len(given_to[link]) for _ in times]
        given_to[link] += zip(times, frames, strict=True)
        sinks[link](frames, times)
    intake.hand_on()
    records = RingReader(made).read()
    assert [record.seq for record in records] == list(range(intake.seq))
    slots = [record.t_rx_ns // SLOT_NS for record in records]
    assert slots == sorted(slots)
    for link, buffer in enumerate(buffers):
        assert [(r.t_rx_ns, r.data) for r in records if r.link_index == link] == given_to[link]
        assert [entry[1:] for entry in entries(buffer.take())] == given_to[link]
    made.close()


@pytest.mark.parametrize("size", [0, 1000])
def test_much_does_not_wait_for_the_beat(ring: Ring, size: int) -> None:
    """Nor do many frames without a byte: each costs memory, too."""
    intake = Intake(ring)
    sink, waiting = intake.sink(0, TripleBuffer()), 0
    while ring.next_seq == 0:
        sink([bytes(size)], [waiting])
        waiting += 1
    assert waiting == -(-MOST_BYTES // (size + FRAME_BYTES))


def test_who_asks_for_the_number_finds_all_before_it_in_their_buffers(ring: Ring) -> None:
    intake, buffer = Intake(ring), TripleBuffer()
    sink = intake.sink(0, buffer)
    sink([b"a"], [1])
    assert intake.seq == 1 == ring.next_seq == buffer.stats.frames_in
    sink([b"b"], [2])
    assert intake.seq == 2 == buffer.stats.frames_in


def test_the_ring_comes_first(ring: Ring, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recorder that is killed in between leaves no number in a file that the next one would give again."""
    intake, buffer = Intake(ring), TripleBuffer()
    sink = intake.sink(0, buffer)
    put, seen = buffer.put_many, list[int]()

    def look(*share: Any) -> None:
        seen.append(ring.next_seq)
        put(*share)

    monkeypatch.setattr(buffer, "put_many", look)
    sink([b"a", b"b"], [1, 2])
    intake.hand_on()
    assert seen == [2]


def test_numbers_go_on_where_the_last_recorder_ended(ring: Ring) -> None:
    before = Intake(ring)
    before.sink(0, TripleBuffer())([b"a", b"b"], [1, 2])
    before.hand_on()
    after = Intake(ring)
    assert after.seq == 2
    after.hand_on()  # nothing has come: nothing happens
    assert ring.next_seq == 2
