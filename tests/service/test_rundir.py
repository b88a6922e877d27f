"""How a client finds a daemon."""

import os
from pathlib import Path

import pytest

from fti.errors import MissingError
from fti.service import rundir
from fti.service.rundir import DaemonInfo


def _info(folder: Path, pid: int) -> DaemonInfo:
    return DaemonInfo(pid, "da42", "s", "http://127.0.0.1:1/", None, 7, str(folder / rundir.SOCKET))


def test_a_running_daemon_is_found_by_its_directory_and_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    folder = rundir.make("da42", None)
    assert folder == tmp_path / "fti" / "da42"
    assert folder.stat().st_mode & 0o077 == 0
    info = _info(folder, os.getpid())
    rundir.publish(folder, info)
    assert rundir.find_daemon() == info
    assert rundir.find_daemon(str(folder)) == info
    rundir.withdraw(folder)
    with pytest.raises(MissingError, match="no daemon"):
        rundir.find_daemon()


def test_a_dead_daemon_is_not_found(tmp_path: Path) -> None:
    rundir.publish(tmp_path, _info(tmp_path, 2**22 + 1))
    with pytest.raises(MissingError, match=str(tmp_path)):
        rundir.find_daemon(str(tmp_path))


def test_among_several_the_user_chooses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    for name in ("one", "two"):
        folder = rundir.make(name, None)
        rundir.publish(folder, _info(folder, os.getpid()))
    with pytest.raises(MissingError, match="--run-dir"):
        rundir.find_daemon()


def test_a_run_directory_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(MissingError, match="file/below"):
        rundir.make("x", str(tmp_path / "file" / "below"))


def test_a_second_daemon_of_the_same_name_gets_a_directory_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    first = rundir.make("da42", None)
    rundir.publish(first, _info(first, os.getpid()))
    assert rundir.make("da42", None) == tmp_path / "fti" / "da42_2"
    with pytest.raises(MissingError, match="another daemon"):
        rundir.make("da42", str(first))


def test_what_may_not_be_read_is_no_daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path) -> str:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "read_text", refuse)
    with pytest.raises(MissingError, match="no daemon"):
        rundir.find_daemon(str(tmp_path))
