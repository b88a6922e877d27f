"""Progress on standard error: bars in a terminal, lines elsewhere; every command that reads a whole session has it."""

from __future__ import annotations

import io
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fti.cli import _progress
from fti.cli._progress import ShowShare, show_progress
from fti.cli.main import main
from tests.cli.sessions import make_folder, record_derived, record_raw
from tests.cli.test_hostile_texts import EVIL
from tests.small_config import LINE, radar_altimeter

COMMANDS = {
    "info": "reading",
    "info --json": "reading",
    "verify": "verifying",
    "export --out tables": "exporting",
    "sync small.toml": "decoding",
    "reprocess small.toml --out again": "reprocessing",
    "latency": "reading",
    "compare": "reading SESSION",
    "pack": "s_20260102T030405Z_0_000.mcap",
    "recover --out saved": "copying",
}


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_elsewhere_a_line_comes_every_period(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _progress.PERIOD_S == 10.0
    monkeypatch.setattr(_progress, "PERIOD_S", 0.2)
    with show_progress("first") as show:
        time.sleep(0.3)
        show("second", 0.25)
        show("second", 0.5)
        time.sleep(0.2)
        show("third", 1.5)
        time.sleep(0.2)
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.splitlines() == ["first: 0 s", "second: 50 %, 0 s", "third: 100 %, 1 s"]


def test_short_work_prints_nothing_elsewhere(capsys: pytest.CaptureFixture[str]) -> None:
    with show_progress("first") as show:
        show("first", 0.5)
    assert capsys.readouterr() == ("", "")


def test_a_terminal_shows_a_bar_of_each_step_and_clears_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(sys, "stderr", shown := Terminal())
    with show_progress("first") as show:
        show("first", 0.5)
        show(EVIL, 0.25)
        time.sleep(0.3)
    text = shown.getvalue()
    assert "first" in text and " 50%" in text and " 25%" in text and "[bold red]m[/]" in text
    assert "\x1b]0;" not in text and "\x1b[2J" not in text
    assert text.endswith(("\x1b[2K", "\x1b[?25h")) or "\x1b[2K" in text[-60:]


def test_no_colour_is_respected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    for value, coloured in (("", True), ("1", False)):
        monkeypatch.setenv("NO_COLOR", value)
        monkeypatch.setattr(sys, "stderr", shown := Terminal())
        with show_progress("first") as show:
            show("first", 0.5)
            time.sleep(0.2)
        assert bool(re.search(r"\x1b\[(?:\d+;)*(?:3[0-8]|9[0-7])\b", shown.getvalue())) == coloured


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_that_reads_a_session_shows_its_share(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[tuple[str, float | None]] = []

    @contextmanager
    def collect() -> Iterator[ShowShare]:
        yield lambda step, share=None: shown.append((step, share))

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(_progress, "_print_lines", collect)
    folder = make_folder(tmp_path)
    record_raw(folder, range(12000), split_s=300).close()
    record_derived(folder)
    Path("small.toml").write_text(LINE + radar_altimeter(500))
    name, *options = command.split()
    main([name, str(folder.path), *options])
    step = COMMANDS[command].replace("SESSION", str(folder.path))
    shares = [share for name, share in shown if name == step and share is not None]
    assert len(shares) > 1 and shares == sorted(shares) and 0.6 < shares[-1] < 1.0001
