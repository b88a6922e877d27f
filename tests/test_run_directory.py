"""How a client finds a daemon."""

import contextlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti import run_directory
from fti.cli.main import main
from fti.errors import MissingError
from fti.run_directory import DaemonInfo
from tests.run_dirs import peers_of_user, running_daemon


def _info(folder: Path, pid: int) -> DaemonInfo:
    return DaemonInfo(pid, "da42", "s", "http://127.0.0.1:1/", None, 7, str(folder / run_directory.SOCKET))


def test_a_running_daemon_is_found_by_its_directory_and_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    directory = run_directory.make("da42", None)
    assert directory.path == tmp_path / "fti" / "da42"
    assert directory.path.stat().st_mode & 0o077 == 0
    info = _info(directory.path, os.getpid())
    directory.publish(info)
    assert run_directory.find_daemon() == info
    assert run_directory.find_daemon(str(directory.path)) == info
    directory.withdraw()
    with pytest.raises(MissingError, match="no daemon"):
        run_directory.find_daemon()


def test_a_dead_daemon_is_not_found(tmp_path: Path) -> None:
    directory = run_directory.make("x", str(tmp_path))
    directory.publish(_info(tmp_path, os.getpid()))  # the number of a process that runs, as another one's may be later
    os.close(directory.fd)  # as its end does
    with pytest.raises(MissingError, match=str(tmp_path)):
        run_directory.find_daemon(str(tmp_path))


def test_among_several_the_user_chooses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    directories = [run_directory.make(name, None) for name in ("one", "two")]
    for one in directories:
        one.publish(_info(one.path, os.getpid()))
    with pytest.raises(MissingError, match="--run-dir"):
        run_directory.find_daemon()
    for one in directories:
        one.withdraw()


def test_a_run_directory_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(MissingError, match="file/below"):
        run_directory.make("x", str(tmp_path / "file" / "below"))


def test_a_second_daemon_of_the_same_name_gets_a_directory_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    directories = [run_directory.make("da42", None) for _ in range(3)]  # none of them is published yet
    assert [one.path.name for one in directories] == ["da42", "da42_2", "da42_3"]
    with pytest.raises(MissingError, match="another daemon"):
        run_directory.make("da42", str(directories[0].path))
    for one in directories:
        one.withdraw()


def test_a_directory_is_free_again_after_its_daemon(tmp_path: Path) -> None:
    for _ in range(2):
        run_directory.make("da42", str(tmp_path)).withdraw()


def test_a_path_that_cannot_hold_a_socket_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    path = tmp_path / ("x" * 100)
    with pytest.raises(MissingError, match="too long for a control socket"):
        run_directory.make("da42", str(path))
    assert not path.exists()


def test_what_may_not_be_read_is_no_daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    directory = run_directory.make("x", str(tmp_path))

    def refuse(folder_fd: int, name: str) -> bytes:
        raise PermissionError(13, "Permission denied", name)

    monkeypatch.setattr(run_directory, "read_file", refuse)
    with pytest.raises(MissingError, match="no daemon"):
        run_directory.find_daemon(str(tmp_path))
    directory.withdraw()


def test_whoever_looks_for_a_daemon_takes_its_directory_from_nobody(tmp_path: Path) -> None:
    with _looking(tmp_path / "run"):
        for _ in range(500):
            run_directory.make("da42", str(tmp_path / "run")).withdraw()


@contextlib.contextmanager
def _looking(path: Path) -> Iterator[None]:
    """A thread asks again and again whether a daemon is there."""
    ended = threading.Event()

    def find() -> None:
        while not ended.is_set():
            with contextlib.suppress(MissingError):
                run_directory.find_daemon(str(path))

    thread = threading.Thread(target=find)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def test_a_socket_of_another_user_is_not_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with running_daemon(tmp_path) as made, made.bind() as fake:
        fake.listen()
        peers_of_user(os.geteuid() + 12345, monkeypatch)
        assert main(["mark", "x", "--run-dir", str(tmp_path)]) == 2
        error = capsys.readouterr().err
        assert error.startswith(
            f"fti: {made.control_socket}: the socket belongs to user {os.geteuid() + 12345} (process 7), another"
        )
        connection, _ = fake.accept()
        with connection:
            assert connection.recv(100) == b""  # not even the mark was handed to it
