"""Triple buffer: no loss while frames fit, then the oldest are dropped; the account is exact; no blocking."""

from __future__ import annotations

import math
import random
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from fti.buffers.triple_buffer import TripleBuffer
from fti.frame_batch import NumberedFrame, iter_frames


def flush(buffer: TripleBuffer) -> list[NumberedFrame]:
    frames: list[NumberedFrame] = []
    while not buffer.is_empty:
        frames += iter_frames(buffer.take())
        buffer.confirm_written()
    return frames


def take(buffer: TripleBuffer) -> list[NumberedFrame]:
    return list(iter_frames(buffer.take()))


def test_entries_come_out_as_they_went_in() -> None:
    buffer = TripleBuffer(1000)
    for i in range(10):
        buffer.put(i, 100 * i, bytes([i]) * i)
    assert flush(buffer) == [(i, 100 * i, bytes([i]) * i) for i in range(10)]
    assert buffer.take() == []


def test_what_storage_refused_comes_again_first() -> None:
    buffer = TripleBuffer(1000)
    buffer.put(1, 0, b"a")
    assert [e[0] for e in take(buffer)] == [1]
    buffer.put(2, 0, b"b")
    assert [e[0] for e in take(buffer)] == [1, 2]
    buffer.confirm_written(1)
    assert [e[0] for e in take(buffer)] == [2]
    buffer.confirm_written()
    assert buffer.is_empty


def test_write_queue_is_bounded_too() -> None:
    buffer = TripleBuffer(100)
    for i in range(9):
        buffer.put(i, 0, bytes(12))
    assert len(take(buffer)) == 5
    assert len(take(buffer)) == 5
    assert buffer.stats.dropped_frames == 0


def test_writer_is_called_at_the_threshold_once_per_take() -> None:
    calls: list[int] = []
    buffer = TripleBuffer(1000, threshold=0.5, on_ready=lambda: calls.append(1))
    for i in range(4):
        buffer.put(i, 0, bytes(92))
    assert not buffer.is_ready
    for i in range(4):
        buffer.put(i, 0, bytes(92))
    assert buffer.is_ready
    assert len(calls) == 1
    flush(buffer)
    for i in range(5):
        buffer.put(i, 0, bytes(92))
    assert len(calls) == 2


def test_stall_that_is_survived() -> None:
    """T10 (Spiegel 2018, eq. 6.2): 2^19 B, 100 Hz, 66 B in two receptions: 121.5 s."""
    assert TripleBuffer(2**19).capacity_s(100, 66, 2) == pytest.approx(121.5, abs=0.05)
    assert TripleBuffer(2**19).capacity_s(200, 33) == pytest.approx(121.5, abs=0.05)


def test_stalled_storage_loses_nothing_for_that_long_and_then_the_oldest() -> None:
    """T10 with the same bytes, faster: storage stops accepting with the write queue full of older data."""
    buffer = TripleBuffer(2**19)
    rate, first = 200, 1000
    for seq in range(first):
        buffer.put(seq, 0, bytes(33))
    stuck = take(buffer)  # the call to storage does not return
    survived = math.floor(buffer.capacity_s(100, 66, 2) * 100) * 2
    assert survived / rate == pytest.approx(121.48)
    for seq in range(first, first + survived):
        buffer.put(seq, seq, bytes(33))
    assert buffer.stats.dropped_frames == 0
    extra = 500
    for seq in range(first + survived, first + survived + extra):
        buffer.put(seq, seq, bytes(33))
    stats = buffer.stats
    assert stats.dropped_frames == extra
    assert stats.global_ == pytest.approx(1.0, abs=1e-4)
    assert stats.receive == pytest.approx(0.9, abs=1e-4)
    buffer.confirm_written()
    seqs = [e[0] for e in stuck] + [e[0] for e in flush(buffer)]
    (span,) = stats.drops
    missing = sorted(set(range(first + survived + extra)) - set(seqs))
    assert missing == list(range(span.first_seq, span.last_seq + 1))
    assert (span.frames, span.bytes) == (extra, extra * 33)
    assert (span.first_t_ns, span.last_t_ns) == (span.first_seq, span.last_seq)
    # what global held when it was full is older and stays: what goes is the oldest that has not been handed over
    assert span.first_seq == first + 2**19 // 41
    assert seqs[-1] == first + survived + extra - 1


def test_two_stalls_are_two_spans() -> None:
    buffer = TripleBuffer(100)
    for turn in (0, 100):
        for seq in range(turn, turn + 20):
            buffer.put(seq, seq, bytes(12))
        flush(buffer)
    first, second = buffer.stats.drops
    assert first.last_seq < 100 <= second.first_seq
    assert first.frames + second.frames == buffer.stats.dropped_frames


def test_many_stalls_are_reported_in_a_bounded_list() -> None:
    buffer = TripleBuffer(100)
    for turn in range(200):
        for seq in range(20 * turn, 20 * turn + 20):
            buffer.put(seq, seq, bytes(12))
        flush(buffer)
    drops = buffer.stats.drops
    assert len(drops) == 64
    assert sum(d.frames for d in drops) == buffer.stats.dropped_frames
    assert drops[-1].last_seq > 20 * 199


def test_frame_larger_than_the_buffer_is_kept() -> None:
    buffer = TripleBuffer(100)
    buffer.put(0, 0, bytes(10))
    buffer.put(1, 0, bytes(500))
    assert [len(e[2]) for e in flush(buffer)] == [10, 500]


def test_reader_does_not_wait_for_a_held_global_queue() -> None:
    buffer = TripleBuffer(1000)
    with buffer._global.lock:
        buffer.put(0, 0, b"x")
        assert buffer.take() == []
    assert buffer.stats.receive > 0
    assert [e[0] for e in take(buffer)] == [0]  # also when no further put moves it on


def test_held_global_queue_costs_frames_only_when_receive_is_full() -> None:
    buffer = TripleBuffer(100)
    with buffer._global.lock:
        for seq in range(5):
            buffer.put(seq, 0, bytes(12))
        assert buffer._dropped_frames == 0
        buffer.put(5, 0, bytes(12))
        assert buffer._dropped_frames == 1
    assert [e[0] for e in flush(buffer)] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("values", [{"capacity_bytes": 0}, {"threshold": 0.0}, {"threshold": 1.1}])
def test_senseless_sizes_are_refused(values: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be > 0 and"):
        TripleBuffer(**values)  # type: ignore[arg-type]


def test_senseless_rates_are_refused() -> None:
    with pytest.raises(ValueError, match="positive"):
        TripleBuffer().capacity_s(0, 66)


class Account(RuleBasedStateMachine):
    """Any order of calls: in = out + dropped + held, order kept, the newest kept, queues bounded."""

    def __init__(self) -> None:
        super().__init__()
        self.capacity = 200
        self.buffer = TripleBuffer(self.capacity)
        self.seq = 0
        self.taken: list[NumberedFrame] = []
        self.out: list[int] = []

    @rule(size=st.integers(0, 60), count=st.integers(1, 30))
    def put(self, size: int, count: int) -> None:
        for _ in range(count):
            self.buffer.put(self.seq, self.seq, bytes(size))
            self.seq += 1

    @rule()
    def take(self) -> None:
        before = self.taken
        self.taken = take(self.buffer)
        assert self.taken[: len(before)] == before

    @rule()
    def confirm_written(self) -> None:
        self.buffer.confirm_written()
        self.out += [e[0] for e in self.taken]
        self.taken = []

    @invariant()
    def account_closes(self) -> None:
        stats = self.buffer.stats
        assert stats.frames_in == self.seq == stats.frames_out + stats.dropped_frames + stats.frames_held
        assert stats.bytes_in == stats.bytes_out + stats.dropped_bytes + stats.bytes_held
        assert stats.frames_out == len(self.out)
        assert max(stats.receive, stats.global_, stats.write) <= 1

    def teardown(self) -> None:
        newest = self.seq - 1
        rest = [e[0] for e in flush(self.buffer)]
        found = self.out + rest
        assert found == sorted(set(found))
        assert not self.seq or found[-1] == newest
        dropped = sum(d.frames for d in self.buffer.stats.drops)
        assert len(found) + dropped == self.seq


TestAccount = Account.TestCase


@given(st.lists(st.integers(0, 100), max_size=40))
def test_nothing_goes_while_it_fits(sizes: list[int]) -> None:
    buffer = TripleBuffer(sum(size + 8 for size in sizes) + 1)
    for seq, size in enumerate(sizes):
        buffer.put(seq, 0, bytes(size))
    assert [len(e[2]) for e in flush(buffer)] == sizes


def test_two_threads_hammer_it() -> None:
    """Reader and writer at full speed, a third asks for the account: order kept, account closed."""
    buffer = TripleBuffer(4096)
    frames, out, done = 30_000, list[int](), threading.Event()

    def read() -> None:
        for seq in range(frames):
            buffer.put(seq, seq, bytes(seq % 50))
        done.set()

    def write() -> None:
        dice = random.Random(1)
        while not (done.is_set() and buffer.is_empty):
            frame_batches = buffer.take()
            if dice.random() < 0.9:  # else storage refuses
                buffer.confirm_written(len(frame_batches))
                out.extend(e[0] for e in iter_frames(frame_batches))

    threads = [threading.Thread(target=read), threading.Thread(target=write)]
    for thread in threads:
        thread.start()
    while not done.is_set():
        stats = buffer.stats
        assert stats.frames_in == stats.frames_out + stats.dropped_frames + stats.frames_held
    for thread in threads:
        thread.join()
    assert out == sorted(set(out))
    assert out[-1] == frames - 1
    assert len(out) + buffer.stats.dropped_frames == frames


@given(
    st.lists(
        st.tuples(st.lists(st.integers(0, 60), min_size=1, max_size=30), st.integers(0, 3)), min_size=1, max_size=20
    )
)
def test_together_is_as_one_by_one(batches: list[tuple[list[int], int]]) -> None:
    """What arrives together is kept and dropped as if it had come one by one, also while storage stands still."""
    together, single = TripleBuffer(300), TripleBuffer(300)
    seq = 0
    out: tuple[list[NumberedFrame], list[NumberedFrame]] = [], []
    for sizes, turn in batches:
        frames, times = [bytes(size) for size in sizes], list(range(seq, seq + len(sizes)))
        together.put_many(seq, times, frames)
        for i, frame in enumerate(frames):
            single.put(seq + i, seq + i, frame)
        seq += len(sizes)
        for buffer, seqs in zip((together, single), out, strict=True):
            if turn:
                results = take(buffer)
                if turn == 2:  # storage accepts
                    buffer.confirm_written()
                    seqs.extend(results)
        assert together.stats == single.stats
    assert out[0] == out[1]
    assert flush(together) == flush(single)


def test_a_row_of_drops_is_handed_out_once_when_it_has_ended() -> None:
    buffer = TripleBuffer(100)
    for seq in range(20):
        buffer.put(seq, 10 * seq, bytes(12))
    assert buffer.take_drops() == []
    flush(buffer)
    (span,) = buffer.take_drops()
    assert (span.frames, span.bytes) == (buffer.stats.dropped_frames, 12 * buffer.stats.dropped_frames)
    assert (span.first_t_ns, span.last_t_ns) == (10 * span.first_seq, 10 * span.last_seq)
    assert buffer.take_drops(final=True) == []
    for seq in range(20, 40):
        buffer.put(seq, seq, bytes(12))
    (last,) = buffer.take_drops(final=True)
    assert span.frames + last.frames == buffer.stats.dropped_frames
    buffer.put(40, 40, bytes(12))  # drops after a final take form a new span
    assert len(buffer.take_drops(final=True)) == 1


def test_drops_are_not_waited_for() -> None:
    buffer = TripleBuffer(100)
    for seq in range(20):
        buffer.put(seq, seq, bytes(12))
    flush(buffer)
    with buffer._receive.lock:
        assert buffer.take_drops() == []
    assert len(buffer.take_drops()) == 1
