"""``fti acknowledge``: what reaches the daemon."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from fti.cli.main import main
from fti.run_directory import RunDirectory
from fti.service.supervisor.control_socket import serve_commands
from tests.run_dirs import running_daemon


@pytest.mark.parametrize(("arguments", "alarm"), [([], None), (["integrity_alert"], "integrity_alert")])
def test_it_asks_for_one_alarm_or_for_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], alarm: str | None
) -> None:
    commands: list[dict[str, Any]] = []

    async def obey(command: dict[str, Any], who: str) -> dict[str, Any]:
        commands.append(command)
        return {"acknowledged": 2, "t_ns": 1}

    async def run_command(directory: RunDirectory) -> int:
        server = await serve_commands(directory.bind(), obey, lambda unit, error: pytest.fail(f"{unit}: {error}"))
        async with server:
            return await asyncio.to_thread(main, ["acknowledge", *arguments, "--run-dir", str(tmp_path)])

    with running_daemon(tmp_path) as directory:
        assert asyncio.run(run_command(directory)) == 0
    assert commands == [{"acknowledge": alarm}]
    assert capsys.readouterr().out == "2 alarms acknowledged\n"
