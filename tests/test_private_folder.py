"""Folders that another user has prepared are refused, and nothing is written through what stands in them."""

import os
from pathlib import Path

import pytest

from fti import run_directory
from fti.cli.main import main
from fti.errors import MissingError
from fti.private_folder import check_trusted


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    """A file of this user that another user tries to have overwritten."""
    file = tmp_path / "victim"
    file.write_text("precious")
    return file


@pytest.fixture
def shared(tmp_path: Path) -> Path:
    """The base of all run directories in a temporary directory, without XDG_RUNTIME_DIR."""
    return tmp_path / "tmp" / f"fti-{os.getuid()}"


@pytest.fixture(autouse=True)
def _without_runtime_dir(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))


def info_of(directory: run_directory.RunDirectory) -> run_directory.DaemonInfo:
    return run_directory.DaemonInfo(os.getpid(), "da42", "s", None, None, 7, str(directory.control_socket))


def test_the_directories_are_made_for_the_owner_alone(shared: Path) -> None:
    directory = run_directory.make("da42", None)
    directory.publish(info_of(directory))
    with directory.bind():
        modes = {path.name: path.stat().st_mode & 0o777 for path in (shared, *shared.rglob("*"))}
    directory.withdraw()
    assert modes == {shared.name: 0o700, "da42": 0o700, "fti.json": 0o600, "fti.sock": 0o600}


@pytest.mark.parametrize("below", ["", "da42"])
def test_a_directory_that_others_can_write_is_refused(shared: Path, victim: Path, below: str) -> None:
    (shared / "da42").mkdir(parents=True, mode=0o700)
    (shared / below).chmod(0o1777)
    (shared / "da42" / "fti.json.new").symlink_to(victim)
    with pytest.raises(MissingError, match=r"other users can write to it \(mode 1777\); chmod go-w .*--run-dir"):
        run_directory.make("da42", None)
    assert victim.read_text() == "precious"


@pytest.mark.parametrize("below", ["", "da42"])
def test_a_symlink_is_refused(shared: Path, tmp_path: Path, below: str) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    place = shared / below
    place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    place.symlink_to(elsewhere)
    with pytest.raises(MissingError, match="is a symlink"):
        run_directory.make("da42", None)
    with pytest.raises(MissingError, match="is a symlink"):
        run_directory.make("da42", str(place))
    assert not list(elsewhere.iterdir())


def test_a_directory_of_another_user_is_refused_by_daemon_and_clients(
    shared: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = run_directory.make("da42", None)
    directory.publish(info_of(directory))
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 12345)
    for refused in (
        lambda: run_directory.make("other", None),
        run_directory.find_daemon,
        lambda: run_directory.find_daemon(str(directory.path)),
        lambda: run_directory.connect(directory.control_socket, 1.0),
    ):
        with pytest.raises(MissingError, match=rf"{shared}.*: belongs to \w+, not to user {os.getuid() + 12345}"):
            refused()
    directory.withdraw()


def test_what_is_written_replaces_a_symlink_and_does_not_follow_it(tmp_path: Path, victim: Path) -> None:
    directory = run_directory.make("x", str(tmp_path / "run"))
    for name in ("fti.json", "fti.json.new", "fti.sock"):
        (directory.path / name).symlink_to(victim)
    directory.publish(info_of(directory))
    directory.bind().close()
    assert victim.read_text() == "precious"
    assert not (directory.path / "fti.json").is_symlink()
    assert run_directory.find_daemon(str(directory.path)) == info_of(directory)
    directory.withdraw()
    assert not list(directory.path.iterdir())


def test_a_symlink_is_not_read_as_the_daemons_word(tmp_path: Path) -> None:
    directory = run_directory.make("x", str(tmp_path / "run"))
    directory.publish(info_of(directory))
    (directory.path / "fti.json").rename(tmp_path / "fti.json")
    (directory.path / "fti.json").symlink_to(tmp_path / "fti.json")
    with pytest.raises(MissingError, match="no daemon is running there"):
        run_directory.find_daemon(str(directory.path))
    directory.withdraw()


def test_files_go_where_the_checked_directory_is_whatever_its_name_means_later(tmp_path: Path) -> None:
    directory = run_directory.make("x", str(tmp_path / "run"))
    directory.path.rename(tmp_path / "moved")
    (tmp_path / "run").mkdir()
    directory.publish(info_of(directory))
    directory.bind().close()
    assert not list((tmp_path / "run").iterdir())
    assert {path.name for path in (tmp_path / "moved").iterdir()} == {"fti.json", "fti.sock"}
    directory.withdraw()


def test_a_trusted_folder_is_ours_or_roots_and_may_be_missing_or_no_folder(tmp_path: Path) -> None:
    check_trusted(tmp_path)
    check_trusted(Path("/dev"))
    check_trusted(tmp_path / "later")
    check_trusted(Path("/etc/passwd"))
    with pytest.raises(MissingError, match=r"/tmp: other users can write to it \(mode 1777\)"):
        check_trusted(Path("/tmp"))


@pytest.mark.parametrize("command", [["watch", "--once"], ["mark", "x"], ["send", "--list"]])
def test_a_client_reports_what_is_wrong_in_one_sentence(
    shared: Path, capsys: pytest.CaptureFixture[str], command: list[str]
) -> None:
    shared.mkdir()
    shared.chmod(0o777)
    assert main(command) == 2
    error = capsys.readouterr().err
    assert error == f"fti: {shared}: other users can write to it (mode 0777); chmod go-w {shared}\n"
