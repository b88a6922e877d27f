"""``fti readmit``: what reaches the daemon, and what it refuses."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from fti.cli.main import main
from fti.run_directory import RunDirectory
from fti.service.supervisor.control_socket import serve_commands
from tests.run_dirs import running_daemon


def readmit(run_dir: Path, argument: str, answer: dict[str, Any]) -> tuple[int, list[dict[str, Any]]]:
    """Exit code of the command beside a daemon that answers, and what the daemon was asked."""
    commands: list[dict[str, Any]] = []

    async def obey(command: dict[str, Any], who: str) -> dict[str, Any]:
        commands.append(command)
        return answer

    async def run_command(directory: RunDirectory) -> int:
        server = await serve_commands(directory.bind(), obey, lambda unit, error: pytest.fail(f"{unit}: {error}"))
        async with server:
            return await asyncio.to_thread(main, ["readmit", argument, "--run-dir", str(run_dir)])

    with running_daemon(run_dir) as directory:
        return asyncio.run(run_command(directory)), commands


def test_the_source_reaches_the_daemon(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert readmit(tmp_path, "gnss", {"t_ns": 1}) == (0, [{"readmit": "gnss"}])
    assert capsys.readouterr().out.startswith("gnss: readmitted")


def test_all_sources_reach_the_daemon_as_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert readmit(tmp_path, "--all", {"t_ns": 1}) == (0, [{"readmit": "*"}])
    assert "navigation starts again" in capsys.readouterr().out


def test_what_the_daemon_refuses_is_a_wrong_call(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _ = readmit(tmp_path, "radar", {"fault": "'radar' is not a source of position; there are gnss"})
    assert code == 2
    assert "'radar' is not a source of position" in capsys.readouterr().err
