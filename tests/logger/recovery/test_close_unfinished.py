from __future__ import annotations

import contextlib
import os
import random
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from fti.errors import MissingError, RecordingError, StorageError
from fti.logger import records
from fti.logger.log_layout import LogSettings
from fti.logger.metadata_checksum import with_checksums
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.limits import MAX_RECORD
from fti.logger.recovery.close_unfinished import close_all, close_unfinished
from fti.logger.session import SessionFolder
from fti.logger.stream_writer import StreamWriter
from fti.logger.verify.file_check import FileCheck
from tests.logger.official_reader import read_closed, read_stream


def write_killed(path: Path, messages: int = 100, chunk_bytes: int = 1000) -> bytes:
    """A file as a kill leaves it."""
    writer = StreamWriter(path, chunk_bytes=chunk_bytes)
    channel = writer.add_channel("/a", "x")
    for n in range(messages):
        writer.write(channel, n, bytes([n % 256]) * 20, n)
        writer.flush()
    writer.abandon()
    return path.read_bytes()


def chunk_starts(path: Path) -> list[int]:
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary
    return [index.chunk_start_offset for index in summary.chunk_indexes]


def test_a_killed_file_is_closed_once(tmp_path: Path) -> None:
    before = read_stream(write_killed(tmp_path / "a.mcap"))
    closed = close_unfinished(tmp_path / "a.mcap")
    assert closed and (closed.messages, closed.describe_loss()) == (100, "")
    assert read_closed(tmp_path / "a.mcap") == before
    assert close_unfinished(tmp_path / "a.mcap") is None


def test_what_is_no_record_behind_the_last_one_is_kept_beside_the_file(tmp_path: Path) -> None:
    undeclared = records.MESSAGE.pack(records.Op.MESSAGE, records.MESSAGE_BODY, 99, 0, 0, 0)
    noise = random.Random(1).randbytes(3000).replace(b"\x06", b"\x07")
    for garbage in (bytes(5000), b"\x05" * 40, undeclared, noise):
        path = tmp_path / f"{len(garbage)}.mcap"
        before = write_killed(path, messages=110)  # the last chunk is open
        path.write_bytes(before + garbage)
        closed = close_unfinished(path)
        kept = list(tmp_path.glob(f"{len(garbage)}.rest-at-*.bin"))
        assert closed and closed.rest_file == (kept[0] if any(garbage) else None)
        assert [file.read_bytes() for file in kept] == ([garbage] if any(garbage) else [])
        assert closed.describe_loss() and closed.missing_bytes == (0 if any(garbage) else len(garbage))
        assert read_closed(path) == read_stream(before)


def test_a_kept_rest_is_never_replaced_and_no_link_is_followed(tmp_path: Path) -> None:
    """What an earlier repair saved stays; a link that a stick brought leads nowhere."""
    path, other = tmp_path / "a.mcap", tmp_path / "other"
    before = write_killed(path, messages=110)
    garbage = bytes([255]) * 40
    path.write_bytes(before + garbage)
    earlier = tmp_path / f"a.rest-at-{len(before)}.bin"
    earlier.write_bytes(b"saved by an earlier repair")
    other.write_bytes(b"of somebody else")
    (tmp_path / f".a.rest-at-{len(before)}-2.bin.part").symlink_to(other)
    closed = close_unfinished(path)
    assert closed and closed.rest_file == tmp_path / f"a.rest-at-{len(before)}-2.bin"
    assert closed.rest_file.read_bytes() == garbage and closed.rest_file.stat().st_mode & 0o777 == 0o640
    assert (earlier.read_bytes(), other.read_bytes()) == (b"saved by an earlier repair", b"of somebody else")


def test_more_behind_the_records_than_is_read_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    size = len(write_killed(path, messages=110)) + MAX_RECORD + 1
    os.truncate(path, size)
    with pytest.raises(RecordingError, match="it is left as it is"):
        close_unfinished(path)
    assert path.stat().st_size == size


def write_synced(path: Path, messages: int, every: int) -> bytes:
    """An open chunk with a checkpoint after so many messages; killed."""
    writer = StreamWriter(path, chunk_bytes=10**6)
    channel = writer.add_channel("/a", "x")
    for n in range(messages):
        writer.write(channel, n, bytes([n % 251 + 1]) * 20, n)
        writer.flush()
        if n % every == every - 1:
            writer.sync()
    writer.abandon()
    return path.read_bytes()


def test_a_hole_behind_the_last_sync_costs_what_is_behind_it(tmp_path: Path) -> None:
    """A power cut: the head of the chunk reached the medium, a page of its records did not."""
    path = tmp_path / "a.mcap"
    whole = write_synced(path, messages=330, every=100)
    data = bytearray(whole)
    begin = data.rindex(bytes([311 % 251 + 1]) * 20) - 10  # the hole begins in the record before
    data[begin : begin + 400] = bytes(400)
    path.write_bytes(data)
    closed = close_unfinished(path)
    messages = read_closed(path)
    assert messages == read_stream(whole)[:311] and closed
    assert (closed.unverified, closed.unverified_ns) == (11, 300)
    kept = tmp_path / f"a.rest-at-{len(data) - closed.rest_bytes}.bin"
    assert closed.rest_file == kept and bytes(data).endswith(kept.read_bytes()) and closed.rest_bytes > 900


def test_zeros_to_the_end_are_counted_as_missing(tmp_path: Path) -> None:
    """A power cut: size and head of the chunk reached the medium, all pages behind the last sync did not."""
    path = tmp_path / "a.mcap"
    whole = write_synced(path, messages=330, every=100)
    missing = 30 * (records.MESSAGE.size + 20)
    path.write_bytes(whole[:-missing] + bytes(missing))
    proof = FileCheck(path)
    assert [len(page.rows[0][1]) for page in proof.pages()] == [300]
    assert [*proof.warnings, *proof.end_warnings] == [
        f"{missing} bytes at its end are missing or damaged"
    ] and not proof.verified
    closed = close_unfinished(path)
    assert closed and (closed.unverified, closed.missing_bytes, closed.rest_file) == (0, missing, None)
    assert f"{missing} bytes at its end" in closed.describe_loss() and read_closed(path) == read_stream(whole)[:300]
    proof = FileCheck(path)
    assert [len(page.rows[0][1]) for page in proof.pages()] == [300]
    assert [*proof.warnings, *proof.end_warnings] == [
        f"was closed later: {missing} bytes at its end were missing or damaged"
    ]


def test_a_cut_within_a_sync_is_a_loss_and_no_contradiction(tmp_path: Path) -> None:
    """The checkpoint of the last sync reached the medium, its records did not: verify must not refute what is left."""
    path = tmp_path / "a.mcap"
    whole = write_synced(path, messages=300, every=100)
    missing = 100 * (records.MESSAGE.size + 20)
    for rest in (b"", bytes(missing)):
        path.write_bytes(whole[:-missing] + rest)
        closed = close_unfinished(path)
        assert closed and (closed.messages, closed.unverified, closed.missing_bytes) == (200, 0, missing)
        proof = FileCheck(path)
        assert [len(page.rows[0][1]) for page in proof.pages()] == [200]
        assert proof.faults == [] and len([*proof.warnings, *proof.end_warnings]) == 1


def test_a_hole_before_the_last_sync_is_reported_and_nothing_is_touched(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    data = bytearray(write_synced(path, messages=330, every=100))
    data[8192:12288] = bytes(4096)
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"a\.mcap: is damaged: the chunk at byte \d+: the checksum"):
        close_unfinished(path)
    assert path.read_bytes() == bytes(data) and [file.name for file in tmp_path.iterdir()] == ["a.mcap"]


def test_a_flipped_length_in_an_open_chunk_removes_nothing(tmp_path: Path) -> None:
    """The walk ended there, and the next start cut all that was behind it."""
    whole = write_synced(tmp_path / "a.mcap", messages=330, every=100)
    path = tmp_path / "b.mcap"
    begin = whole.index(bytes([1]) * 20) - records.MESSAGE.size
    for message in (0, 1, 50, 150, 299):
        data = bytearray(whole)
        data[begin + message * (records.MESSAGE.size + 20) + 1] ^= 0x10
        path.write_bytes(data)
        with pytest.raises(RecordingError, match="it is left as it is"):
            close_unfinished(path)
        assert path.read_bytes() == bytes(data)


def test_what_a_kill_leaves_is_verified_up_to_the_last_flush(tmp_path: Path) -> None:
    """The head of an open chunk has a checksum: an altered message is found, not sealed."""
    path = tmp_path / "a.mcap"
    whole = write_synced(path, messages=330, every=10**6)
    closed = close_unfinished(path)
    assert closed and (closed.messages, closed.unverified) == (330, 0)
    data = bytearray(whole)
    data[data.index(bytes([7]) * 20) + 3] ^= 1
    path.write_bytes(data)
    closed = close_unfinished(path)
    assert closed and closed.unverified == 330 and closed.unverified_ns == 0  # never synced


def test_a_kill_while_a_file_is_begun_is_no_damage(tmp_path: Path) -> None:
    folder = SessionFolder.create(tmp_path, "s", 0)
    text = ("config.toml", "text/plain", b"[session]")
    log = RawLog(
        folder, [RawTopic("a", "udp", {})], LogSettings(split_s=1, split_mb=1, attachments=[text], metadata={"fti": {}})
    )
    log.close()
    with log.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary
    (attachment,), begun = summary.attachment_indexes, log.path.read_bytes()
    for size in range(attachment.offset + attachment.length):
        path = tmp_path / f"{size}.mcap"
        path.write_bytes(begun[:size])
        closed = close_unfinished(path)
        assert closed and closed.messages == 0
        proof = FileCheck(path)
        assert [*proof.pages()] == [] and proof.faults == [] and proof.finished


def test_altered_metadata_of_an_unfinished_file_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = StreamWriter(path)
    for name, table in with_checksums("fti.file", {"fti.file": {"kind": "raw"}, "fti": {"name": "da42"}}).items():
        writer.add_metadata(name, table)
    writer.flush()
    writer.abandon()
    data = path.read_bytes().replace(b"da42", b"da43")
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="the checksum of its metadata fti does not match"):
        close_unfinished(path)
    assert path.read_bytes() == data


def test_a_file_damaged_in_its_middle_is_left_alone(tmp_path: Path) -> None:
    for place in (0, 60, 500):  # the head of a chunk, its records
        path = tmp_path / f"{place}.mcap"
        whole = write_killed(path)
        (tmp_path / "copy.mcap").write_bytes(whole)
        close_unfinished(tmp_path / "copy.mcap")
        data = bytearray(whole)
        data[chunk_starts(tmp_path / "copy.mcap")[1] + place] ^= 0xFF
        path.write_bytes(data)
        with pytest.raises(RecordingError, match=r"is damaged: .*; it is left as it is, see: fti recover"):
            close_unfinished(path)
        assert path.read_bytes() == bytes(data)


def test_a_recording_joined_behind_a_finished_one_is_left_alone(tmp_path: Path) -> None:
    """The rest of a summary cannot hold a chunk: what follows is another recording, whose records are no torn end."""
    write_killed(tmp_path / "a.mcap")
    close_unfinished(tmp_path / "a.mcap")
    killed = write_killed(tmp_path / "b.mcap", messages=7, chunk_bytes=10**6)
    joined = tmp_path / "joined.mcap"
    for cut in (0, 3):  # the first one as it was finished, or with a torn end
        data = (tmp_path / "a.mcap").read_bytes()
        joined.write_bytes(data[: len(data) - cut] + killed)
        before = joined.read_bytes()
        with pytest.raises(RecordingError, match="it is left as it is"):
            close_unfinished(joined)
        assert joined.read_bytes() == before and not list(tmp_path.glob("*.bin"))
        proof = FileCheck(joined)
        assert sum(len(page.rows[0][1]) for page in proof.pages()) == 100 and proof.faults


def test_foreign_files_are_left_alone(tmp_path: Path) -> None:
    with (tmp_path / "other.mcap").open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.LZ4)
        writer.start()
        channel = writer.register_channel("/a", "x", 0)
        writer.add_message(channel, 1, b"data", 1)
        writer.finish()  # type: ignore[no-untyped-call]
    whole = (tmp_path / "other.mcap").read_bytes()
    (tmp_path / "other.mcap").write_bytes(whole[:-40])
    (tmp_path / "text.mcap").write_bytes(b"hello")
    for name in ("other", "text"):
        with pytest.raises(RecordingError, match="was not written by this program"):
            close_unfinished(tmp_path / f"{name}.mcap")
    assert (tmp_path / "other.mcap").read_bytes() == whole[:-40]


def test_missing_and_protected_files_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MissingError, match=r"no\.mcap: cannot be read"):
        close_unfinished(tmp_path / "no.mcap")
    write_killed(tmp_path / "a.mcap")
    real = os.open

    def refuse(path: Any, flags: int, *rest: Any) -> int:
        if flags & os.O_RDWR:
            raise PermissionError(13, "Permission denied")
        return real(path, flags, *rest)

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(StorageError, match="cannot be opened for writing: Permission denied"):
        close_unfinished(tmp_path / "a.mcap")


def test_a_repair_that_is_killed_can_be_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = write_killed(tmp_path / "a.mcap", messages=30, chunk_bytes=600) + b"\x05\x10"
    expected, path = read_stream(whole), tmp_path / "b.mcap"
    pwrite = os.pwrite
    for allowed in range(0, 900, 7):
        path.write_bytes(whole)
        left = [allowed]

        def write(fd: int, data: Any, offset: int, left: list[int] = left) -> int:
            if not left[0]:
                raise OSError(28, "No space left on device")
            part = min(left[0], len(data))
            left[0] -= part
            return pwrite(fd, data[:part], offset)

        with monkeypatch.context() as patch:
            patch.setattr(os, "pwrite", write)
            try:
                close_unfinished(path)
            except StorageError as error:
                assert "No space left" in str(error)
        close_unfinished(path)
        assert read_closed(path) == expected


def test_an_interrupted_repair_can_be_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second Ctrl-C, before each step that changes the file."""
    whole = write_killed(tmp_path / "a.mcap", messages=30, chunk_bytes=600) + b"\x05\x10"
    expected, path = read_stream(whole), tmp_path / "b.mcap"
    interrupted = 0
    for name in ("ftruncate", "pwrite", "fsync"):
        for allowed in range(2):
            path.write_bytes(whole)
            real, left = getattr(os, name), [allowed]

            def step(*args: Any, real: Any = real, left: list[int] = left) -> Any:
                if not left[0]:
                    raise KeyboardInterrupt
                left[0] -= 1
                return real(*args)

            with monkeypatch.context() as patch, contextlib.suppress(KeyboardInterrupt):
                patch.setattr(os, name, step)
                close_unfinished(path)
                interrupted -= 1
            interrupted += 1
            close_unfinished(path)
            assert read_closed(path) == expected
    assert interrupted >= 4


def test_close_all_leaves_running_sessions_alone(tmp_path: Path) -> None:
    for name in ("killed", "running", "used", "damaged", "finished"):
        (tmp_path / name).mkdir()
        write_killed(tmp_path / name / "a.mcap")
    close_unfinished(tmp_path / "finished" / "a.mcap")
    (tmp_path / "damaged" / "a.mcap").write_bytes(b"nonsense")
    writer = StreamWriter(tmp_path / "running" / "b.mcap")
    closed = close_all(tmp_path, in_use=[tmp_path / "used"])
    assert {c.path.parent.name: c.fault is None for c in closed} == {"killed": True, "running": True, "damaged": False}
    assert [c.path.name for c in closed if c.path.parent.name == "running"] == ["a.mcap"]
    writer.close()
    assert close_all(tmp_path / "nowhere") == []
