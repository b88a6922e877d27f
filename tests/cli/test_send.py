"""``fti send``: what it asks of the daemon, what it teaches, and its exit codes."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from fti.cli.main import main
from fti.run_directory import RunDirectory
from fti.service.supervisor.control_socket import serve_commands
from tests.run_dirs import running_daemon

DEVICES = [
    {
        "name": "magnetometer",
        "driver": "hmr2300",
        "link": "mag_line",
        "transmit": True,
        "commands": {
            "set_rate": {"does": "set the output rate", "arguments": {"rate": "Hz, 10 to 154"}, "answered": True},
            "reset": {"does": "start again", "arguments": {}, "answered": False},
        },
    },
    {"name": "gnss", "driver": "nmea0183", "link": "gnss_line", "transmit": False, "commands": {}},
]


def send(run_dir: Path, *arguments: str, state: str = "acknowledged", fault: str = "") -> tuple[int, list[Any]]:
    """Exit code of the command beside a daemon, and what the daemon was asked."""
    commands: list[dict[str, Any]] = []

    async def obey(command: dict[str, Any], who: str) -> dict[str, Any]:
        commands.append(command)
        if "commands" in command:
            return {"devices": DEVICES}
        title = f"1: {command['send']['device']} {command['send']['command']}"
        return {"fault": fault} if fault else {"state": state, "title": title, "outcome": f"{state}: why"}

    async def run_command(directory: RunDirectory) -> int:
        server = await serve_commands(directory.bind(), obey, lambda unit, error: pytest.fail(f"{unit}: {error}"))
        async with server:
            return await asyncio.to_thread(main, ["send", *arguments, "--run-dir", str(run_dir)])

    with running_daemon(run_dir) as directory:
        return asyncio.run(run_command(directory)), commands


def test_a_command_with_its_arguments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, (commands,) = send(tmp_path, "magnetometer", "set_rate", "rate=20", "note=a=b c", "--timeout", "1.5")
    key = commands["send"].pop("id")
    assert commands["send"] == {
        "device": "magnetometer",
        "command": "set_rate",
        "args": {"rate": "20", "note": "a=b c"},
        "timeout_s": 1.5,
    }
    assert code == 0
    assert capsys.readouterr().out == "1: magnetometer set_rate: acknowledged: why\n"
    assert send(tmp_path, "magnetometer", "set_rate")[1][0]["send"]["id"] != key


def test_an_absurd_time_is_the_daemons_to_refuse(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    why = "timeout_s is more than 0 and at most 600 seconds"
    assert send(tmp_path, "magnetometer", "reset", "--timeout", "1e300", fault=why)[0] == 2
    assert why in capsys.readouterr().err


def test_a_daemon_that_goes_within_its_answer_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    async def die(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readline()
        writer.write(b'{"state": "ackn')
        writer.close()

    async def run_command(directory: RunDirectory) -> int:
        async with await asyncio.start_unix_server(die, sock=directory.bind()):
            return await asyncio.to_thread(main, ["send", "magnetometer", "reset", "--run-dir", str(tmp_path)])

    with running_daemon(tmp_path) as directory:
        assert asyncio.run(run_command(directory)) == 2
    assert "the daemon ended before it answered" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("state", "code"),
    [("acknowledged", 0), ("sent", 0), ("refused", 1), ("timed out", 1), ("not sent", 1), ("unknown", 1)],
)
def test_the_exit_code_reports_whether_it_was_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], state: str, code: int
) -> None:
    assert send(tmp_path, "magnetometer", "reset", "--json", state=state)[0] == code
    assert json.loads(capsys.readouterr().out)["state"] == state


def test_what_is_denied_is_a_wrong_call(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert send(tmp_path, "gnss", "reset", fault="set transmit = true")[0] == 2
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "fti: the daemon refuses: set transmit = true\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "fti send --list"),
        (("magnetometer", "--list"), "fti send --list"),
        (("magnetometer", "set_rate", "20"), "must be KEY=VALUE"),
        (("magnetometer", "set_rate", "=20"), "must be KEY=VALUE"),
        (("magnetometer", "set_rate", "rate=1", "rate=2"), "each key at most once"),
        (("none",), "no device 'none'; configured: magnetometer, gnss"),
    ],
)
def test_a_wrong_call_sends_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], message: str
) -> None:
    code, commands = send(tmp_path, *arguments)
    assert code == 2
    assert message in capsys.readouterr().err
    assert not any("send" in command for command in commands)


def test_it_teaches(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert send(tmp_path, "--list")[0] == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.split() == ["magnetometer", "hmr2300", "mag_line", "may", "transmit", "set_rate,", "reset"]
    assert "may not transmit (transmit = false)" in second
    assert second.endswith("no commands")
    assert send(tmp_path, "magnetometer")[0] == 0
    output = capsys.readouterr().out
    assert "fti send magnetometer set_rate rate=...\n  set the output rate\n  rate             Hz, 10 to 154" in output
    assert "start again (not acknowledged)" in output
    send(tmp_path, "gnss")
    assert "no commands" in capsys.readouterr().out
    send(tmp_path, "--list", "--json")
    assert json.loads(capsys.readouterr().out) == DEVICES


def test_without_a_daemon_there_is_nobody_to_ask(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["send", "--list", "--run-dir", str(tmp_path)]) == 2
    assert "no daemon is running there" in capsys.readouterr().err
