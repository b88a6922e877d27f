"""``fti mark``: what reaches the daemon, and what is refused before it."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from fti.cli.main import main
from fti.run_directory import RunDirectory
from fti.service.supervisor.control_socket import serve_commands
from tests.run_dirs import running_daemon


def mark(run_dir: Path, *arguments: str) -> tuple[int, list[dict[str, Any]]]:
    """Exit code of the command beside a daemon, and what the daemon was asked."""
    commands: list[dict[str, Any]] = []

    async def obey(command: dict[str, Any], who: str) -> dict[str, Any]:
        commands.append(command)
        return {"t_ns": 1_500_000_000}

    async def run_command(directory: RunDirectory) -> int:
        server = await serve_commands(directory.bind(), obey, lambda unit, error: pytest.fail(f"{unit}: {error}"))
        async with server:
            return await asyncio.to_thread(main, ["mark", *arguments, "--run-dir", str(run_dir)])

    with running_daemon(run_dir) as directory:
        return asyncio.run(run_command(directory)), commands


def test_a_mark_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert mark(tmp_path, "  begin of\n\x1b approach 3 ") == (0, [{"mark": "begin of approach 3", "trigger": False}])
    assert capsys.readouterr().out == "marked at 00:00:01.500 (FTI time)\n"
    assert mark(tmp_path, "begin", "of", "approach", "3")[1] == [{"mark": "begin of approach 3", "trigger": False}]


@pytest.mark.parametrize(("text", "length"), [("x" * 201, 201), ("", 0), (" \t\n", 0)])
def test_its_length_is_bounded(text: str, length: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert mark(tmp_path, text) == (2, [])
    assert capsys.readouterr().err == f"fti: a mark must have 1 to 200 characters, not {length}\n"


def test_the_longest_one_arrives(tmp_path: Path) -> None:
    assert mark(tmp_path, "--trigger", "ü" * 200) == (0, [{"mark": "ü" * 200, "trigger": True}])
