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
    lines: list[str] = []
    session = Session(name="s", directory=str(tmp_path / "main"), fallback=str(tmp_path / "other"))
    storage = SessionStorage(session, 0, lines.append)
    assert storage.folder.path == tmp_path / "other" / storage.folder.name
    assert storage.folders == [tmp_path / name / storage.folder.name for name in ("main", "other")]
    assert "a file, not a directory" in lines[0]


def test_no_directory_and_twice_the_same_are_refused(tmp_path: Path) -> None:
    (tmp_path / "main").touch()
    with pytest.raises(StorageError, match="a file, not a directory"):
        SessionStorage(Session(name="s", directory=str(tmp_path / "main")), 0, print)
    with pytest.raises(ConfigError, match=r"must differ from session\.directory"):
        SessionStorage(Session(name="s", directory=str(tmp_path), fallback=f"{tmp_path}/main/.."), 0, print)


def test_an_empty_session_leaves_nothing(tmp_path: Path) -> None:
    storage = SessionStorage(Session(name="s", directory=str(tmp_path)), 0, print)
    assert storage.folder.path.is_dir()
    storage.close_files(storage.folders)
    assert list(tmp_path.iterdir()) == []


def test_what_closing_leaves_alone_is_an_error_and_names_the_file(tmp_path: Path) -> None:
    """The next start reported "closed 2 files" for a session of which it had cut most away."""
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
    storage = SessionStorage(Session(name="s", directory=str(tmp_path)), 0, print)
    (notice,) = storage.close_killed_sessions(lambda: True)
    assert notice.level == "error" and f"{writer.path}: is damaged" in notice.text and "fti recover" in notice.text
    assert writer.path.read_bytes() == bytes(data)
