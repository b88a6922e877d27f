from __future__ import annotations

import os
from pathlib import Path

import pytest

from fti.errors import MissingError, StorageError
from fti.logger import session
from fti.logger.session import SessionFolder, name_parts

STARTED = 1_767_323_045_000_000_000  # 2026-01-02 03:04:05 UTC


def test_folders_never_collide(tmp_path: Path) -> None:
    first = SessionFolder.create(tmp_path / "deep" / "data", "da42", STARTED)
    second = SessionFolder.create(tmp_path / "deep" / "data", "da42", STARTED)
    assert first.path.name == "da42_20260102T030405Z_0"
    assert second.path.name == "da42_20260102T030405Z_1"
    first.path.rmdir()
    assert SessionFolder.create(tmp_path / "deep" / "data", "da42", STARTED).path == first.path


def test_files_take_the_smallest_free_number(tmp_path: Path) -> None:
    folder = SessionFolder.create(tmp_path, "x_derived", STARTED)
    name = "x_derived_20260102T030405Z_0"
    for kind, part in (("raw", ""), ("derived", "_derived"), ("truth", "_truth")):
        assert folder.next_path(kind).name == f"{name}{part}_000.mcap"  # type: ignore[arg-type]
        folder.next_path(kind).touch()  # type: ignore[arg-type]
        assert folder.next_path(kind).name == f"{name}{part}_001.mcap"  # type: ignore[arg-type]
        assert [p.name for p in folder.files(kind)] == [f"{name}{part}_000.mcap"]  # type: ignore[arg-type]
    (folder.path / f"{name}_001.mcap").symlink_to("nowhere")  # a dangling link is taken too
    assert folder.next_path("raw").name == f"{name}_002.mcap"


def test_files_are_in_order_of_their_numbers(tmp_path: Path) -> None:
    folder = SessionFolder.create(tmp_path, "a", STARTED)
    for n in (1000, 2, 999):
        (folder.path / f"{folder.name}_{n:03d}.mcap").touch()
    assert [name_parts(p)[1] for p in folder.files("raw")] == [2, 999, 1000]


def test_a_foreign_name_is_raw() -> None:
    assert name_parts(Path("flight.mcap")) == ("raw", 0)


def test_open_of_a_missing_folder_says_so(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match="there is no such session folder"):
        SessionFolder.open(tmp_path / "no")
    assert SessionFolder.open(str(tmp_path)).path == tmp_path


def test_a_file_in_the_place_of_the_directory(tmp_path: Path) -> None:
    (tmp_path / "data").touch()
    with pytest.raises(StorageError, match=r"data: cannot hold the recording: it is a file, not a directory"):
        SessionFolder.create(tmp_path / "data", "a", STARTED)
    with pytest.raises(StorageError, match="a part of the path is a file"):
        SessionFolder.create(tmp_path / "data" / "below", "a", STARTED)


@pytest.mark.parametrize(
    ("code", "words"), [(13, "you have no permission"), (30, "read-only file system"), (28, "no space is left")]
)
def test_a_directory_that_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, words: str) -> None:
    def refuse(path: Path) -> bool:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(session, "_create_folder", refuse)
    with pytest.raises(StorageError, match=words):
        SessionFolder.create(tmp_path, "a", STARTED)
