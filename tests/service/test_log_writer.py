"""The writer thread: failures are reported, and each entry is written exactly once."""

from __future__ import annotations

import errno
import json
import math
import os
import threading
from pathlib import Path
from typing import Any

import pytest

from fti.buffers.triple_buffer import TripleBuffer
from fti.logger.log_layout import LogSettings
from fti.logger.log_segment import LogSegment
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.logger.storage_target import StorageTarget
from fti.service.recorder.log_source import LogSource
from fti.service.recorder.log_writer import LogWriter
from tests.helpers import until


class Rig:
    """A writer with one link."""

    def __init__(self, folder: Path, split_s: float = 300) -> None:
        self.folder = SessionFolder.create(folder, "s", 0)
        self.log = RawLog(None, [RawTopic("a", "udp", {})], LogSettings(split_s=split_s, split_mb=100))
        self.buffer = TripleBuffer()
        self.reports: list[str] = []
        source = LogSource("a", self.log.channels("a")[0], self.buffer)
        places = [StorageTarget.of(self.folder.path)]
        self.writer = LogWriter(self.log, [source], places, 0.0, lambda unit, e: self.reports.append(f"{unit}: {e}"))

    def start(self) -> None:
        """Begin, and wait for the file."""
        self.writer.poll_storage()
        until(lambda: self.writer.file, what="a file")

    def finish(self) -> list[int]:
        """End it; the numbers that are in the file."""
        self.writer.stop()
        self.writer.finish()
        recording = Recording.open(self.folder.path)
        assert not recording.find_unfinished_files()
        return [frame.seq for frame in recording.frames()]


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    return Rig(tmp_path)


def test_a_note_that_cannot_be_written_spoils_nothing_else(rig: Rig) -> None:
    rig.buffer.put(0, 1, b"x")
    rig.writer.add_note("/no/topic", 1, {})
    rig.start()
    until(lambda: rig.buffer.is_empty, what="an empty buffer")
    rig.writer.add_note("/no/topic", 1, {})
    rig.buffer.put(1, 2, b"x")
    assert rig.finish() == [0, 1]
    assert len(rig.reports) == 2
    assert all(report.startswith("note: '/no/topic' is not a topic of notes") for report in rig.reports)


def test_a_flush_that_fails_in_an_unknown_way_writes_nothing_twice(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    flush, failures = LogSegment.flush, iter(range(3))

    def fail(segment: LogSegment, **options: bool) -> None:
        if next(failures, None) is not None:
            raise RuntimeError("sick")
        flush(segment, **options)

    monkeypatch.setattr(LogSegment, "flush", fail)
    for seq in range(3):
        rig.buffer.put(seq, seq, b"x")
    rig.start()
    until(lambda: rig.buffer.is_empty, what="an empty buffer")
    assert rig.finish() == [0, 1, 2]
    assert rig.reports == ["writer: sick"] * 3


def test_when_the_next_file_cannot_be_made_recording_goes_on_and_it_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig(tmp_path, split_s=1e-6)
    real = os.open

    def refuse(path: Any, flags: int, *rest: Any) -> int:
        if flags & os.O_CREAT:
            raise FileNotFoundError(2, "No such file or directory")
        return real(path, flags, *rest)

    rig.start()
    with monkeypatch.context() as patch:
        patch.setattr(os, "open", refuse)
        for seq in range(5):
            rig.buffer.put(seq, seq * 10_000, b"x")
            until(lambda: rig.buffer.is_empty, what="an empty buffer")
        assert "cannot be created" in str(rig.writer.state()[1])
        rig.writer.stop()
    rig.writer.finish()
    assert [frame.seq for frame in Recording.open(rig.folder.path).frames()] == list(range(5))


def test_the_stated_stall_is_survived_and_then_the_oldest_frames_are_missing_and_reported(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """T10 (Spiegel 2018, eq. 6.2): 100 Hz, 66 B in two receptions, 2^19 B: 121.5 s; the same bytes, faster."""
    half, first, pwrite, refused = bytes(33), 1, os.pwrite, threading.Event()

    def refuse(*_: Any) -> int:
        refused.set()
        raise OSError(errno.EIO, "refused by the test")

    def put(begin: int, count: int) -> None:
        for seq in range(begin, begin + count):
            rig.buffer.put(seq, 5_000_000 * seq, half)

    rig.start()
    monkeypatch.setattr(os, "pwrite", refuse)
    put(0, first)
    assert refused.wait(20)  # this frame is in the hands of storage, and the stall begins
    survived = 2 * math.floor(100 * rig.buffer.capacity_s(100, 66, 2))
    assert survived / 200 == pytest.approx(121.5, abs=0.05)
    put(first, survived)
    assert rig.buffer.stats.dropped_frames == 0
    too_many = 500
    put(first + survived, too_many)
    monkeypatch.setattr(os, "pwrite", pwrite)
    recorded = rig.finish()
    gone = range(first + 2**19 // 41, first + 2**19 // 41 + too_many)  # the oldest that had not been handed over
    assert recorded == [seq for seq in range(first + survived + too_many) if seq not in gone]
    (note,) = Recording.open(rig.folder.path).messages("/fti/gap", "raw")
    assert json.loads(note[-1]) == {
        "t_ns": 5_000_000 * gone[-1],
        "kind": "buffer_overflow",
        "link": "a",
        "first_seq": gone[0],
        "last_seq": gone[-1],
        "first_t_ns": 5_000_000 * gone[0],
        "last_t_ns": 5_000_000 * gone[-1],
        "frames": too_many,
        "bytes": too_many * 33,
    }
