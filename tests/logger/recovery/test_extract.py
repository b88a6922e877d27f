from __future__ import annotations

import errno
import json
import os
import random
import struct
import tracemalloc
import zlib
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import hypothesis.strategies as st
import lz4.frame
import pytest
import zstandard
from mcap.writer import CompressionType, Writer

from fti.errors import MissingError, StorageError
from fti.logger import records
from fti.logger.records import Op
from fti.logger.recovery.extract import extract_file, extract_session
from fti.logger.recovery.recovered_sequence import RecoveredSequence
from fti.logger.session import SessionFolder
from fti.logger.stream_writer import StreamWriter
from tests.logger.damaged_recordings import Original, Span, is_part, recover, write_foreign, write_own
from tests.logger.official_reader import MessageTuple, read_closed, read_stream
from tests.logger.small_session import STARTED, TURN, Recorder, open_log

#: Quick and full counts; full: ``--scale full``.
FLIPS, HOLES, STEP = 300, 100, 41
ZSTD, LZ4, NONE = CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE


@pytest.fixture(autouse=True)
def _unsynced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Thousands of files are written here that need not outlive a power cut."""
    monkeypatch.setattr(os, "fsync", lambda fd: None)


@pytest.fixture(params=["own", "zstd", "lz4"])
def original(request: pytest.FixtureRequest, tmp_path: Path) -> Original:
    path = tmp_path / "whole.mcap"
    if request.param == "own":
        return Original(write_own(path))
    return Original(write_foreign(path, ZSTD if request.param == "zstd" else LZ4))


def check(original: Original, damaged: bytes, damage: Span, folder: Path) -> None:
    """Nothing invented, and all chunks that were not hit are there."""
    measurements, report = recover(damaged, folder)
    measurements = [m for m in measurements if not m[0].startswith("/recovered/")]
    assert is_part(measurements, original.messages), damage
    must = original.must_hold(damage)
    assert is_part(must, measurements) or report.messages == len(must), damage
    assert not (report.summary and report.complete) or report.messages == len(original.messages), damage


def test_a_whole_file_is_copied_whole(original: Original, tmp_path: Path) -> None:
    found, report = recover(original.data, tmp_path)
    assert found == original.messages
    assert report.complete and report.matches_summary and not report.damages and not report.unverified


def test_random_bit_flips(original: Original, tmp_path: Path, scale: int) -> None:
    random_flips = random.Random(7)
    count = FLIPS if scale == 1 else 10_000
    for _ in range(count // 3):
        at, bit = random_flips.randrange(len(original.data)), random_flips.randrange(8)
        damaged = bytearray(original.data)
        damaged[at] ^= 1 << bit
        check(original, bytes(damaged), (at, at + 1), tmp_path)


def holes(original: Original, count: int) -> Iterator[tuple[Span, bool]]:
    random_holes = random.Random(8)
    for n in range(count):
        size = random_holes.choice((1, 9, 60, 512, 1500))
        at = random_holes.randrange(len(original.data))
        yield (at, min(at + size, len(original.data))), n % 2 == 0


def test_random_holes(original: Original, tmp_path: Path, scale: int) -> None:
    """Zeroed, and cut out."""
    for (begin, end), zeroed in holes(original, HOLES if scale == 1 else 1000):
        filling = bytes(end - begin) if zeroed else b""
        check(original, original.data[:begin] + filling + original.data[end:], (begin, end), tmp_path)


def test_cut_off_at_every_byte(original: Original, tmp_path: Path, scale: int) -> None:
    for size in range(0, len(original.data), STEP if scale == 1 else 1):
        check(original, original.data[:size], (size, len(original.data)), tmp_path)


def test_a_killed_file_cut_off_at_every_byte_gives_its_whole_records(tmp_path: Path, scale: int) -> None:
    killed = write_own(tmp_path / "killed.mcap", finish=False)
    whole, _ = recover(killed, tmp_path)
    messages: list[MessageTuple] = []
    for size in range(0, len(killed), STEP if scale == 1 else 1):
        found, report = recover(killed[:size], tmp_path)
        assert found == whole[: len(found)]
        assert len(found) >= len(messages)
        messages = found
        assert report.chunks or report.unverified == len(found)


@hypothesis.given(st.data())
def test_nothing_verified_is_invented_however_much_is_damaged(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Several flips, holes and cuts at once."""
    folder = tmp_path_factory.mktemp("many")
    damaged = bytearray(write_own(folder / "whole.mcap", messages=40))
    original = read_stream(bytes(damaged))
    for _ in range(data.draw(st.integers(1, 5))):
        at, size = data.draw(st.integers(0, len(damaged))), data.draw(st.integers(0, 400))
        filling = data.draw(st.sampled_from([b"", bytes(size), b"\xff" * size, bytes(damaged[:size])]))
        damaged[at : at + size] = filling
    found, report = recover(bytes(damaged), folder)
    if not report.unverified:
        assert [m for m in found if m not in original] == []


@pytest.mark.parametrize("data", [b"", b"hello", records.MAGIC, bytes(100_000), random.Random(1).randbytes(100_000)])
def test_what_is_no_recording_gives_an_empty_one(tmp_path: Path, data: bytes) -> None:
    found, report = recover(data, tmp_path)
    assert found == [] and not report.summary
    assert not report.complete


def outer_and_inner(folder: Path, *, finish: bool) -> tuple[bytes, bytes]:
    """A recording in whose messages another recording is carried."""
    inner = write_own(folder / "inner.mcap", messages=5)
    writer = StreamWriter(folder / "outer.mcap", chunk_bytes=500)
    channel = writer.add_channel("/raw/download", "x-fti-raw")
    for n in range(3):
        writer.write(channel, n, inner, n)
        writer.write(channel, n, bytes(10), n + 10)
        writer.flush()
    if finish:
        writer.close()
    writer.abandon()
    return (folder / "outer.mcap").read_bytes(), inner


@pytest.mark.parametrize("finish", [True, False])
def test_a_recording_inside_a_message_is_not_taken_for_one(tmp_path: Path, finish: bool) -> None:
    outer, inner = outer_and_inner(tmp_path, finish=finish)
    messages = read_stream(outer)
    at = outer.find(inner)
    for place in (at - 3, at + 1, at + len(inner) + 4):  # the message, the carried recording, the next message
        damaged = bytearray(outer)
        damaged[place] ^= 0xFF
        found, report = recover(bytes(damaged), tmp_path)
        assert found == messages[2:]
        assert not report.complete and report.missing_messages == (2 if finish else None)
    damaged = bytearray(outer)
    damaged[outer.find(b"\x06", len(records.file_head())) + 3] ^= 0xFF  # the head of its chunk
    found, _ = recover(bytes(damaged), tmp_path)
    assert found == messages[2:] or not finish  # without a summary nothing tells what was carried


def hostile() -> Iterator[bytes]:
    """Files that ask for very much."""
    head = records.file_head()
    for length in (2**63, 2**64 - 1, 2**40, 2**32, 10**9):
        for op in (*Op, 0x90):
            yield head + struct.pack("<BQ", op, length) + bytes(200)
        yield head + struct.pack("<BQQQQIIQ", Op.CHUNK, length, 0, 0, length - 40, 1, 0, length - 40) + bytes(200)
        yield head + records.packed_chunk((0, 1), length, 1, "zstd", zstandard.compress(b"x"))
    for size in (2**28, -1):  # in the frame head, and not
        frame = zstandard.ZstdCompressor().compressobj(size=size)
        bomb = b"".join(frame.compress(bytes(2**20)) for _ in range(2**8)) + frame.flush()
        yield head + records.packed_chunk((0, 1), 100, 0, "zstd", bomb)
        yield head + records.packed_chunk((0, 1), 2**20, zlib.crc32(bytes(2**20)), "zstd", bomb)
    frame = lz4.frame.LZ4FrameCompressor()
    bomb = frame.begin() + b"".join(frame.compress(bytes(2**20)) for _ in range(2**8)) + frame.flush()
    yield head + records.packed_chunk((0, 1), 2**20, zlib.crc32(bytes(2**20)), "lz4", bomb)
    yield head + records.metadata("a", {"b": "c"})[:-5] + struct.pack("<I", 2**32 - 1)


def test_lengths_that_ask_for_much_get_nothing(tmp_path: Path) -> None:
    files = list(hostile())
    tracemalloc.start()
    try:
        for data in files:
            found, _ = recover(data, tmp_path)
            assert found == []
        assert tracemalloc.get_traced_memory()[1] < 50 * 2**20
    finally:
        tracemalloc.stop()


def test_a_medium_that_refuses_sectors_costs_their_chunks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    original = Original(write_own(tmp_path / "whole.mcap", messages=900, chunk_bytes=5000))
    bad = (32768, 36864)
    pread = os.pread

    def refuse(fd: int, size: int, at: int) -> bytes:
        if at < bad[1] and at + size > bad[0]:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return pread(fd, size, at)

    monkeypatch.setattr(os, "pread", refuse)
    report = extract_file(tmp_path / "whole.mcap", tmp_path / "out.mcap", RecoveredSequence(), lambda _: None)
    assert read_closed(tmp_path / "out.mcap") == original.must_hold(bad)
    assert report.unreadable_bytes >= 4096 and not report.complete


def test_a_hole_in_the_open_chunk_costs_the_message_before_it(tmp_path: Path) -> None:
    """The hole may begin in it."""
    writer = StreamWriter(tmp_path / "open.mcap")
    channel = writer.add_channel("/a", "x")
    for n in range(100):
        writer.write(channel, n, bytes([n + 1]) * 20, n)
        writer.flush()
    writer.abandon()
    data = (tmp_path / "open.mcap").read_bytes()
    messages = read_stream(data)
    for begin in range(2100, 2160):
        found, report = recover(data[:begin] + bytes(300) + data[begin + 300 :], tmp_path)
        assert found == messages[: len(found)] and report.unverified == len(found) >= (begin - 1300) // 51
        assert report.damages


def test_the_names_of_channels_come_from_the_summary_or_are_generated(tmp_path: Path) -> None:
    """Foreign writers name a channel once."""
    original = Original(write_foreign(tmp_path / "whole.mcap", ZSTD))
    (begin, end), held = original.chunks[0]
    damaged = original.data[:begin] + bytes(end - begin) + original.data[end:]
    found, _ = recover(damaged, tmp_path)
    assert found == original.messages[len(held) :]
    found, report = recover(damaged[:-200], tmp_path)
    assert {topic for topic, *_ in found} == {"/recovered/channel_1", "/recovered/channel_2"}
    assert [m[1:] for m in found] == [m[1:] for m in original.messages[len(held) :]]
    assert not report.complete


def test_messages_outside_of_chunks_are_taken_up_to_the_damage(tmp_path: Path) -> None:
    with (tmp_path / "bare.mcap").open("wb") as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start()
        channel = writer.register_channel("/a", "x", 0)
        for n in range(50):
            writer.add_message(channel, n, bytes(20), n, n)
        writer.finish()  # type: ignore[no-untyped-call]
    data = (tmp_path / "bare.mcap").read_bytes()
    messages = read_stream(data)
    found, report = recover(data, tmp_path)
    assert found == messages and report.complete and report.unverified == 50
    at = data.index(records.MESSAGE.pack(Op.MESSAGE, 42, channel, 18, 18, 18))
    found, report = recover(data[:at] + b"\xff" * 9 + data[at + 9 :], tmp_path)
    assert found == messages[:17]  # the damage may begin in the one before
    assert report.missing_messages == 50 - len(found)


def test_what_is_missing_is_reported(tmp_path: Path) -> None:
    session = tmp_path / "s_0"
    session.mkdir()
    original = Original(write_own(session / "s_0_000.mcap", messages=300, chunk_bytes=3000))
    (begin, end), held = original.chunks[2]
    data = bytearray(original.data)
    data[begin + 100] ^= 4
    data[begin + 200] ^= 4
    (session / "s_0_000.mcap").write_bytes(data)
    done: list[int] = []
    report = extract_session(session, tmp_path / "out", done.append)
    numbers = [number for topic, _, _, number, _ in held if topic.startswith("/raw")]
    [gap] = report.gaps
    assert (gap.first, gap.last) == (min(numbers), max(numbers))
    assert (gap.first_ns, gap.last_ns) == tuple(10**9 + n * 10**6 for n in (min(numbers) - 1, max(numbers) + 1))
    [file] = report.files
    [damage] = file.damages
    assert (damage.begin, damage.end) == (begin, end)
    assert (damage.after_ns, damage.before_ns) == (gap.first_ns, gap.last_ns)
    assert file.missing_messages == len(held) and [chunk.offset for chunk in file.missing_chunks] == [begin]
    assert json.loads((tmp_path / "out" / "recovered.json").read_text()) == report.as_json()
    assert done == sorted(done) and done[-1] == len(data)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["recovered.json", "s_0_000.mcap"]


@pytest.mark.parametrize("place", [52, 90, 400, 690, 33])  # the first byte of the records, others, one of the checksum
def test_one_flipped_bit_is_corrected_and_reported(tmp_path: Path, place: int) -> None:
    """The chunk is there, but not as verified, nor the file as complete."""
    original = Original(write_own(tmp_path / "whole.mcap"))
    (begin, _), held = original.chunks[2]
    data = bytearray(original.data)
    data[begin + place] ^= 16
    found, report = recover(bytes(data), tmp_path)
    assert found == original.messages
    assert (report.unverified, report.missing_messages, report.damages) == (len(held), 0, [])
    assert report.flipped == [begin + (33 if place == 33 else place)]
    assert not report.complete
    data[begin + 150] ^= 1
    found, report = recover(bytes(data), tmp_path)
    assert found == original.must_hold((begin, begin + 1))
    assert report.flipped == []


def test_a_flipped_bit_behind_other_damage_is_turned_back_where_the_summary_names_the_chunk(tmp_path: Path) -> None:
    """Without the summary, what looks like a chunk with one wrong bit may be anything: it is lost with the rest."""
    original = Original(write_own(tmp_path / "whole.mcap"))
    (begin, end), lost = original.chunks[2]
    (following, _), _ = original.chunks[3]
    data = bytearray(original.data)
    data[begin : begin + 9] = bytes(9)
    data[following + 400] ^= 16
    found, report = recover(bytes(data), tmp_path)
    assert found == original.must_hold((begin, end))
    assert (report.flipped, report.missing_messages, report.complete) == ([following + 400], len(lost), False)
    found, report = recover(bytes(data[:-30]), tmp_path)
    assert found == original.must_hold((begin, following + 1))
    assert report.flipped == [] and not report.complete


def test_frames_for_which_no_trigger_came_are_not_missing(tmp_path: Path) -> None:
    folder = SessionFolder.create(tmp_path, "s", STARTED)
    removed = [seq for seq in range(100) if TURN[seq % len(TURN)] != "/fti/tick"]
    Recorder(open_log(folder, metadata={"fti": {"mode": "snapshot"}}), 0, removed=removed).run(100).end()
    assert extract_session(folder.path, tmp_path / "out", lambda done: None).complete


def test_numbers_go_on_past_32_bits(tmp_path: Path) -> None:
    writer = StreamWriter(tmp_path / "a_000.mcap", chunk_bytes=500)
    channel = writer.add_channel("/raw/a", "x-fti-raw")
    for n in (number for number in range(100) if number not in range(40, 45)):
        writer.write(channel, n, b"data", (2**32 - 50 + n) % 2**32)
        writer.flush()
    writer.close()
    report = extract_session(tmp_path / "a_000.mcap", tmp_path / "out", lambda _: None)
    assert [(gap.first, gap.last) for gap in report.gaps] == [(2**32 - 10, 2**32 - 6)]
    assert report.files[0].complete and not report.complete


def test_nothing_that_exists_is_written_over(tmp_path: Path) -> None:
    write_own(tmp_path / "a.mcap")
    with pytest.raises(StorageError, match="is not empty; choose another folder"):
        extract_session(tmp_path / "a.mcap", tmp_path, lambda _: None)
    with pytest.raises(MissingError, match="there is no such session folder or file"):
        extract_session(tmp_path / "b.mcap", tmp_path / "out", lambda _: None)
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StorageError, match=r"file: cannot be created: File exists"):
        extract_session(tmp_path / "a.mcap", tmp_path / "file", lambda _: None)


def test_an_interruption_leaves_no_half_file(tmp_path: Path) -> None:
    write_own(tmp_path / "a.mcap")

    def interrupt(at: int) -> None:
        if at > 2000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        extract_session(tmp_path / "a.mcap", tmp_path / "out", interrupt)
    assert list((tmp_path / "out").iterdir()) == []


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from fti.cli.main import main

    whole = write_own(tmp_path / "a_000.mcap")
    assert main(["recover", str(tmp_path / "a_000.mcap")]) == 0
    assert "nothing is missing" in capsys.readouterr().out
    assert read_closed(tmp_path / "a_000_recovered" / "a_000.mcap") == read_stream(whole)
    assert main(["recover", str(tmp_path / "a_000.mcap")]) == 2
    assert "is not empty" in capsys.readouterr().err
    at = Original(whole).chunks[1][0][0] + 200
    (tmp_path / "a_000.mcap").write_bytes(whole[:at] + bytes(60) + whole[at + 60 :])
    assert main(["recover", str(tmp_path / "a_000.mcap"), "--out", str(tmp_path / "b"), "--json"]) == 3
    output = json.loads(capsys.readouterr().out)
    assert not output["complete"] and output["missing_numbers"] and output["out"] == str(tmp_path / "b")
    assert main(["recover", str(tmp_path / "a_000.mcap"), "--out", str(tmp_path / "c")]) == 3
    lines = capsys.readouterr().out
    assert "are lost, after 1970-01-01T00:00:01.0" in lines and "data are missing" in lines
    assert main(["recover", str(tmp_path / "a_000.mcap"), "--in-place"]) == 0
    assert "is finished" in capsys.readouterr().out
    (tmp_path / "a_000.mcap").write_bytes(whole[:at] + bytes([whole[at] ^ 2]) + whole[at + 1 :])
    assert main(["recover", str(tmp_path / "a_000.mcap"), "--out", str(tmp_path / "d")]) == 3
    lines = capsys.readouterr().out
    assert f"a bit of byte {at} was flipped back" in lines and "nothing is missing; not everything is verified" in lines
