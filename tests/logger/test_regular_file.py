"""FIFOs, devices and folders with the names of session files: nothing blocks on them, and each is reported."""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti.cli.main import main
from fti.logger.lock import is_being_written
from fti.logger.recovery import close_unfinished
from fti.logger.regular_file import open_descriptor
from tests.cli.sessions import make_folder, record_derived, record_raw

COMMANDS = (
    ("info",),
    ("verify",),
    ("export", "--out", "tables"),
    ("compare", "SESSION"),
    ("recover", "--out", "rescued"),
    ("recover", "--in-place"),
    ("pack",),
)


@pytest.fixture(autouse=True)
def _no_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Whoever waits for the other end of a FIFO is interrupted after a while, and that is an error."""
    monkeypatch.chdir(tmp_path)

    def waited(*_: object) -> None:
        raise AssertionError("it waits")

    before = signal.signal(signal.SIGALRM, waited)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def _make(kind: str, path: Path) -> None:
    if kind == "FIFO":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as sock:
            os.chdir(path.parent)  # the name of a socket is short
            sock.bind(path.name)
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        path.symlink_to(path.name)


@pytest.mark.parametrize("kind", ["FIFO", "socket", "folder", "device", "loop"])
def test_closing_old_sessions_waits_for_nothing_and_names_it(tmp_path: Path, kind: str) -> None:
    (tmp_path / "old").mkdir()
    _make(kind, tmp_path / "old" / "x_000.mcap")
    (found,) = close_unfinished.close_all(tmp_path)
    assert found.fault is not None
    assert "x_000.mcap: cannot be read: " in found.fault
    assert {"loop": "symbolic links"}.get(kind, f"it is a {kind}; a recording is a regular file") in found.fault
    assert not is_being_written(tmp_path / "old" / "x_000.mcap")


@pytest.mark.parametrize("kind", ["FIFO", "device", "loop"])
@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_a_session_is_read_without_what_is_no_file(
    tmp_path: Path, command: tuple[str, ...], kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = make_folder(tmp_path)
    record_raw(folder, range(100)).close()
    record_derived(folder)
    _make(kind, folder.file_path("raw", 1))
    assert folder.next_number("raw") == 2, "its name is taken"
    name, *more = (str(folder.path) if word == "SESSION" else word for word in command)
    main([name, str(folder.path), *more])
    printed = capsys.readouterr()
    assert "Traceback" not in printed.out + printed.err
    if name in ("info", "export"):
        assert "_001.mcap is ignored: " in printed.out + printed.err


def test_a_fifo_that_is_named_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo("x_000.mcap")
    for name in ("info", "verify", "sync"):
        assert main([name, "x_000.mcap"]) == 2
        assert capsys.readouterr().err == "fti: x_000.mcap: it is a FIFO; a recording is a regular file\n"


def test_a_file_that_becomes_a_fifo_while_it_is_opened_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, other = tmp_path / "x_000.mcap", tmp_path / "regular"
    other.write_bytes(b"")
    os.mkfifo(path)
    regular = other.stat()
    monkeypatch.setattr(Path, "stat", lambda self, **_: regular)
    with pytest.raises(OSError, match="it is a FIFO"):
        open_descriptor(path)
