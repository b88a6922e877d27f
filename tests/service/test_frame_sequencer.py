"""Numbers, ring and buffers: what arrives before a beat goes on together with it, first into the ring."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.buffers.ring import PAGE, EntryKind, Ring
from fti.buffers.ring_reader import RingFrame, RingReader
from fti.buffers.triple_buffer import TripleBuffer
from fti.frame_batch import iter_frames
from fti.service.recorder.frame_sequencer import (
    FRAME_BYTES,
    MAX_MERGED,
    MAX_SORTED_FRAMES,
    MAX_WAITING_BYTES,
    FrameSequencer,
)


@pytest.fixture
def ring() -> Iterator[Ring]:
    result = Ring.create(16 * PAGE)
    yield result
    result.close()


def at_once(call: Callable[[], object]) -> None:
    """All that there is has been read already."""
    call()


def test_what_arrives_before_a_beat_is_numbered_as_it_arrived_and_goes_on_with_it(ring: Ring) -> None:
    sequencer, one, two = FrameSequencer(ring, at_once), TripleBuffer(), TripleBuffer()
    first, second = sequencer.sink(EntryKind.RECEIVED, 0, one), sequencer.sink(EntryKind.SENT, 0, two)
    first((b"a", b"cc"), (10, 20))
    second([b"b"], [15])
    first([b"d"], [30])
    assert ring.next_seq == 0
    sequencer.flush()
    received, sent = EntryKind.RECEIVED, EntryKind.SENT
    frames = [(received, 0, b"a"), (sent, 1, b"b"), (received, 2, b"cc"), (received, 3, b"d")]
    times = (10, 15, 20, 30)
    found = RingReader(ring).read()
    assert found == [RingFrame(kind, 0, n, t, data) for (kind, n, data), t in zip(frames, times, strict=True)]
    assert list(iter_frames(one.take())) == [(0, 10, b"a"), (2, 20, b"cc"), (3, 30, b"d")]
    assert list(iter_frames(two.take())) == [(1, 15, b"b")]


def test_what_a_link_brings_piece_by_piece_is_one_burst_up_to_a_limit(ring: Ring) -> None:
    sequencer, buffer = FrameSequencer(ring, at_once), TripleBuffer()
    sink = sequencer.sink(EntryKind.RECEIVED, 0, buffer)
    for n in range(MAX_MERGED + 1):
        sink([b"x"], [n])
    sink([b"y"] * (2 * MAX_MERGED), [MAX_MERGED + 1] * (2 * MAX_MERGED))  # not divided
    sequencer.flush()
    assert [len(frames) for _, _, frames, _ in buffer.take()] == [MAX_MERGED, 1, 2 * MAX_MERGED]
    sink([b"z"], [1000])
    sequencer.flush()
    assert [frames for _, _, frames, _ in buffer.take()][-1] == [b"z"]


arrivals = st.lists(st.tuples(st.integers(0, 2), st.lists(st.integers(0, 50), min_size=1, max_size=8)), max_size=12)


@given(arrivals, st.sampled_from((1, 1, 60)))
def test_every_frame_is_handed_on_once_and_in_order(arrived: list[tuple[int, list[int]]], times_as_much: int) -> None:
    """Always within a link; between links, too, except in a flood."""
    result = Ring.create(1024 * PAGE)
    sequencer, newest = FrameSequencer(result, at_once), [0, 0, 0]
    buffers = [TripleBuffer() for _ in newest]
    sinks = [sequencer.sink(EntryKind.RECEIVED, n, buffer) for n, buffer in enumerate(buffers)]
    given_to: list[list[tuple[int, bytes]]] = [[] for _ in newest]
    for link, offsets in arrived:
        times = [newest[link] + offset for offset in sorted(offsets * times_as_much)]
        newest[link] = times[-1]
        frames = [b"%d" % (len(given_to[link]) + n) for n in range(len(times))]
        given_to[link] += zip(times, frames, strict=True)
        sinks[link](frames, times)
    sequencer.flush()
    records = RingReader(result).read(10_000)
    assert [record.seq for record in records] == list(range(sequencer.flush()))
    if len(records) <= MAX_SORTED_FRAMES:
        assert [r.t_rx_ns for r in records] == sorted(r.t_rx_ns for r in records)
    of_link = [[r for r in records if r.link_index == link] for link in range(len(buffers))]
    for buffer, received, expected in zip(buffers, of_link, given_to, strict=True):
        assert [(r.t_rx_ns, r.data) for r in received] == expected
        assert list(iter_frames(buffer.take())) == [(r.seq, r.t_rx_ns, r.data) for r in received]
    result.close()


@pytest.mark.parametrize("size", [0, 1000])
def test_much_does_not_wait_for_the_beat(ring: Ring, size: int) -> None:
    """Nor do many frames without a byte: each costs memory, too."""
    sequencer = FrameSequencer(ring, at_once)
    sink, waiting = sequencer.sink(EntryKind.RECEIVED, 0, TripleBuffer()), 0
    while ring.next_seq == 0:
        sink([bytes(size)], [waiting])
        waiting += 1
    assert waiting == -(-MAX_WAITING_BYTES // (size + FRAME_BYTES))


def test_much_waits_until_every_socket_has_been_read(ring: Ring) -> None:
    """Else what the second socket has had for longer would get a later number."""
    later: list[Callable[[], object]] = []
    sequencer = FrameSequencer(ring, later.append)
    camera, attitude = (sequencer.sink(EntryKind.RECEIVED, link, TripleBuffer()) for link in range(2))
    for _ in range(2):
        camera([b""] * (MAX_WAITING_BYTES // FRAME_BYTES), [100] * (MAX_WAITING_BYTES // FRAME_BYTES))
    attitude([b"a"], [1])
    assert ring.next_seq == 0
    assert len(later) == 1
    later[0]()
    assert sequencer.flush() == ring.next_seq == 2 * (MAX_WAITING_BYTES // FRAME_BYTES) + 1


def test_what_a_stall_has_held_back_is_numbered_as_it_arrived(ring: Ring) -> None:
    """However much it is: a frame of one link would else stand half a second before what it belongs to."""
    sequencer = FrameSequencer(ring, at_once)
    sinks = [sequencer.sink(EntryKind.RECEIVED, n, TripleBuffer()) for n in range(3)]
    for n, sink in enumerate(sinks):
        sink([b"x"] * MAX_SORTED_FRAMES, [(10 * i + n) * 1_000_000 for i in range(MAX_SORTED_FRAMES)])
    sequencer.flush()
    times = [record.t_rx_ns for record in RingReader(ring).read(10_000)]
    assert len(times) == 3 * MAX_SORTED_FRAMES
    assert times == sorted(times)


def test_who_asks_for_the_number_finds_all_before_it_in_their_buffers(ring: Ring) -> None:
    sequencer, buffer = FrameSequencer(ring, at_once), TripleBuffer()
    sink = sequencer.sink(EntryKind.RECEIVED, 0, buffer)
    sink([b"a"], [1])
    assert sequencer.flush() == 1 == ring.next_seq == buffer.stats.frames_in
    sink([b"b"], [2])
    assert sequencer.flush() == 2 == buffer.stats.frames_in


def test_the_ring_comes_first(ring: Ring, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recorder that is killed in between leaves no number in a file that the next one would give again."""
    sequencer, buffer = FrameSequencer(ring, at_once), TripleBuffer()
    sink = sequencer.sink(EntryKind.RECEIVED, 0, buffer)
    put, next_seqs = buffer.put_batch, list[int]()

    def put_and_record(*share: Any) -> None:
        next_seqs.append(ring.next_seq)
        put(*share)

    monkeypatch.setattr(buffer, "put_batch", put_and_record)
    sink([b"a", b"b"], [1, 2])
    sequencer.flush()
    assert next_seqs == [2]


def test_numbers_go_on_where_the_last_recorder_ended(ring: Ring) -> None:
    before = FrameSequencer(ring, at_once)
    before.sink(EntryKind.RECEIVED, 0, TripleBuffer())([b"a", b"b"], [1, 2])
    before.flush()
    after = FrameSequencer(ring, at_once)
    assert after.flush() == 2
    after.flush()  # nothing has come: nothing happens
    assert ring.next_seq == 2
