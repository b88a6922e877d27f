"""Ring between processes: it never waits, counts what was overwritten, and survives kill -9 of either side."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fti.buffers.ring import PAGE, SINGLE_FRAME_BYTES, EntryKind, ReaderState, Ring, pack_source, ring_size
from fti.buffers.ring_reader import RingFrame, RingReader
from fti.config import CanLink, SerialLink, UdpLink
from tests.helpers import ROOT, until


@pytest.fixture
def ring() -> Iterator[Ring]:
    result = Ring.create(4 * PAGE)
    yield result
    result.close()


def payload(seq: int) -> bytes:
    """Data of the frame with this number, so that a mix-up is detected."""
    return seq.to_bytes(4, "little") * (seq % 40)


def entry(seq: int) -> RingFrame:
    """The entry with this number: every kind on every link."""
    return RingFrame(EntryKind(seq % 3), seq % 7, seq, seq * 10, payload(seq))


def put(ring: Ring, *numbers: int) -> None:
    for seq in numbers:
        ring.put_many([pack_source(EntryKind(seq % 3), seq % 7)], seq, [seq * 10], [payload(seq)])


def check(records: list[RingFrame]) -> list[int]:
    for record in records:
        assert record == entry(record.seq)
    return [record.seq for record in records]


def reader_of_all(ring: Ring) -> RingReader:
    """A reader that stands at the oldest frame, as one that has just not been overrun."""
    assert ring.oldest_seq is not None
    ring.publish_reader(ReaderState(ring.writer_state().oldest, ring.oldest_seq, ring.oldest_seq))
    return RingReader(ring)


def test_frames_come_out_as_they_went_in(ring: Ring) -> None:
    reader = RingReader(ring)
    assert reader.read() == []
    put(ring, 5, 6, 7)
    assert check(reader.read(2)) == [5, 6]
    assert ring.lag_bytes == 3 * SINGLE_FRAME_BYTES + sum(len(payload(s)) for s in (5, 6, 7))
    assert check(reader.read(2)) == [7]
    assert reader.read() == []
    assert (reader.lost_frames, ring.lag_bytes, ring.oldest_seq, ring.next_seq) == (0, 0, 5, 8)


@settings(max_examples=30)
@given(st.lists(st.tuples(st.integers(0, 300), st.integers(0, 60)), min_size=1, max_size=30))
def test_every_frame_is_read_or_counted(turns: list[tuple[int, int]]) -> None:
    """Any rhythm of writing, reading and skipping (where nothing is read), several times around the ring."""
    ring = Ring.create(2 * PAGE)
    reader, seq, found, missing = RingReader(ring), 0, list[int](), 0
    for written, read in turns:
        put(ring, *range(seq, seq + written))
        seq += written
        waiting, lost = seq - reader.next_seq, reader.lost_frames
        records = check(reader.read(read)) if read else []
        skipped = reader.skip() if not read else waiting if not records else 0
        assert reader.lost_frames == lost + skipped
        assert skipped in {0, waiting}
        found += records
        missing += skipped
    while records := check(reader.read()):
        found += records
    ring.close()
    assert found == sorted(set(found))
    assert len(found) + reader.lost_frames == seq == reader.next_seq
    assert reader.lost_frames >= missing


@settings(max_examples=30)
@given(st.lists(st.tuples(st.integers(1, 64), st.integers(0, 100)), min_size=1, max_size=40))
def test_frames_that_are_put_together_are_read_one_by_one(turns: list[tuple[int, int]]) -> None:
    ring = Ring.create(4 * PAGE)
    reader, seq, found = RingReader(ring), 0, list[int]()
    for count, read in turns:
        numbers = range(seq, seq + count)
        sources = [pack_source(EntryKind(n % 3), n % 7) for n in numbers]
        ring.put_many(sources, seq, [10 * n for n in numbers], [payload(n) for n in numbers])
        seq += count
        for record in reader.read(read) if read else []:
            assert record == entry(record.seq)
            found.append(record.seq)
    while records := reader.read():
        found += [record.seq for record in records]
    ring.close()
    assert found == sorted(set(found))
    assert len(found) + reader.lost_frames == seq
    assert found[-1] == seq - 1


def test_what_is_too_much_for_one_record_is_divided() -> None:
    ring = Ring.create(16 * PAGE)  # a record has at most 4 pages
    reader, frames = RingReader(ring), [bytes([i]) * 1500 for i in range(20)]
    ring.put_many([i % 3 for i in range(20)], 7, list(range(20)), frames)
    found = reader.read()
    assert found == [RingFrame(EntryKind.RECEIVED, i % 3, 7 + i, i, frame) for i, frame in enumerate(frames)]
    assert reader.lost_frames == 0
    assert ring.next_seq == 27
    ring.close()


def test_a_frame_that_is_too_large_is_refused_also_in_company(ring: Ring) -> None:
    with pytest.raises(ValueError, match="the limit is 4"):
        ring.put_many([0] * 3, 0, [0, 1, 2], [b"", bytes(PAGE), b""])


def test_overrun_reader_goes_on_with_what_comes_next(ring: Ring) -> None:
    reader = RingReader(ring)
    put(ring, *range(10))
    reader.read(4)
    put(ring, *range(10, 2000))
    assert ring.oldest_seq
    assert reader.read() == []
    assert (reader.lost_frames, reader.next_seq) == (1996, 2000)
    put(ring, 2000)
    assert check(reader.read()) == [2000]
    assert reader.lost_frames == 1996


def test_a_reader_that_comes_after_the_ring_was_full_has_lost_all(ring: Ring) -> None:
    put(ring, *range(7, 2000))
    reader = RingReader(ring)
    assert reader.read() == []
    assert (reader.lost_frames, reader.next_seq) == (1993, 2000)


def test_a_full_ring_is_read_whole_while_it_has_not_overrun_its_reader(ring: Ring) -> None:
    reader, seq = RingReader(ring), 0
    while ring.writer_state().oldest == 0:
        put(ring, seq)
        seq += 1
    reader = reader_of_all(ring)
    numbers = check(reader.read())
    assert numbers == list(range(ring.oldest_seq or 0, seq))


def test_what_waits_can_be_skipped(ring: Ring) -> None:
    reader = RingReader(ring)
    assert reader.skip() == 0
    put(ring, *range(5, 15))
    assert reader.skip() == 10
    put(ring, *range(15, 25))
    assert check(reader.read(3)) == [15, 16, 17]
    assert (reader.skip(), reader.skip()) == (7, 0)
    assert reader.read() == []
    put(ring, 25)
    assert check(reader.read()) == [25]
    assert (reader.lost_frames, reader.next_seq) == (17, 26)


def test_what_was_skipped_stays_skipped_for_the_next_reader(ring: Ring) -> None:
    reader = RingReader(ring)
    put(ring, *range(10))
    reader.skip()
    assert check(RingReader(ring).read(2)) == [0, 1]  # the skip is not committed yet
    reader.commit()
    put(ring, 10)
    follower = RingReader(ring)
    assert check(follower.read()) == [10]
    assert follower.lost_frames == 10


def test_frames_that_never_came_are_lost_too(ring: Ring) -> None:
    reader = RingReader(ring)
    put(ring, 3, 4, 8)
    assert check(reader.read()) == [3, 4, 8]
    assert reader.lost_frames == 3


def test_record_overwritten_while_it_is_copied_is_not_accepted(ring: Ring, monkeypatch: pytest.MonkeyPatch) -> None:
    reader = RingReader(ring)
    put(ring, *range(100))
    load, turn = ring.load, iter([range(100, 2000)])

    def slow_load(position: int, count: int) -> bytes:
        data = load(position, count)
        for numbers in turn:  # the first time, the writer laps the reader
            put(ring, *numbers)
        return data

    monkeypatch.setattr(ring, "load", slow_load)
    assert reader.read(5) == []
    assert reader.lost_frames == reader.next_seq == ring.next_seq == 2000


def test_damaged_memory_is_skipped_and_counted(ring: Ring) -> None:
    reader = RingReader(ring)
    put(ring, 1, 2, 3)
    ring._map[PAGE + SINGLE_FRAME_BYTES + 2] ^= 1  # inside the data of the first frame
    assert reader.read() == []
    put(ring, 4, 5)
    assert check(reader.read()) == [4, 5]
    assert reader.lost_frames == 3


def test_what_does_not_fit_is_refused(ring: Ring) -> None:
    with pytest.raises(ValueError, match="the limit is 4"):
        ring.put_many([0], 0, [0], [bytes(PAGE)])
    with pytest.raises(ValueError, match="at least"):
        Ring.create(100)


def test_other_memory_is_refused() -> None:
    fds = os.memfd_create("other"), os.eventfd(0)
    os.ftruncate(fds[0], 2 * PAGE)
    with pytest.raises(ValueError, match="not a ring"):
        Ring.attach(fds)


WAITER = """
import sys
from fti.buffers.ring import Ring
from fti.buffers.ring_reader import RingReader
reader = RingReader(Ring.attach((int(sys.argv[1]), int(sys.argv[2]))))
print("ready", flush=True)
waits = 0
while not reader.is_finished:
    if not reader.read():
        waits += 1
        reader.wait(3600)
print(reader.next_seq, waits)
"""


def test_a_reader_that_waits_is_woken_by_every_frame_and_by_the_end(ring: Ring) -> None:
    """Its limit of an hour is never reached."""
    reader = start(WAITER, ring, out=subprocess.PIPE)
    assert reader.stdout
    assert reader.stdout.readline() == b"ready\n"
    for seq in range(200):
        put(ring, seq)
        until(lambda seq=seq: ring.reader_state().next_seq > seq)  # type: ignore[misc]
    ring.end()
    assert reader.wait(timeout=30) == 0
    frames, waits = map(int, reader.stdout.read().split())
    reader.stdout.close()
    assert frames == 200
    assert 200 <= waits <= 402  # once or twice a frame: it does not poll


def test_a_wait_ends_without_a_frame(ring: Ring) -> None:
    reader = RingReader(ring)
    put(ring, 1)
    reader.wait(3600)
    reader.wait(0.01)  # the event of the frame was taken
    assert check(reader.read()) == [1]


def test_the_oldest_frame_that_waits_is_known_to_all(ring: Ring) -> None:
    reader = RingReader(ring)
    assert ring.oldest_waiting_ns is None
    for seq in range(3):
        put(ring, seq)
    assert ring.oldest_waiting_ns == 0
    for seq in range(3):
        reader.read(1)
        assert ring.oldest_waiting_ns == 10 * seq, "it is worked on"
    reader.read()
    assert ring.oldest_waiting_ns is None
    put(ring, *range(3, 5000))
    waiting = ring.oldest_waiting_ns
    assert waiting is not None
    assert waiting > 30, "what was overwritten does not wait"


def test_end_mark(ring: Ring) -> None:
    reader = RingReader(ring)
    put(ring, 1)
    assert not ring.has_ended
    ring.end()
    assert ring.has_ended
    assert not reader.is_finished
    reader.read()
    assert reader.is_finished


def test_new_reader_goes_on_where_the_last_one_stopped(ring: Ring) -> None:
    put(ring, *range(10))
    first = RingReader(ring)
    assert check(first.read(4)) == [0, 1, 2, 3]
    assert check(RingReader(ring).read(4)) == [0, 1, 2, 3]  # the frames were not committed
    first.commit()
    assert check(RingReader(ring).read(4)) == [4, 5, 6, 7]


def test_size_holds_thirty_seconds() -> None:
    assert ring_size([]) == 16 * 2**20
    slow = [SerialLink(name=f"s{i}", kind="serial", port="x") for i in range(10)]
    assert ring_size(slow) == 16 * 2**20
    fast = [CanLink(name=f"c{i}", kind="can", interface="socketcan", channel="c", bitrate=1_000_000) for i in range(4)]
    assert ring_size(fast) >= 30 * 4 * (1_000_000 // 111) * (16 + SINGLE_FRAME_BYTES)  # frames with 8 bytes of data
    udp = [UdpLink(name=f"u{i}", kind="udp", bind="127.0.0.1:0") for i in range(9)]
    assert ring_size(udp) >= 30 * 9 * 2000 * 100


class KilledError(Exception):
    """Stands for SIGKILL at one chosen instruction."""


def test_writer_killed_while_it_overwrites_leaves_the_rest_readable(
    ring: Ring, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(ring, *range(1000))
    store, oldest = ring._store, ring._state.oldest

    def half(position: int, data: bytes) -> None:
        if ring._state.oldest == oldest:
            store(position, data)
        else:  # the first record for which others had to go
            store(position, data[: len(data) // 2])
            raise KilledError

    monkeypatch.setattr(ring, "_store", half)
    with pytest.raises(KilledError):
        put(ring, *range(1000, 2000))
    reader = reader_of_all(ring)
    numbers = check(reader.read())
    assert numbers[0] == reader.lost_frames > 0
    assert numbers == list(range(numbers[0], ring.next_seq))


class Unpublished:
    """The header of a ring whose writer is killed before it can publish."""

    def __init__(self, words: memoryview) -> None:
        self._words = words

    def __getitem__(self, key: Any) -> Any:
        return self._words[key]

    def __setitem__(self, key: int, value: int) -> None:
        raise KilledError

    def release(self) -> None:
        self._words.release()


@pytest.mark.parametrize("frames", [1, 2, 1000])
def test_process_killed_while_it_publishes_leaves_the_state_before(ring: Ring, frames: int) -> None:
    put(ring, *range(frames))
    reader = RingReader(ring)
    reader.read(frames // 2)
    reader.commit()
    states = ring.writer_state(), ring.reader_state()
    ring._words = Unpublished(ring._words)  # type: ignore[assignment]
    with pytest.raises(KilledError):
        reader.read(1)
    with pytest.raises(KilledError):
        put(ring, frames)
    assert (ring.writer_state(), ring.reader_state()) == states


# ----------------------------------------------------------------------------------------------------- real processes

WRITER = """
import sys
from fti.buffers.ring import Ring, pack_source
ring = Ring.attach((int(sys.argv[1]), int(sys.argv[2])))
seq, last = ring.next_seq, int(sys.argv[3])
while seq < last:
    ring.put_many([pack_source(seq % 3, seq % 7)], seq, [seq * 10], [seq.to_bytes(4, "little") * (seq % 40)])
    seq += 1
ring.end()
"""

READER = """
import os, sys
from fti.buffers.ring import Ring
from fti.buffers.ring_reader import RingReader
reader = RingReader(Ring.attach((int(sys.argv[1]), int(sys.argv[2]))))
while not reader.is_finished:
    lines = ""
    for kind, link, seq, t, data in reader.read(50):
        assert kind == seq % 3
        assert data == seq.to_bytes(4, "little") * (seq % 40) and t == 10 * seq and link == seq % 7
        lines += f"{seq}\\n"
    os.write(1, lines.encode())  # whole lines, also when killed
    reader.commit()
print("lost", reader.lost_frames)
"""


def start(code: str, ring: Ring, *args: object, out: int | None = None) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", code, *map(str, ring.fds), *map(str, args)]
    return subprocess.Popen(command, pass_fds=ring.fds, stdout=out, cwd=ROOT)


def kill(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGKILL)
    process.wait()


def test_killed_writer_leaves_whole_records_and_its_successor_goes_on(ring: Ring) -> None:
    last = 0
    for _ in range(6):
        process = start(WRITER, ring, 10**9)
        before = ring.next_seq
        until(lambda before=before: ring.next_seq > before + 500)  # type: ignore[misc]
        kill(process)
        reader, found = reader_of_all(ring), list[int]()
        while records := check(reader.read()):
            found += records
        assert found == list(range(found[0], ring.next_seq))
        assert len(found) + reader.lost_frames == ring.next_seq > last
        last = ring.next_seq


def test_killed_reader_is_followed_by_one_that_goes_on() -> None:
    ring, frames = Ring.create(64 * PAGE), 3000
    out = os.memfd_create("out")
    reader = start(READER, ring, out=out)
    for seq in range(frames):
        put(ring, seq)
        if seq in (700, 1400, 2100):
            until(lambda seq=seq: ring.reader_state().next_seq > seq - 300)  # type: ignore[misc]
            kill(reader)
            reader = start(READER, ring, out=out)
    ring.end()
    assert reader.wait() == 0
    lines = os.pread(out, 10**6, 0).decode().split("\n")
    os.close(out)
    ring.close()
    assert lines[-2:] == ["lost 0", ""]
    numbers = [int(line) for line in lines[:-2]]
    assert sorted(set(numbers)) == list(range(frames))
    assert len(numbers) - frames <= 3 * 50  # only what a killed reader had not yet reported as done comes again


def test_stopped_reader_does_not_stop_the_writer(ring: Ring) -> None:
    out = os.memfd_create("out")
    reader = start(READER, ring, out=out)
    put(ring, *range(100))
    until(lambda: ring.reader_state().next_seq == 100)
    reader.send_signal(signal.SIGSTOP)
    put(ring, *range(100, 5000))
    reader.send_signal(signal.SIGCONT)
    ring.end()
    assert reader.wait() == 0
    lines = os.pread(out, 10**6, 0).decode().split()
    os.close(out)
    lost = int(lines[-1])
    assert lost > 0
    assert len(lines) - 2 + lost == 5000


def test_reader_and_writer_race(ring: Ring) -> None:
    """A writer at full speed laps a reader many times: every frame is read whole or counted."""
    last, found, reader = 30_000, list[int](), RingReader(ring)
    process = start(WRITER, ring, last)
    deadline = time.monotonic() + 60
    while not reader.is_finished and time.monotonic() < deadline:
        found.extend(check(reader.read(20)))
    assert process.wait() == 0
    assert found == sorted(set(found))
    assert len(found) + reader.lost_frames == last


def test_empty_ring_has_no_oldest_frame(ring: Ring) -> None:
    assert ring.oldest_seq is None
    assert ring.next_seq == 0
