"""What several channels have is written at once, as if it had come message by message."""

from __future__ import annotations

import tempfile
from itertools import accumulate
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.frame_batch import FrameBatch, iter_frames, make_batch, split_batch
from fti.logger.stream_writer import StreamWriter
from tests.logger.official_reader import read_closed

CHANNELS = 3
SIZES = st.one_of(
    st.lists(st.integers(0, 40), min_size=1, max_size=12),
    st.builds(list.__mul__, st.lists(st.integers(0, 99), min_size=1, max_size=1), st.integers(1, 70)),
)


@st.composite
def bursts(draw: st.DrawFn) -> FrameBatch:
    """Of one size or of several; numbers about the end of 32 bits, not one after another; times do not go back."""
    sizes = draw(SIZES)
    first = draw(st.sampled_from((0, 7, 2**32 - 3, 2**32 - 1, 2**32, 2**40 + 5)))
    steps = draw(st.lists(st.integers(0, 2**40), min_size=len(sizes), max_size=len(sizes)))
    _, times, frames, payload = make_batch(
        first, list(accumulate(steps, initial=10**18))[1:], [bytes([n % 256]) * size for n, size in enumerate(sizes)]
    )
    leaps = draw(st.lists(st.integers(1, 4), min_size=len(sizes) - 1, max_size=len(sizes) - 1))
    return list(accumulate(leaps, initial=first)), times, frames, payload


Flushes = list[list[tuple[int, list[FrameBatch]]]]
flushes = st.lists(
    st.lists(st.tuples(st.integers(1, CHANNELS), st.lists(bursts(), min_size=1, max_size=4)), max_size=4), max_size=4
)


def one_by_one(writer: StreamWriter, shares: list[tuple[int, list[FrameBatch]]]) -> None:
    for channel, parts in shares:
        for seq, time, data in iter_frames(parts):
            writer.write(channel, time, data, seq & 0xFFFF_FFFF)


@given(flushes, st.integers(1, 20_000))
def test_the_file_is_the_same_byte_for_byte(turns: Flushes, chunk_bytes: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        files = []
        for method in (StreamWriter.write_batches, one_by_one):
            path = Path(name) / method.__name__
            writer = StreamWriter(path, chunk_bytes=chunk_bytes)
            for channel in range(CHANNELS):
                writer.add_channel(f"/{channel}", "x")
            for shares in turns:
                # the channels of all come first, as they are declared before what they bring is packed
                for channel, _ in shares:
                    writer.write_batches([(channel, ())])
                method(writer, shares)
                writer.flush()
            span = writer.span_ns
            writer.close()
            files.append((span, path.read_bytes()))
        assert files[0] == files[1]
        expected = [
            (seq & 0xFFFF_FFFF, t, d) for shares in turns for _, parts in shares for seq, t, d in iter_frames(parts)
        ]
        assert sorted((m[3], m[1], m[4]) for m in read_closed(path)) == sorted(expected)


@pytest.mark.parametrize("count", [1, 10])
def test_all_or_none(tmp_path: Path, count: int) -> None:
    """One message that cannot be: the others come again, and stand there once."""
    writer = StreamWriter(tmp_path / "a.mcap")
    ids = [writer.add_channel(f"/{channel}", "x") for channel in range(2)]
    good = make_batch(5, list(range(count)), [b"good"] * count)
    bad = make_batch(6, [1] * (count - 1) + [2**64], [b"bad"] * count)
    with pytest.raises(ValueError, match="out of range"):
        writer.write_batches([(ids[0], [good]), (ids[1], [good, bad])])
    writer.write_batches([(ids[0], [good])])
    writer.close()
    assert [(m[0], m[3]) for m in read_closed(writer.path)] == [("/0", 5 + n) for n in range(count)]


@given(bursts(), st.data())
def test_a_burst_is_divided_without_loss(burst: FrameBatch, data: st.DataObject) -> None:
    if len(burst[2]) > 1:
        count = data.draw(st.integers(1, len(burst[2]) - 1))
        head, rest = split_batch(burst, count)
        assert len(head[2]) == count
        assert head[3] + rest[3] == burst[3]
        assert [*iter_frames([head]), *iter_frames([rest])] == list(iter_frames([burst]))
