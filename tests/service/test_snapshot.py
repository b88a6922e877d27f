"""The snapshot sink: which frames a trigger brings into which file, and what becomes of the others."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti.config import Snapshot
from fti.errors import StorageError
from fti.logger.log_layout import LogSettings
from fti.logger.log_segment import LogSegment
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.service.recorder.snapshot import sink as sink_module
from fti.service.recorder.snapshot.sink import SnapshotSink
from tests.helpers import until

SECOND_NS = 1_000_000_000
MS = 1_000_000


class Rig:
    """A sink with one link, fed by hand with a frame and a tick every 10 ms of FTI time."""

    def __init__(self, folder: Path, before_s: float = 1.0, after_s: float = 0.5, max_mb: float = 64.0) -> None:
        self.folder: SessionFolder | None = SessionFolder.create(folder, "s", 0)
        self.path = self.folder.path
        self.log = RawLog(None, [RawTopic("a", "udp", {})], LogSettings(split_s=1e6, split_mb=1e3), kind="snapshot")
        self.reports: list[str] = []
        self.sink = SnapshotSink(
            self.log,
            ["a"],
            Snapshot(before_s=before_s, after_s=after_s, max_mb=max_mb),
            lambda: self.folder,
            report_event=lambda level, source, text: self.reports.append(f"{level}: {text}"),
            report=lambda unit, error: self.reports.append(f"{unit}: {error!r}"),
        )
        self.fed = 0
        self.sink.start()

    def feed(self, count: int) -> None:
        for n in range(self.fed, self.fed + count):
            self.sink.consumers[0]([(2 * n, n * 10 * MS, b"")])
            self.sink.consumers[1]([(2 * n + 1, n * 10 * MS, b"%d" % n)])
        self.fed += count

    def files(self) -> list[Path]:
        return SessionFolder(self.path).files("snapshot")

    def held(self, file: int = 0) -> list[int]:
        """Which frames of the link are in a file."""
        return [int(frame.data) for frame in Recording.open(self.files()[file]).frames() if frame.link == "a"]

    def await_end(self, shots: int = 1) -> None:
        """The files are closed."""
        until(lambda: sum("holds" in text for text in self.reports) == shots, what=f"{shots} files")


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    result = Rig(tmp_path)
    yield result
    result.sink.stop()


def test_a_trigger_brings_exactly_its_interval_into_a_file(rig: Rig) -> None:
    rig.feed(300)
    rig.sink.trigger("flutter", 2990 * MS)
    rig.feed(200)
    rig.await_end()
    assert rig.held() == list(range(199, 350))
    recording = Recording.open(rig.files()[0])
    assert [f.seq for f in recording.frames()] == list(range(398, 700))
    assert not recording.find_unfinished_files()
    assert recording.frame_files == rig.files()
    (event,) = recording.messages("/fti/event", kind="snapshot")
    assert event[1] == 2990 * MS
    assert b"flutter" in event[4]


def test_another_trigger_while_it_lasts_prolongs_it(rig: Rig) -> None:
    rig.feed(100)
    rig.sink.trigger("one", 990 * MS)
    rig.feed(55)  # to 1540 ms: what is behind 1490 ms has been put aside, or will be
    rig.sink.trigger("two", 1480 * MS)
    rig.feed(150)
    rig.await_end()
    assert rig.held() == list(range(199))
    texts = [data for *_, data in Recording.open(rig.files()[0]).messages("/fti/event", kind="snapshot")]
    assert [b"one" in text or b"two" in text for text in texts] == [True, True]
    assert len(rig.files()) == 1


def test_a_frame_is_written_once_and_a_later_trigger_goes_on_behind(rig: Rig) -> None:
    rig.feed(100)
    rig.sink.trigger("one", 480 * MS)  # to 980 ms
    rig.await_end(1)
    rig.feed(100)
    rig.sink.trigger("two", 1500 * MS)
    rig.feed(100)
    rig.await_end(2)
    assert [path.name for path in rig.files()] == [f"{rig.path.name}_snapshot_{n:03d}.mcap" for n in (0, 1)]
    assert rig.held(0) == list(range(99))
    assert rig.held(0) + rig.held(1) == list(range(201))


def test_every_frame_is_recorded_or_not_triggered(rig: Rig) -> None:
    rig.feed(400)
    rig.sink.trigger("boom", 3990 * MS)
    rig.feed(100)
    rig.await_end()
    rig.feed(77)
    rig.sink.stop()
    for outcome in rig.sink.outcomes[:2]:
        assert outcome.recorded.frames == 151
        assert outcome.not_triggered.frames == 577 - 151
        assert outcome.overflow.frames == 0
    sent = rig.sink.outcomes[2]
    assert sent.recorded.frames == sent.not_triggered.frames == 0
    sizes = [len(b"%d" % n) for n in range(577)]
    outcome = rig.sink.outcomes[1]
    assert outcome.recorded.bytes == sum(sizes[299:450])
    assert outcome.recorded.bytes + outcome.not_triggered.bytes == sum(sizes)


def test_the_end_cuts_what_a_trigger_waits_for(rig: Rig) -> None:
    rig.feed(100)
    rig.sink.trigger("late", 990 * MS)
    rig.sink.stop()
    assert rig.held() == list(range(100))
    assert not Recording.open(rig.files()[0]).find_unfinished_files()
    assert rig.sink.outcomes[1].not_triggered.frames == 0


def test_the_end_waits_as_long_as_the_medium_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Writing minutes of memory to a slow medium takes longer than the timeout of a refusing one."""
    monkeypatch.setattr(sink_module, "FINAL_TIMEOUT_S", 1.0)
    flush = LogSegment.flush

    def slow(segment: LogSegment) -> None:
        time.sleep(0.1)
        flush(segment)

    monkeypatch.setattr(LogSegment, "flush", slow)
    rig = Rig(tmp_path, before_s=1e3)
    rig.feed(1000)
    rig.sink.trigger("at the very end", 9990 * MS)
    rig.sink.stop()
    assert rig.held() == list(range(1000))
    assert rig.sink.outcomes[1].recorded.frames == 1000


def test_what_a_trigger_asked_for_and_the_medium_did_not_take_stays_held(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is a loss, not something for which no trigger came."""

    def refuse(segment: LogSegment) -> None:
        raise StorageError("full")

    monkeypatch.setattr(sink_module, "FINAL_TIMEOUT_S", 0.3)
    monkeypatch.setattr(LogSegment, "flush", refuse)
    rig.feed(300)
    rig.sink.trigger("boom", 2990 * MS)
    rig.sink.stop()
    outcome = rig.sink.outcomes[1]
    assert (outcome.recorded.frames, outcome.overflow.frames) == (0, 0)
    assert outcome.not_triggered.frames == 300 - 101


def test_no_trigger_no_file(rig: Rig) -> None:
    rig.feed(100)
    rig.sink.stop()
    assert rig.files() == []
    assert rig.sink.outcomes[1].not_triggered.frames == 100


def test_a_medium_that_refuses_is_reported_once_and_nothing_is_lost_or_doubled(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    flush, failures = LogSegment.flush, iter(range(3))

    def refuse(segment: LogSegment) -> None:
        if next(failures, None) is not None:
            raise StorageError("full")
        flush(segment)

    monkeypatch.setattr(LogSegment, "flush", refuse)
    rig.feed(100)
    rig.sink.trigger("boom", 990 * MS)
    rig.feed(100)
    rig.await_end()
    assert rig.held() == list(range(150))
    assert sum("full" in text for text in rig.reports) == 1


def test_it_goes_on_where_the_recording_goes_on(rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, other = rig.folder, SessionFolder.create(tmp_path / "other", "s", 0)
    rig.folder = None
    rig.feed(100)
    rig.sink.trigger("boom", 990 * MS)
    until(lambda: any("no storage target" in text for text in rig.reports), what="the refusal")
    rig.folder = first
    until(lambda: rig.sink.outcomes[1].recorded.frames == 100, what="frames in the first file")
    flush = LogSegment.flush

    def refuse_here(segment: LogSegment) -> None:
        if segment.folder == first:
            raise StorageError("sick")
        flush(segment)

    monkeypatch.setattr(LogSegment, "flush", refuse_here)
    rig.feed(20)
    until(lambda: any("sick" in text for text in rig.reports), what="the refusal")
    rig.folder = other
    rig.feed(200)
    rig.await_end()
    assert rig.held() == list(range(100))
    (file,) = other.files("snapshot")
    assert [int(f.data) for f in Recording.open(file).frames() if f.link == "a"] == list(range(100, 150))


def test_a_memory_that_is_too_small_is_reported_once(tmp_path: Path) -> None:
    rig = Rig(tmp_path, before_s=1e4, max_mb=1.0)
    for n in range(3):
        rig.sink.consumers[1]([(n * 100 + k, (n * 100 + k) * MS, bytes(10_000)) for k in range(100)])
        rig.sink.report_overflow()
    rig.sink.stop()
    assert rig.reports == ["warning: snapshot.max_mb holds 0.1 s, not 10000 s"]


def test_feeding_never_waits_for_the_medium(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    hangs, released, flush = threading.Event(), threading.Event(), LogSegment.flush

    def hang(segment: LogSegment) -> None:
        hangs.set()
        assert released.wait(20)
        flush(segment)

    monkeypatch.setattr(LogSegment, "flush", hang)
    rig.feed(10)
    rig.sink.trigger("boom", 90 * MS)
    assert hangs.wait(20)
    rig.feed(1000)  # from this thread: it comes to an end
    rig.sink.trigger("again", 100 * MS)
    assert rig.sink.health().state == "writing"
    released.set()
    rig.await_end()
    assert rig.held() == list(range(61))
