"""The writer on media that refuse, hang, vanish and return: what the buffers held is in the files, each number once."""

from __future__ import annotations

import errno
import json
import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fti.buffers.triple_buffer import TripleBuffer
from fti.logger import storage
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.reading.session_metadata import remarks
from fti.logger.session import Numbering, name_parts
from fti.logger.storage import OpenAttempt, StorageState
from fti.logger.storage_target import StorageTarget
from fti.logger.verify.report import Check, CheckResult
from fti.logger.verify.verification import verify
from fti.service.recorder import log_writer
from fti.service.recorder.log_source import LogSource
from fti.service.recorder.log_writer import LogWriter, WriterThread
from tests.helpers import until

ONE_FILE_S = 1000.0  # no file is split before
ERRORS = {"full": errno.ENOSPC, "read-only": errno.EROFS, "broken": errno.EIO}
STATUS = st.sampled_from(["good", "stuck", *ERRORS])


class Media:
    """Stands between the program and the folders: each can refuse every call that changes it, or hold it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.status: dict[Path, str] = {}
        for name in ("pwrite", "ftruncate", "fdatasync"):
            monkeypatch.setattr(os, name, self._watched(getattr(os, name)))
        real_open = os.open

        def watched_open(path: Any, flags: int, *rest: Any, **more: Any) -> int:
            if flags & os.O_CREAT:
                self._pass(str(path))
            return real_open(path, flags, *rest, **more)

        monkeypatch.setattr(os, "open", watched_open)

    def _watched(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def watched(fd: int, *rest: Any) -> Any:
            self._pass(str(Path(f"/proc/self/fd/{fd}").readlink()))
            return call(fd, *rest)

        return watched

    def _pass(self, path: str) -> None:
        while (status := self._of(path)) == "stuck":
            time.sleep(0.002)
        if status in ERRORS:
            raise OSError(ERRORS[status], os.strerror(ERRORS[status]))

    def _of(self, path: str) -> str:
        return next((status for folder, status in self.status.items() if path.startswith(str(folder))), "good")


class Rig:
    """A writer with one link, a main place and perhaps a fallback."""

    def __init__(
        self,
        media: Media,
        roots: list[Path],
        capacity: int = 2**19,
        split_s: float = 1e-7,
        status: tuple[str, ...] = ("good", "good"),
    ) -> None:
        """status : what each medium does before the first file is opened"""
        self._media = media
        self._roots = roots
        self.set(*status[: len(roots)])
        self.folders = [root / "s_0" for root in roots]
        links = [RawTopic("a", "udp", {})]
        self.log = RawLog(
            None, links, LogSettings(split_s=split_s, split_mb=100, folders=self.folders), numbering=Numbering()
        )
        self.buffer = TripleBuffer(capacity)
        self.reports: list[str] = []
        source = LogSource("a", self.log.channels("a")[0], self.buffer)
        places = [StorageTarget.of(folder) for folder in self.folders]
        self.writer = LogWriter(self.log, [source], places, 0.0, self._report)
        self.seq = 0
        self._ended = False
        self._stop = threading.Event()
        self._tending = threading.Thread(target=self._tend, name="tending")
        self._tending.start()

    def set(self, *status: str) -> None:
        """Set the state of the media."""
        self._media.status = dict(zip(self._roots, status, strict=True))

    def _report(self, unit: str, error: Exception) -> None:
        self.reports.append(f"{unit}: {error}")

    def _tend(self) -> None:
        while not self._stop.wait(0.003):
            self.writer.poll_storage()

    def feed(self, count: int) -> None:
        """Frames, and time to do something with them."""
        for _ in range(count):
            self.buffer.put(self.seq, self.seq * 10, b"%09d" % self.seq)
            self.seq += 1
            self._stop.wait(0.001)

    def state(self) -> StorageState:
        return self.writer.state()[0]

    def wait_for(self, state: StorageState) -> None:
        until(lambda: self.state() is state, what=state)

    def settle(self) -> None:
        """All media good: until everything is written."""
        self.set(*["good"] * len(self.folders))
        until(lambda: self.buffer.is_empty and self.writer.file, what="empty buffers")

    def finish(self, *, away: bool = False) -> list[int]:
        """End; the numbers in the files, each once.  away : some files lie in a folder that was renamed"""
        self.close()
        found = [folder for folder in self.folders if any(folder.glob("*.mcap"))]
        recording = Recording.open(*found)
        numbers = [name_parts(path)[1] for path in recording.raw_files]
        assert len(set(numbers)) == len(numbers)
        assert away or check_of(recording, "splits").result in (CheckResult.OK, CheckResult.NOTE)
        firsts = [numbers_in(path)[:1] for path in recording.raw_files]
        assert sorted(first for first in firsts if first) == [first for first in firsts if first]
        frames = list(recording.frames())
        assert all(frame.data == b"%09d" % frame.seq for frame in frames)
        return [frame.seq for frame in frames]

    def close(self) -> None:
        """End everything."""
        if not self._ended:
            self._ended = True
            self.set(*["good"] * len(self.folders))
            self.end_tending()
            self.writer.stop()
            self.writer.finish()

    def end_tending(self) -> None:
        """No attempt begins any more but those of the writer's end."""
        self._stop.set()
        self._tending.join()


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Everything fifty times as fast as it is."""
    for module, names in (
        (
            storage,
            ("SLOW_S", "WRITE_TIMEOUT_S", "RETRY_PERIOD_S", "MIN_RETURN_DELAY_S", "MAX_RETURN_DELAY_S", "MIN_STABLE_S"),
        ),
        (log_writer, ("RETRY_S", "SYNC_PERIOD_S")),
    ):
        for name in names:
            monkeypatch.setattr(module, name, getattr(module, name) / 50)
    return monkeypatch


@pytest.fixture
def make(quick: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[..., Rig]]:
    """Makes a rig on as many media as are wanted; ends it."""
    media = Media(quick)
    rigs: list[Rig] = []

    def make_rig(places: int = 2, **options: Any) -> Rig:
        folders = [tmp_path / f"{len(rigs)}_{place}" for place in ("main", "fallback")[:places]]
        for folder in folders:
            folder.mkdir()
        rigs.append(Rig(media, folders, **options))
        return rigs[-1]

    yield make_rig
    for rig in rigs:
        rig.close()


@pytest.mark.parametrize("how", ["stuck", *ERRORS])
def test_it_goes_to_the_fallback_and_comes_back(make: Callable[..., Rig], how: str) -> None:
    rig = make()
    rig.settle()
    rig.feed(20)
    rig.set(how, "good")
    rig.wait_for(StorageState.FALLBACK)
    rig.feed(20)
    until(lambda: rig.buffer.is_empty, what="an empty buffer")
    assert any(rig.folders[1].glob("*.mcap"))
    rig.set("good", "good")
    until(lambda: rig.writer.file and rig.writer.file.parent == rig.folders[0], what="the main medium")
    rig.feed(20)
    assert rig.finish() == list(range(60))
    assert all(any(folder.glob("*.mcap")) for folder in rig.folders)


@pytest.mark.parametrize("how", ["stuck", *ERRORS])
@pytest.mark.parametrize("begun", [True, False])
def test_without_another_medium_the_buffers_hold(make: Callable[..., Rig], how: str, begun: bool) -> None:
    rig = make(1, status=("good" if begun else how,))
    if begun:
        until(lambda: rig.writer.file, what="a file")
        rig.feed(20)
        rig.set(how)
    rig.feed(20)
    rig.wait_for(StorageState.ERROR)
    assert rig.writer.silence_s > 0
    rig.settle()
    rig.feed(20)
    assert rig.finish() == list(range(60 if begun else 40))


def check_of(recording: Recording, name: str) -> Check:
    """One check of ``fti verify``."""
    return next(check for check in verify(recording).checks if check.name == name)


def test_the_number_of_a_file_that_was_not_opened_in_time_is_stated(make: Callable[..., Rig]) -> None:
    rig = make(split_s=ONE_FILE_S, status=("stuck", "good"))
    rig.wait_for(StorageState.FALLBACK)
    rig.feed(20)
    until(lambda: rig.buffer.is_empty, what="an empty buffer")
    assert rig.finish() == list(range(20))
    recording = Recording.open(*(folder for folder in rig.folders if any(folder.glob("*.mcap"))))
    assert 0 not in {name_parts(path)[1] for path in recording.raw_files}
    splits = check_of(recording, "splits")
    assert splits.result is CheckResult.NOTE and "raw numbers 0 were skipped" in splits.lines[0][1]
    assert not list(remarks(recording))
    recording.raw_files[0].rename(recording.raw_files[0].with_name(f"{recording.session}_007.mcap"))
    moved = Recording.open(*(folder for folder in rig.folders if any(folder.glob("*.mcap"))))
    assert any("raw files 1-6 are missing" in text for _, text in check_of(moved, "splits").lines)  # not stated


def test_a_file_that_was_opened_too_late_gets_a_number_behind_those_that_were_written(
    make: Callable[..., Rig], quick: pytest.MonkeyPatch
) -> None:
    rig = make(split_s=ONE_FILE_S, status=("stuck", "good"))
    rig.wait_for(StorageState.FALLBACK)
    rig.feed(20)
    until(lambda: rig.buffer.is_empty, what="an empty buffer")
    rig.set("stuck", "broken")
    rig.feed(5)
    rig.wait_for(StorageState.ERROR)
    rig.set("good", "broken")  # now the first file is open, and would be welcome
    until(lambda: rig.buffer.is_empty, what="an empty buffer")
    assert rig.writer.file and rig.writer.file.parent == rig.folders[0]
    assert name_parts(rig.writer.file)[1] > 1
    assert rig.finish() == list(range(25))


def test_what_no_buffer_could_hold_is_counted(make: Callable[..., Rig]) -> None:
    rig = make(1, capacity=300)
    rig.settle()
    rig.set("full")
    rig.wait_for(StorageState.ERROR)
    rig.feed(200)
    rig.settle()
    stats = rig.buffer.stats
    found = rig.finish()
    assert stats.dropped_frames > 100
    assert len(found) == stats.frames_out == 200 - stats.dropped_frames
    assert found[-1] == 199


def test_a_folder_that_is_moved_away_is_made_again(make: Callable[..., Rig], quick: pytest.MonkeyPatch) -> None:
    for name in ("SLOW_S", "WRITE_TIMEOUT_S", "RETRY_PERIOD_S"):  # a short hang on a busy machine is not a blocked disk
        quick.setattr(storage, name, getattr(storage, name) * 50)
    rig = make(1)
    rig.settle()
    rig.feed(20)
    away = rig.folders[0].with_name("away")
    rig.folders[0].rename(away)
    rig.feed(20)
    until(lambda: rig.writer.file and rig.writer.file.exists(), what="a file in its place")
    rig.feed(20)
    rig.close()
    for file in away.iterdir():
        file.rename(rig.folders[0] / file.name)
    assert rig.finish() == list(range(60))
    assert not Recording.open(rig.folders[0]).find_unfinished_files()


def test_a_deleted_file_is_written_again(make: Callable[..., Rig]) -> None:
    rig = make(1, split_s=ONE_FILE_S)
    rig.settle()
    rig.feed(20)
    before = until(lambda: rig.writer.file, what="a file")
    shutil.rmtree(rig.folders[0])
    until(lambda: rig.writer.file != before, what="another file")
    rig.feed(20)
    assert rig.finish() == list(range(40))
    assert before.exists()
    assert any("was deleted" in report and "written again" in report for report in rig.reports)


def numbers_in(*files: Path) -> list[int]:
    """The numbers of the frames in some of the files."""
    return [frame.seq for file in files for frame in Recording.open(file).frames()]


def test_what_a_medium_had_not_synced_when_it_went_away_stands_on_the_next(
    make: Callable[..., Rig], quick: pytest.MonkeyPatch
) -> None:
    """It refuses and its path is gone, so its file is let go before there is another."""
    quick.setattr(log_writer, "SYNC_PERIOD_S", 1000.0)
    rig = make(1)
    rig.settle()
    rig.feed(20)
    until(lambda: rig.buffer.is_empty, what="an empty buffer")
    away = rig.folders[0].with_name("away")
    rig._media.status = {away: "broken", **rig._media.status}
    rig.folders[0].rename(away)
    rig.feed(5)
    until(lambda: rig.buffer.is_empty and rig.writer.file, what="a file in its place")
    assert rig.finish(away=True) == list(range(25))


class SickSync:
    """The medium of the present file fails to sync ``refusals`` times, and then succeeds."""

    def __init__(self, rig: Rig, monkeypatch: pytest.MonkeyPatch, refusals: int) -> None:
        self.calls = 0
        self._remaining = refusals
        self._fd = rig.log.segment.writer.fileno()
        self._sync = os.fdatasync
        self.file = rig.log.path
        monkeypatch.setattr(os, "fdatasync", self._refuse)

    def _refuse(self, fd: int) -> None:
        if fd == self._fd:
            self.calls += 1
            self._remaining -= 1
            if self._remaining >= 0:
                raise OSError(errno.EIO, os.strerror(errno.EIO))
        self._sync(fd)


@pytest.mark.parametrize("places", [1, 2])
def test_a_sync_that_failed_once_is_never_trusted_again(
    make: Callable[..., Rig], quick: pytest.MonkeyPatch, places: int
) -> None:
    """The kernel reports a failed write-back once, and then succeeds."""
    rig = make(places, split_s=ONE_FILE_S)
    rig.settle()
    sick = SickSync(rig, quick, refusals=1)
    rig.feed(20)
    until(lambda: sick.calls and rig.buffer.is_empty and rig.writer.file != sick.file, what="another file")
    rig.feed(5)
    assert rig.finish() == list(range(25))
    others = [file for folder in rig.folders for file in folder.glob("*.mcap") if file != sick.file]
    recorded = numbers_in(sick.file)
    unsynced = [n for n in range(25) if n not in recorded] + recorded[-1:]
    assert set(unsynced) <= set(numbers_in(*others))


def test_what_was_not_synced_at_the_stop_goes_to_the_fallback(
    make: Callable[..., Rig], quick: pytest.MonkeyPatch
) -> None:
    """The buffers are empty then: it is what the file has taken that must be written again."""
    quick.setattr(log_writer, "SYNC_PERIOD_S", 1000.0)
    rig = make(split_s=ONE_FILE_S)
    rig.settle()
    rig.feed(20)
    until(lambda: rig.buffer.is_empty, what="an empty buffer")
    SickSync(rig, quick, refusals=10**6)
    rig.finish()
    assert numbers_in(*rig.folders[1].glob("*.mcap")) == list(range(20))


@pytest.mark.parametrize("places", [1, 2])
def test_the_last_notes_go_to_another_place_when_the_file_cannot_be_closed(
    make: Callable[..., Rig], quick: pytest.MonkeyPatch, places: int
) -> None:
    quick.setattr(log_writer, "FINAL_TIMEOUT_S", 0.2)
    rig = make(places, split_s=ONE_FILE_S)
    rig.settle()
    rig.feed(20)
    rig.end_tending()
    rig.writer.stop()
    note = {"t_ns": 7, "text": "the last one"}
    rig.set(*("full", "good")[:places])
    rig.writer.add_note("/fti/gap", 7, note)
    rig.writer.finish()
    rig._ended = True
    assert "No space left" in str(rig.writer.fault)
    assert rig.writer.notes_recorded is (places == 2)
    if places == 2:
        (last,) = Recording.open(rig.folders[1]).messages("/fti/gap", "raw")
        assert json.loads(last[-1]) == note
    assert numbers_in(*rig.folders[0].glob("*.mcap")) == list(range(20))


def test_a_mount_point_without_its_medium_is_left_alone(make: Callable[..., Rig]) -> None:
    rig = make(1)
    elsewhere = StorageTarget(rig.folders[0], Path("/proc"))
    rig.writer._targets = [elsewhere]
    until(lambda: rig.writer.has_failed_everywhere, what="a refusal")
    assert "no medium is mounted on /proc" in rig.writer.state()[1]
    assert not rig.folders[0].exists()
    rig.writer._targets = [StorageTarget.of(rig.folders[0])]


def test_nobody_takes_over_from_one_that_has_ended(make: Callable[..., Rig], monkeypatch: pytest.MonkeyPatch) -> None:
    rig = make(split_s=ONE_FILE_S)
    rig.feed(10)
    rig.settle()
    rig.end_tending()
    rig.writer.stop()
    last = rig.writer.file
    monkeypatch.setattr(rig.writer._machine, "on_file_opened", lambda now, place: True)
    WriterThread(OpenAttempt(1, strict=False), rig.writer._write).run()  # that was slow to open its file, and is wanted
    assert rig.writer.file == last
    assert rig.finish() == list(range(rig.seq))


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(script=st.lists(st.tuples(STATUS, STATUS, st.integers(0, 30)), max_size=8), places=st.integers(1, 2))
def test_whatever_the_media_do_nothing_is_lost(
    make: Callable[..., Rig], script: list[tuple[str, str, int]], places: int
) -> None:
    rig = make(places)
    for main, fallback, count in script:
        rig.set(*(main, fallback)[:places])
        rig.feed(count)
    rig.settle()
    assert rig.finish() == list(range(rig.seq))
