from __future__ import annotations

import errno
import json
import os
import random
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType

from fti.errors import RecordingError, StorageError
from fti.logger.packing.pack import pack, unpack
from fti.logger.reading.mcap_file import McapFile
from fti.logger.recovery.close_unfinished import close_all, close_unfinished
from fti.logger.stream_writer import StreamWriter
from tests.logger.damaged_recordings import recover, write_foreign, write_own
from tests.logger.official_reader import read_closed, read_stream


def progress(_: int) -> None:
    """Nobody watches."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_own(tmp_path / "a.mcap", messages=400, chunk_bytes=4000)
    return tmp_path / "a.mcap"


def alone(path: Path) -> bool:
    """Is there nothing else in the folder?"""
    return list(path.parent.iterdir()) == [path]


def test_a_packed_file_reads_the_same_and_becomes_the_same_again(path: Path) -> None:
    path.chmod(0o640)
    whole, messages, file = path.read_bytes(), read_closed(path), McapFile(path)
    items, head = list(file.items()), file.head()
    done = pack(path, progress)
    assert done and (done.before, done.after) == (len(whole), path.stat().st_size)
    assert done.after < done.before * 0.7
    assert read_closed(path) == messages == read_stream(path.read_bytes())
    packed = McapFile(path)
    assert (list(packed.items()), packed.head(), packed.fault, packed.is_finished()) == (items, head, None, True)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary
        assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
        assert summary.statistics and summary.statistics.attachment_count == len(summary.attachment_indexes) == 2
        reader = make_reader(stream)
        assert {a.name: a.data for a in reader.iter_attachments()}["config.toml"] == b"name = 1\n"
        assert {m.name: m.metadata for m in reader.iter_metadata()}["fti"] == {"name": "small"}
    assert pack(path, progress) is None
    assert unpack(path, progress)
    assert path.read_bytes() == whole
    assert path.stat().st_mode & 0o777 == 0o640
    assert unpack(path, progress) is None
    assert alone(path)


@pytest.mark.parametrize("messages", [0, 1, 7])
def test_small_files_and_closed_ones_come_back(tmp_path: Path, messages: int) -> None:
    """Also one that a kill left open and repair closed."""
    path = tmp_path / "a.mcap"
    write_own(path, messages=messages, finish=messages != 7)
    close_unfinished(path)
    whole = path.read_bytes()
    assert pack(path, progress)
    assert len(read_closed(path)) == len(read_stream(whole))
    unpack(path, progress)
    assert path.read_bytes() == whole


@pytest.mark.parametrize("compression", CompressionType)
def test_foreign_files_come_back(tmp_path: Path, compression: CompressionType) -> None:
    path = tmp_path / "a.mcap"
    whole = write_foreign(path, compression)
    messages = read_closed(path)
    assert pack(path, progress)
    assert read_closed(path) == messages
    unpack(path, progress)
    assert path.read_bytes() == whole


def test_what_is_not_finished_is_refused_with_advice(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    whole = write_own(path, finish=False)
    with pytest.raises(RecordingError, match=r"is not finished; .*fti recover .*a\.mcap --in-place"):
        pack(path, progress)
    writer = StreamWriter(tmp_path / "b.mcap")
    with pytest.raises(RecordingError, match="is not finished"):
        pack(tmp_path / "b.mcap", progress)
    writer.close()
    assert path.read_bytes() == whole


def test_a_file_that_another_process_holds_is_refused(path: Path) -> None:
    import fcntl

    with path.open("rb") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        with pytest.raises(StorageError, match="is being written by another process"):
            pack(path, progress)


def test_damaged_files_are_refused_and_left_alone(path: Path, scale: int) -> None:
    whole, flips = path.read_bytes(), random.Random(3)
    packed = refused = 0
    for _ in range(200 * scale):
        data = bytearray(whole)
        data[flips.randrange(len(data))] ^= 1 << flips.randrange(8)
        path.write_bytes(data)
        try:
            pack(path, progress)
            unpack(path, progress)
            packed += 1
        except RecordingError:
            refused += 1
        assert path.read_bytes() == data
        assert alone(path)
    assert refused > packed


def test_a_damaged_packed_file_is_never_unpacked_to_other_bytes(path: Path, scale: int) -> None:
    whole, flips = path.read_bytes(), random.Random(4)
    pack(path, progress)
    packed = path.read_bytes()
    refused = 0
    for _ in range(200 * scale):
        data = bytearray(packed)
        data[flips.randrange(len(data))] ^= 1 << flips.randrange(8)
        path.write_bytes(data)
        try:
            done = unpack(path, progress)
            assert path.read_bytes() == (whole if done else data)
        except RecordingError:
            assert path.read_bytes() == data
            refused += 1
    assert refused > 100 * scale


def test_a_full_medium_leaves_the_original(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = path.read_bytes()
    real, synced = os.fsync, [0]

    def full(fd: int) -> None:
        synced[0] += 1
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match=r"cannot be rewritten: No space left on device; the file is unchanged"):
        pack(path, progress)
    monkeypatch.setattr(os, "fsync", real)
    assert synced == [1] and path.read_bytes() == whole and alone(path)


def test_an_interruption_anywhere_leaves_one_of_the_two(path: Path) -> None:
    whole, count = path.read_bytes(), 0
    pack(path, lambda _: None)
    packed = path.read_bytes()
    for work, before in ((unpack, packed), (pack, whole)):
        for interrupted_at in range(0, 40, 3):
            path.write_bytes(before)
            calls = [0]

            def interrupt(_: int, calls: list[int] = calls, at: int = interrupted_at) -> None:
                calls[0] += 1
                if calls[0] > at:
                    raise KeyboardInterrupt

            try:
                work(path, interrupt)
            except KeyboardInterrupt:
                count += 1
                assert path.read_bytes() == before
            assert alone(path)
    assert count > 15


def test_a_kill_anywhere_leaves_one_of_the_two(tmp_path: Path, scale: int) -> None:
    """And the next run removes what it left."""
    path, delays = tmp_path / "a.mcap", random.Random(5)
    whole = write_own(path, messages=20_000, chunk_bytes=20_000)
    code = "import sys; from pathlib import Path; from fti.logger.packing.pack import pack, unpack\n"
    code += (
        "print(1, flush=True)\n"
        "for _ in range(50):\n    pack(Path(sys.argv[1]), lambda _: None); unpack(Path(sys.argv[1]), lambda _: None)"
    )
    left = 0
    for _ in range(4 * scale):
        process = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE)
        assert process.stdout and process.stdout.readline()
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=delays.uniform(0.0, 0.3))
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        left += not alone(path)
        if path.read_bytes() != whole:
            assert unpack(path, progress)
        assert path.read_bytes() == whole
        pack(path, progress)
        assert alone(path)
    assert left


def test_repair_leaves_packed_and_recovered_files_alone(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    folder.mkdir()
    data = write_own(folder / "packed.mcap")
    recover(data[:-100], tmp_path)
    (tmp_path / "recovered.mcap").rename(folder / "recovered.mcap")
    pack(folder / "packed.mcap", progress)
    before = {path: path.read_bytes() for path in folder.iterdir()}
    assert close_all(tmp_path) == []
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_a_packed_file_that_is_damaged_is_recovered(path: Path, tmp_path: Path) -> None:
    messages = read_closed(path)
    pack(path, progress)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    found, report = recover(bytes(data), tmp_path)
    assert 0 < len(messages) - len(found) == report.missing_messages
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(RecordingError, match="has a compressed chunk"):
        close_unfinished(path)


def test_the_command(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from fti.cli.main import main

    whole = path.read_bytes()
    write_own(path.parent / "b_001.mcap", finish=False)
    assert main(["pack", str(path.parent), "--json"]) == 3
    out, err = capsys.readouterr()
    report: dict[str, Any] = json.loads(out)
    assert [entry["before"] for entry in report["files"]] == [len(whole)] and len(report["refused"]) == 1
    assert "b_001.mcap: is not finished" in err
    assert main(["pack", str(path), "--undo"]) == 0
    assert "times more" in capsys.readouterr().out
    assert path.read_bytes() == whole
    assert main(["pack", str(path.parent / "none")]) == 2
