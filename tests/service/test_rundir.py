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
    made = rundir.make("da42", None)
    assert made.path == tmp_path / "fti" / "da42"
    assert made.path.stat().st_mode & 0o077 == 0
    info = _info(made.path, os.getpid())
    rundir.publish(made.path, info)
    assert rundir.find_daemon() == info
    assert rundir.find_daemon(str(made.path)) == info
    made.withdraw()
    with pytest.raises(MissingError, match="no daemon"):
        rundir.find_daemon()


def test_a_dead_daemon_is_not_found(tmp_path: Path) -> None:
    made = rundir.make("x", str(tmp_path))
    rundir.publish(made.path, _info(tmp_path, 2**22 + 1))
    os.close(made.lock_fd)  # as its end does
    with pytest.raises(MissingError, match=str(tmp_path)):
        rundir.find_daemon(str(tmp_path))


def test_among_several_the_user_chooses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    made = [rundir.make(name, None) for name in ("one", "two")]
    for one in made:
        rundir.publish(one.path, _info(one.path, os.getpid()))
    with pytest.raises(MissingError, match="--run-dir"):
        rundir.find_daemon()
    for one in made:
        one.withdraw()


def test_a_run_directory_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(MissingError, match="file/below"):
        rundir.make("x", str(tmp_path / "file" / "below"))


def test_a_second_daemon_of_the_same_name_gets_a_directory_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    made = [rundir.make("da42", None) for _ in range(3)]  # none of them has said yet that it runs
    assert [one.path.name for one in made] == ["da42", "da42_2", "da42_3"]
    with pytest.raises(MissingError, match="another daemon"):
        rundir.make("da42", str(made[0].path))
    for one in made:
        one.withdraw()


def test_a_directory_is_free_again_after_its_daemon(tmp_path: Path) -> None:
    for _ in range(2):
        rundir.make("da42", str(tmp_path)).withdraw()


def test_a_path_that_cannot_hold_a_socket_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    path = tmp_path / ("x" * 100)
    with pytest.raises(MissingError, match="too long for a control socket"):
        rundir.make("da42", str(path))
    assert not path.exists()


def test_what_may_not_be_read_is_no_daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path) -> str:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "read_text", refuse)
    with pytest.raises(MissingError, match="no daemon"):
        rundir.find_daemon(str(tmp_path))
