"""A session in several folders: numbers, copies, and the folders of the missing parts."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fti.errors import MissingError, RecordingError, StorageError
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.file_numbers import absent_numbers
from fti.logger.reading.mcap_file import McapFile
from fti.logger.reading.recording import Recording
from fti.logger.session import Numbering, SessionFolder
from fti.logger.storage_target import PathWatch, StorageTarget, find_mount_point

SECOND = 1_000_000_000


def write(log: RawLog, numbers: range, mark: bytes = b"") -> None:
    for seq in numbers:
        log.write_frame("a", seq, seq * SECOND, b"%d" % seq + mark)
    log.flush()


@pytest.fixture
def folders(tmp_path: Path) -> list[SessionFolder]:
    first = SessionFolder.create(tmp_path / "main", "s", 0)
    (tmp_path / "other" / first.name).mkdir(parents=True)
    return [first, SessionFolder(tmp_path / "other" / first.name)]


def make_log(folders: list[SessionFolder], numbering: Numbering | None = None) -> RawLog:
    places = [folder.path for folder in folders]
    links = [RawTopic("a", "udp", {})]
    return RawLog(folders[0], links, LogSettings(split_s=1e6, split_mb=100, folders=places), numbering=numbering)


def move(log: RawLog, folder: SessionFolder) -> None:
    """Go on in another folder, as a change of the medium does."""
    before = log.segment
    log.switch_to(log.open_segment(folder))
    before.close()


def test_parts_are_read_as_one_and_copies_count_once(folders: list[SessionFolder]) -> None:
    log = make_log(folders)
    write(log, range(10))
    move(log, folders[1])
    write(log, range(7, 20))
    move(log, folders[0])
    write(log, range(20, 30))
    log.close()
    assert [path.name[-8:-5] for folder in folders for path in folder.files("raw")] == ["000", "002", "001"]
    for order in (folders, folders[::-1]):
        recording = Recording.open(*(folder.path for folder in order))
        assert [frame.seq for frame in recording.frames()] == list(range(30))
        assert recording.other_folders == []
    assert Recording.open(folders[0].path).other_folders == [folders[1].path]
    assert Recording.open(folders[1].path).other_folders == [folders[0].path]


def test_the_same_number_with_other_bytes_is_no_copy(folders: list[SessionFolder]) -> None:
    log = make_log(folders)
    write(log, range(10))
    move(log, folders[1])
    write(log, range(9, 12), b"!")
    log.close()
    with pytest.raises(RecordingError, match="the number 9 comes after 9; it occurs twice"):
        list(Recording.open(*(folder.path for folder in folders)).frames())


def test_folders_of_two_sessions_are_refused(folders: list[SessionFolder], tmp_path: Path) -> None:
    stranger = SessionFolder.create(tmp_path, "t", 0)
    for log in (make_log(folders), make_log([stranger])):
        write(log, range(3))
        log.close()
    with pytest.raises(MissingError, match=r"belongs to session t_.*, but .* to session s_"):
        Recording.open(folders[0].path, stranger.path)


def test_numbers_are_one_row_over_all_folders(folders: list[SessionFolder]) -> None:
    numbering = Numbering(first_number=5)
    log = make_log(folders, numbering)
    assert log.path.name.endswith("_005.mcap")
    folders[1].file_path("raw", 8).touch()
    ninth = log.open_segment(folders[1])
    assert ninth.path.name.endswith("_009.mcap")
    thrown = log.open_segment(folders[0])
    assert thrown.path.name.endswith("_010.mcap")
    for segment in (ninth, thrown):
        segment.discard()
        assert not segment.path.exists()
    assert numbering.allocate(folders[0], "raw") == 10
    numbering.release_number(3)
    assert numbering.allocate(folders[0], "raw") == 11
    log.close()


def test_a_number_is_reported_when_it_is_taken_and_when_its_file_is_written(folders: list[SessionFolder]) -> None:
    reports: list[tuple[int, bool]] = []
    numbering = Numbering(3, [1], lambda number, confirmed: reports.append((number, confirmed)))
    log = make_log(folders, numbering)
    assert reports == [(3, False), (3, True)]
    waiting = log.open_segment(folders[1])  # 4
    move(log, folders[0])  # 5
    assert numbering.unconfirmed_before(5) == [1, 4]
    assert log.is_superseded(waiting)
    waiting.discard()
    assert numbering.unconfirmed_before(6) == [1, 4]
    assert McapFile(log.path).head().metadata["fti.file"]["given_up_numbers"] == "1 4"
    assert absent_numbers(Recording.open(folders[0].path), "raw") == ([1, 4], [(0, 0), (2, 2)])
    log.close()


def test_a_session_is_not_begun_where_the_other_place_has_its_name(tmp_path: Path) -> None:
    first = SessionFolder.create(tmp_path / "other", "s", 0)
    assert SessionFolder.create(tmp_path / "main", "s", 0, tmp_path / "other").name == first.name[:-1] + "1"


def test_a_place_asks_for_its_medium_and_its_space(tmp_path: Path) -> None:
    place = StorageTarget.of(tmp_path / "deep" / "folder")
    assert place.mount == find_mount_point(tmp_path)
    assert place.prepare(0.001).path.is_dir()
    with pytest.raises(StorageError, match=r"MB of 1e\+12 MB \(session.min_free_mb\) are free"):
        place.prepare(1e12)
    with pytest.raises(StorageError, match="no medium is mounted on /proc"):
        StorageTarget(tmp_path / "other", Path("/proc")).prepare()
    (tmp_path / "file").touch()
    with pytest.raises(StorageError, match="cannot be created"):
        StorageTarget.of(tmp_path / "file" / "folder").prepare()


def test_a_trace_is_lost_by_moving_and_by_deleting(tmp_path: Path) -> None:
    path = tmp_path / "a" / "file"
    path.parent.mkdir()
    fd = os.open(path, os.O_RDWR | os.O_CREAT)
    try:
        path_watch = PathWatch(path, fd)
        assert path_watch.find_lost_file() is None
        path.parent.rename(tmp_path / "b")
        assert (lost_file := path_watch.find_lost_file()) and not lost_file.is_deleted
        path.parent.mkdir()
        path.touch()  # another file in its place
        assert (lost_file := path_watch.find_lost_file()) and not lost_file.is_deleted
        (tmp_path / "b" / "file").unlink()
        assert (lost_file := path_watch.find_lost_file()) and lost_file.is_deleted
    finally:
        os.close(fd)
