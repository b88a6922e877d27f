"""The command line as a whole: groups, help at every width, versions, completion, manual pages."""

from __future__ import annotations

import argparse
import inspect
import io
import os
import pkgutil
import re
import subprocess
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import pytest

import fti.cli
from fti.cli._man_page import pages
from fti.cli._parser import GROUPS, make_parser
from fti.cli._printing import fold_line, print_line
from fti.cli.main import main

COMMANDS = sorted(
    module.name for module in pkgutil.iter_modules(fti.cli.__path__) if module.name != "main" and module.name[0] != "_"
)
MACROS = {".TH", ".SH", ".SS", ".TP", ".PP", ".nf", ".fi"}


def help_text(*command: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit, match="0"):
        main([*command, "--help"])
    return capsys.readouterr().out


def test_every_command_has_one_group() -> None:
    assert sorted(name.replace("-", "_") for names in GROUPS.values() for name in names) == COMMANDS


def test_the_help_lists_the_commands_below_their_groups(capsys: pytest.CaptureFixture[str]) -> None:
    found: dict[str, list[str]] = {}
    for line in help_text(capsys=capsys).partition("commands:")[2].splitlines():
        if re.match(r"  \S", line):
            found[line.strip()] = []
        elif re.match(r"    \S", line):
            [*found.values()][-1].append(line.split()[0])
    assert found == {title: list(names) for title, names in GROUPS.items()}


def test_without_a_command_it_prints_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and "after the flight" in printed.err


# ---------------------------------------------------------------------------------------------------------- width


@pytest.mark.parametrize("columns", [60, 80, 200])
def test_every_help_fits_the_terminal_and_loses_no_word(
    columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    for name in COMMANDS:
        printed = help_text(name, capsys=capsys)
        too_long = [line for line in printed.splitlines() if len(line) > columns and len(line.split()) > 3]
        assert too_long == [], name
        words = (inspect.getdoc(import_module(f"fti.cli.{name}")) or "").split()
        assert " ".join(words) in " ".join(printed.split()), name


def test_a_paragraph_is_as_wide_as_the_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    widths = []
    for columns in (60, 80, 120, 200):
        monkeypatch.setenv("COLUMNS", str(columns))
        paragraph = help_text("verify", capsys=capsys).split("\n\n")[2]
        widths.append(max(map(len, paragraph.splitlines())))
    assert all(columns - 12 < width < columns for columns, width in zip((60, 80, 120), widths, strict=False))
    assert widths[3] == widths[2]


@pytest.mark.parametrize(
    ("line", "parts"),
    [
        ("short", ["short"]),
        ("one two three four five", ["one two three four", "    five"]),
        ("  indented two three four", ["  indented two", "      three four"]),
        ("name  a text of words", ["name  a text of", "      words"]),
        ("name  12.5  a text of words", ["name  12.5  a text", "            of", "            words"]),
        ("name  12.5  a longer_word", ["name  12.5  a", "    longer_word"]),
        ("a_name_that_fills_all  text", ["a_name_that_fills_all", "    text"]),
    ],
)
def test_a_line_is_folded_below_its_last_column(line: str, parts: list[str]) -> None:
    assert fold_line(line, 18) == parts


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("stream", "lines"), [(Terminal, 3), (io.StringIO, 1)])
def test_lines_are_folded_on_a_terminal_only(
    stream: type[io.StringIO], lines: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setattr(sys, "stdout", out := stream())
    print_line("name  " + "word " * 16)
    assert len(out.getvalue().splitlines()) == lines


# -------------------------------------------------------------------------------------------------------- versions


def test_the_versions_are_those_of_the_packages_without_importing_them() -> None:
    code = (
        "import sys; from fti.cli.main import main\ntry: main(['--version'])\nexcept SystemExit as end: code = end.code"
    )
    loaded = (
        "print(code, [name for name in ('numpy', 'numba', 'zenoh', 'can', 'pymavlink', 'rich') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", f"{code}\n{loaded}"], capture_output=True, text=True, check=True)
    first, python, *packages, last = done.stdout.splitlines()
    assert first == f"fti {version('fti')}" and last == "0 []"
    assert python.startswith(f"Python {sys.version_info.major}.{sys.version_info.minor}.") and "Linux" in python
    names = ("numpy", "numba", "mcap", "eclipse-zenoh", "python-can", "pyserial", "pymavlink")
    assert packages == [f"{name} {version(name)}" for name in names]


def test_a_package_that_is_missing_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("fti.cli._parser.PACKAGES", ("nobody-has-this",))
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr().out.splitlines()[-1] == "nobody-has-this is not installed"


# ------------------------------------------------------------------------------------------------------ completion

COMPLETE = (
    'COMP_LINE="$0"; COMP_POINT=${#0}; COMP_TYPE=9; COMP_WORDS=($0); _python_argcomplete fti; echo "${COMPREPLY[*]}"'
)


def test_help_after_the_name_of_a_study_describes_that_study(capsys: pytest.CaptureFixture[str]) -> None:
    """Without a name it describes the command, also with an unknown one."""
    assert "T17.stable" in help_text("study", "long-endurance", capsys=capsys)
    assert "T17" not in help_text("study", capsys=capsys)
    assert "fti study --list" in help_text("study", "no-such-study", capsys=capsys)


def test_each_action_of_terrain_has_a_description(capsys: pytest.CaptureFixture[str]) -> None:
    for action in ("info", "plot", "spectrum", "judge"):
        assert f"  fti terrain {action} " in help_text("terrain", action, capsys=capsys)


@pytest.fixture(scope="module")
def shell_path(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A search path with this fti."""
    folder = tmp_path_factory.mktemp("bin")
    (folder / "fti").write_text(f'#!/bin/sh\nexec {sys.executable} -m fti.cli.main "$@"\n')
    (folder / "fti").chmod(0o755)
    return f"{folder}:{os.environ['PATH']}"


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("fti rep", {"replay", "reprocess"}),
        ("fti export --fo", {"--format"}),
        ("fti export --format ", {"csv", "parquet"}),
        ("fti hil sile", {"silence"}),
        ("fti check sile", {"silence"}),
        ("fti demo --scenario sile", {"silence"}),
        ("fti score sile", {"silence"}),
        ("fti decode --driver nov", {"novatel_oem6"}),
        ("fti drivers nov", {"novatel_oem6"}),
        ("fti study slant", {"slant_range"}),
        ("fti topics /nav/gli", {"/nav/glide_slope"}),
        ("fti score pypro", {"pyproject.toml"}),
        ("fti info pypro", {"pyproject.toml"}),
    ],
)
def test_bash_completes(typed: str, completed: set[str], shell_path: str) -> None:
    done = subprocess.run(
        ["bash", "-c", f'eval "$(fti completion bash)"; {COMPLETE}', typed],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "PATH": shell_path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert set(done.stdout.split()) == completed


@pytest.mark.parametrize(
    ("shell", "line"), [("zsh", "compdef _python_argcomplete fti"), ("fish", "complete --command fti")]
)
def test_other_shells_have_scripts(shell: str, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    assert line in capsys.readouterr().out


@pytest.mark.parametrize("wrong", [["completion", "man"], ["completion", "bash", "folder"], ["completion", "tcsh"]])
def test_wrong_calls_of_completion(wrong: list[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(wrong)


# ---------------------------------------------------------------------------------------------------- manual pages


def test_every_command_has_a_manual_page_with_its_whole_help(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["completion", "man", str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'man1'}\n"
    written = {file.name: file.read_text() for file in (tmp_path / "man1").iterdir()}
    assert sorted(written) == sorted(["fti.1", *(f"fti-{name}.1" for name in COMMANDS)])
    for name in COMMANDS:
        lines = written[f"fti-{name}.1"].splitlines()
        assert {line.split()[0] for line in lines if line[:1] in (".", "'")} <= MACROS
        text = (
            " ".join(line for line in lines if line[:1] != ".")
            .replace("\\-", "-")
            .replace("\\e", "\\")
            .replace("\\&", "")
        )
        for part in re.split(r"\s+", inspect.getdoc(import_module(f"fti.cli.{name}")) or ""):
            assert part in text, name
        (command,) = (a.choices[name] for a in make_parser()._actions if isinstance(a, argparse._SubParsersAction))
        for option in re.findall(r"--[a-z-]+", command.format_help()):
            assert option in text, name
    assert all(f"fti\\-{name}" in written["fti.1"] for name in COMMANDS)


def test_a_folder_that_cannot_be_written_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "man1").write_text("")
    assert main(["completion", "man", str(tmp_path)]) == 2
    assert f"{tmp_path / 'man1'}: cannot be written" in capsys.readouterr().err


def test_text_that_roff_would_interpret_is_escaped() -> None:
    parser = make_parser()
    (commands,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    commands.choices["run"].description = "Title.\n\n.TH a macro\n\n'quote -x \\fB"
    lines = pages(parser)["fti-run.1"].splitlines()
    assert r"\&.TH a macro" in lines and r"\&'quote \-x \efB" in lines
