"""What is named as a session and is none: one sentence, exit code 2, and what may have been meant."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fti.cli.main import main
from fti.logger.session import SessionFolder
from tests.cli.sessions import STARTED, record_raw

COMMANDS = (
    ("info",),
    ("verify",),
    ("export", "--out", "tables"),
    ("sync",),
    ("replay",),
    ("reprocess", "--out", "again"),
    ("recover",),
    ("recover", "--in-place"),
    ("pack",),
)
every_command = pytest.mark.parametrize("command", COMMANDS, ids=" ".join)


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def error_of(command: tuple[str, ...], place: Path | str, capsys: pytest.CaptureFixture[str]) -> str:
    """What a command says of a place that it refuses; it leaves everything as it was."""
    before = sorted(Path().rglob("*"))
    assert main([command[0], str(place), *command[1:]]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert sorted(Path().rglob("*")) == before
    return printed.err


@every_command
def test_a_file_of_another_kind(command: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    Path("bench.toml").write_text("[session]")
    assert error_of(command, "bench.toml", capsys) == "fti: bench.toml: is not an MCAP file\n"


@every_command
def test_a_folder_of_sessions_names_them_the_newest_first(
    command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert error_of(command, ".", capsys) == "fti: .: holds no MCAP files\n"
    for number in range(7):
        folder = Path("data") / f"s_{number}"
        folder.mkdir(parents=True)
        (folder / "s_000.mcap").touch()
        os.utime(folder, (number, number))
    assert error_of(command, "data", capsys) == (
        "fti: data: holds no MCAP files, but sessions: data/s_6, data/s_5, data/s_4, data/s_3, data/s_2 and 2 more\n"
    )


@every_command
def test_a_name_with_a_typing_error(command: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    Path("da42_20260102T030405Z_0").mkdir()
    Path("other").mkdir()
    assert error_of(command, "da42_20260102T030405Z_1", capsys) == (
        "fti: da42_20260102T030405Z_1: there is no such session folder or file; there is da42_20260102T030405Z_0\n"
    )
    assert error_of(command, "nowhere/x", capsys) == "fti: nowhere/x: there is no such session folder or file\n"


def test_a_recording_under_another_name_is_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = SessionFolder.create(tmp_path, "s", STARTED)
    record_raw(session, range(50)).close()
    saved = session.files("raw")[0].rename(tmp_path / "flight.bak")
    assert main(["info", str(saved)]) == 0
    assert main(["recover", str(saved), "--out", str(tmp_path / "out")]) == 0
    assert [path.name for path in (tmp_path / "out").glob("*.mcap")] == ["flight.mcap"]


def test_an_empty_file_gives_no_table_and_reports_it(capsys: pytest.CaptureFixture[str]) -> None:
    Path("killed.mcap").touch()
    assert main(["export", "killed.mcap", "--out", "tables"]) == 3
    assert capsys.readouterr().err.startswith("note: nothing to export")
    assert not Path("tables").exists()


def test_an_unknown_option_is_reported_with_the_usage_of_its_command(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["mark", "--triger", "flutter"])
    assert ended.value.code == 2
    error_of = capsys.readouterr().err
    assert error_of.startswith("usage: fti mark ") and "unrecognized arguments: --triger" in error_of
