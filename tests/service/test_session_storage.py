"""Where a session begins."""

from __future__ import annotations

from pathlib import Path

import pytest

from fti.config import Session
from fti.errors import ConfigError, StorageError
from fti.logger.stream_writer import StreamWriter
from fti.service.supervisor.session_storage import SessionStorage


def test_a_session_begins_at_the_fallback_when_the_main_directory_refuses(tmp_path: Path) -> None:
    (tmp_path / "main").touch()
    told: list[str] = []
    session = Session(name="s", directory=str(tmp_path / "main"), fallback=str(tmp_path / "other"))
    places = SessionStorage(session, 0, told.append)
    assert places.folder.path == tmp_path / "other" / places.folder.name
    assert places.folders == [tmp_path / name / places.folder.name for name in ("main", "other")]
    assert "a file, not a directory" in told[0]


def test_no_directory_and_twice_the_same_are_refused(tmp_path: Path) -> None:
    (tmp_path / "main").touch()
    with pytest.raises(StorageError, match="a file, not a directory"):
        SessionStorage(Session(name="s", directory=str(tmp_path / "main")), 0, print)
    with pytest.raises(ConfigError, match=r"is session\.directory itself"):
        SessionStorage(Session(name="s", directory=str(tmp_path), fallback=f"{tmp_path}/main/.."), 0, print)


def test_an_empty_session_leaves_nothing(tmp_path: Path) -> None:
    places = SessionStorage(Session(name="s", directory=str(tmp_path)), 0, print)
    assert places.folder.path.is_dir()
    places.close_files(places.folders)
    assert list(tmp_path.iterdir()) == []


def test_what_closing_leaves_alone_is_an_error_and_names_the_file(tmp_path: Path) -> None:
    """The next start said "closed 2 files" of a session of which it had cut most away."""
    killed = tmp_path / "s_20200101T000000Z_0"
    killed.mkdir()
    writer = StreamWriter(killed / f"{killed.name}_000.mcap")
    channel = writer.add_channel("/raw/ins", "x-fti-raw")
    for n in range(90):
        writer.write(channel, n, bytes([n + 1]) * 40, n)
        writer.flush()
        if n % 30 == 29:
            writer.sync()
    writer.abandon()
    data = bytearray(writer.path.read_bytes())
    data[data.index(bytes([10]) * 40)] ^= 1
    writer.path.write_bytes(data)
    places = SessionStorage(Session(name="s", directory=str(tmp_path)), 0, print)
    (remark,) = places.close_others(lambda: True)
    assert remark.level == "error" and f"{writer.path}: is damaged" in remark.text and "fti recover" in remark.text
    assert writer.path.read_bytes() == bytes(data)
