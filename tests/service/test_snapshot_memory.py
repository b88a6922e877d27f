"""The memory of the snapshot sink: what it holds, what it lets go, and that every frame is counted once."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from fti.service.recorder.link_ledger import SnapshotOutcome
from fti.service.recorder.snapshot.frame_memory import BLOCK_BYTES, HEAD_BYTES, FrameBlock, FrameMemory

SECOND_NS = 1_000_000_000
BIG = 2**30


def make_memory(
    span_s: float = 10.0, max_bytes: int = BIG, sources: int = 2
) -> tuple[FrameMemory, list[SnapshotOutcome]]:
    outcomes = [SnapshotOutcome() for _ in range(sources)]
    return FrameMemory(round(span_s * SECOND_NS), max_bytes, outcomes), outcomes


def taken(memory: FrameMemory) -> list[tuple[int, int, int, bytes]]:
    """Everything that it holds: source, seq, time, data."""
    found = []
    while block := memory.take():
        found += [(source, *entry) for source, entries in block.unpack().items() for entry in entries]
    return found


frames = st.lists(
    st.tuples(st.integers(0, 1), st.integers(0, 2**64 - 1), st.integers(0, 2**62), st.binary(max_size=200)), max_size=50
)


@given(frames)
def test_frames_come_out_as_they_went_in(given_frames: list[tuple[int, int, int, bytes]]) -> None:
    block = FrameBlock()
    for source, seq, t_ns, data in given_frames:
        block.add(source, [(seq, t_ns, data)])
    for source in (0, 1):
        put = [(seq, t_ns, data) for s, seq, t_ns, data in given_frames if s == source]
        assert block.unpack().get(source, []) == put
        amount = block.amounts.get(source)
        assert (amount.frames, amount.bytes) == (len(put), sum(len(d) for *_, d in put)) if amount else not put


def test_what_is_older_than_the_span_goes_block_by_block() -> None:
    memory, outcomes = make_memory(span_s=10.0)
    for n in range(200):
        memory.add(0, [(n, n * SECOND_NS // 10, b"xx")])
    held = [seq for _, seq, _, _ in taken(memory)]
    assert held == list(range(held[0], 200))
    assert 199 - 100 - 6 <= held[0] <= 199 - 100
    assert outcomes[0].not_triggered.frames == held[0]
    assert outcomes[0].not_triggered.bytes == 2 * held[0]
    assert memory.overflows == 0


def test_the_bound_holds_for_what_is_occupied_and_the_oldest_go() -> None:
    memory, outcomes = make_memory(span_s=1e6, max_bytes=3 * BLOCK_BYTES)
    for n in range(1000):
        memory.add(1, [(n, n, bytes(1000))])
        assert memory.held_bytes <= 3 * BLOCK_BYTES
    held = [seq for _, seq, _, _ in taken(memory)]
    assert held[-1] == 999
    assert (len(held) + 1) * (1000 + HEAD_BYTES) > 2 * BLOCK_BYTES
    assert outcomes[1].not_triggered.frames == held[0]
    assert memory.overflows > 0


def test_what_a_trigger_asks_for_is_let_go_as_overflow() -> None:
    memory, outcomes = make_memory(span_s=1e6, max_bytes=2 * BLOCK_BYTES)
    memory.hold_from(0)
    for n in range(500):
        memory.add(0, [(n, n, bytes(1000))])
    number = len(taken(memory))
    assert outcomes[0].overflow.frames == 500 - number
    assert outcomes[0].not_triggered.frames == 0


def test_what_is_held_for_a_trigger_outlives_the_span() -> None:
    memory, outcomes = make_memory(span_s=1.0)
    memory.add(0, [(0, 0, b"first")])
    memory.hold_from(0)
    for n in range(1, 100):
        memory.add(0, [(n, n * SECOND_NS, b"x")])
    assert [seq for _, seq, _, _ in taken(memory)] == list(range(100))
    assert outcomes[0].not_triggered.frames == 0


@given(frames, st.integers(1, 3))
def test_every_frame_is_held_or_counted(given_frames: list[tuple[int, int, int, bytes]], blocks: int) -> None:
    memory, outcomes = make_memory(span_s=1e3, max_bytes=blocks * 2000)
    for source, seq, t_ns, data in given_frames:
        memory.add(source, [(seq, t_ns, data)])
    rows = taken(memory)
    assert memory.held_bytes == 0
    for source, outcome in enumerate(outcomes):
        here = [f for f in rows if f[0] == source]
        put = [f for f in given_frames if f[0] == source]
        assert outcome.not_triggered.frames + len(here) == len(put)
        assert outcome.not_triggered.bytes + sum(len(f[3]) for f in here) == sum(len(f[3]) for f in put)


def test_what_is_put_back_comes_first() -> None:
    memory, _ = make_memory()
    memory.add(0, [(0, 1, b"a")])
    first = memory.take()
    memory.add(0, [(1, 2, b"b")])
    second = memory.take()
    memory.add(0, [(2, 3, b"c")])
    assert first
    assert second
    memory.put_back([first, second])
    assert [seq for _, seq, _, _ in taken(memory)] == [0, 1, 2]
