"""What people ask of the daemon, at the control socket and on the page."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, cast

import pytest

from fti import run_directory
from fti.alarms.condition import Condition, Severity
from fti.clock import FakeClock
from fti.config import Config, Nav, Session
from fti.messages.control import EventNote, PageAcknowledgement, PageCommand, Readmit, RecorderNote
from fti.messages.notes import AlarmRecord
from fti.messages.tables import to_table
from fti.service.children import Child
from fti.service.supervisor.alarm_board import AlarmBoard
from fti.service.supervisor.child_monitor import RecorderOutbox
from fti.service.supervisor.control_socket import serve_commands
from fti.service.supervisor.event_publisher import EventPublisher
from fti.service.supervisor.operator_requests import OperatorRequests
from tests.helpers import until_async
from tests.run_dirs import peers_of_user
from tests.service.command_bench import Bench


class Rig:
    def __init__(self) -> None:
        self.bench = Bench()
        self.shown: list[Any] = []
        self.events: list[dict[str, Any]] = []
        self.navigation: list[Any] = []
        self.navigation_runs = True
        clock = FakeClock(7)
        self.alarms = AlarmBoard(clock, lambda topic, payload: None, lambda *_: None, lambda: None)
        self.requests = OperatorRequests(
            Config(session=Session(name="s"), nav=Nav(position=("ins", "gnss")), path="a.toml"),
            clock,
            command_tracker=self.bench.command_tracker,
            outbox=RecorderOutbox(Child("recorder")),
            event_publisher=EventPublisher(
                clock,
                lambda topic, payload: None,
                lambda line: None,
                self.note,
            ),
            send_to_display=self.shown.append,
            send_to_navigation=self.send_to_navigation,
            alarms=self.alarms,
        )

    def note(self, note: RecorderNote) -> None:
        assert isinstance(note, EventNote)
        self.events.append({**to_table(note.event), "who": note.who})

    def send_to_navigation(self, message: Any) -> bool:
        self.navigation.append(message)
        return self.navigation_runs


@pytest.fixture
def rig() -> Rig:
    return Rig()


async def test_a_display_that_starts_receives_commands(rig: Rig) -> None:
    await (await rig.bench.ask_and_send("k1", "reset"))
    rig.requests.send_commands_to_display()
    assert [device.name for device in rig.shown[0].devices] == ["mag", "other"]
    assert [message.id for message in rig.shown[1:]] == ["k1"]


async def test_the_page_sends_and_its_user_is_named(rig: Rig) -> None:
    for _ in range(2):
        rig.requests.on_page_message(PageCommand("k1", "mag", "reset", "alice"))
    assert len(rig.bench.sent) == 1
    assert rig.bench.events == [("info", "1: mag reset for the page (the owner's key, alice): 2a72657365740d")]


async def test_a_mark_is_an_event_and_a_trigger_needs_a_table(rig: Rig) -> None:
    assert await rig.requests.handle_command({"mark": "here"}, "root") == {"t_ns": 7}
    assert [event["text"] for event in rig.events] == ["here"]
    assert (
        "no [snapshot] table" in (await rig.requests.handle_command({"mark": "here", "trigger": True}, "root"))["fault"]
    )
    assert await rig.requests.handle_command({"halt": True}, "root") == {"fault": "unknown command"}
    assert await rig.requests.handle_command({"send": 7}, "root") == {"fault": "unknown command"}
    assert len((await rig.requests.handle_command({"commands": True}, "root"))["devices"]) == 4


async def test_a_source_is_readmitted_by_navigation_and_the_event_names_who(rig: Rig) -> None:
    assert await rig.requests.handle_command({"readmit": "gnss"}, "alice") == {"t_ns": 7}
    assert rig.navigation == [Readmit("gnss")]
    (event,) = rig.events
    assert (event["source"], event["text"], event["who"]) == ("readmit", "gnss", "alice")


async def test_all_sources_are_readmitted_at_once(rig: Rig) -> None:
    assert await rig.requests.handle_command({"readmit": "*"}, "alice") == {"t_ns": 7}
    assert rig.navigation == [Readmit("*")]
    assert [event["text"] for event in rig.events] == ["all sources; navigation is reset"]


async def test_what_is_not_a_source_or_has_no_navigation_is_not_readmitted(rig: Rig) -> None:
    for wrong in ("radar", 7, {"a": 1}, None):
        fault = (await rig.requests.handle_command({"readmit": wrong}, "alice"))["fault"]
        assert "is not a position source; configured: ins, gnss" in fault
    rig.navigation_runs = False
    assert "navigation is restarting" in (await rig.requests.handle_command({"readmit": "gnss"}, "alice"))["fault"]
    assert rig.events == []


async def test_the_control_socket_names_who_asks_and_answers_in_order(rig: Rig, tmp_path: Path) -> None:
    failed: list[str] = []
    directory = run_directory.make("s", str(tmp_path))
    server = await serve_commands(
        directory.bind(), rig.requests.handle_command, lambda unit, error: failed.append(unit)
    )
    assert directory.control_socket.stat().st_mode & 0o777 == 0o600
    reader, writer = await asyncio.open_unix_connection(str(directory.control_socket))
    request = {"id": "k1", "device": "mag", "command": "rate", "args": {"rate": "5"}}
    for line in ({"send": request}, {"mark": "behind it"}, ["no"], "{"):
        writer.write((line if isinstance(line, str) else json.dumps(line)).encode() + b"\n")
    await until_async(lambda: rig.bench.sent)
    rig.bench.confirm_sending()
    rig.bench.answer()
    answers = [json.loads(await asyncio.wait_for(reader.readline(), 10.0)) for _ in range(4)]
    assert answers[0]["state"] == "acknowledged"
    assert answers[0]["who"].endswith(f"(process {os.getpid()})")
    assert answers[1] == {"t_ns": 7}
    assert [cast(dict[str, str], answer)["fault"] for answer in answers[2:]] == [
        "a command must be a JSON object",
        "a command must be one line of JSON of at most 65536 bytes",
    ]
    writer.close()
    server.close()
    directory.withdraw()
    assert failed == []


@pytest.mark.parametrize("line", [b"[" * 60_000 + b"\n", b"{" + b" " * 70_000 + b"}\n", b" " * 300_000, b"\xff\n"])
async def test_what_is_no_command_is_answered(rig: Rig, tmp_path: Path, line: bytes) -> None:
    async with client(rig, tmp_path) as (reader, writer, failed):
        writer.write(line)
        answer = json.loads(await asyncio.wait_for(reader.readline(), 10.0))
    assert answer == {"fault": "a command must be one line of JSON of at most 65536 bytes"}
    assert failed == []


async def test_a_command_that_fails_here_is_answered_and_the_next_one_too(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with client(rig, tmp_path) as (reader, writer, failed):
        with monkeypatch.context() as broken:
            broken.setattr(rig.bench.command_tracker.catalogue, "describe", lambda: 1 / 0)
            writer.write(b'{"commands": true}\n')
            answer = json.loads(await asyncio.wait_for(reader.readline(), 10.0))
        assert answer == {"fault": "internal error, see the event log"}
        assert failed == ["control socket: division by zero"]
        writer.write(b'{"commands": true}\n')
        assert "devices" in json.loads(await asyncio.wait_for(reader.readline(), 10.0))


async def test_a_process_of_another_user_is_refused(rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    peers_of_user(os.geteuid() + 12345, monkeypatch)
    async with client(rig, tmp_path) as (reader, writer, failed):
        writer.write(b'{"mark": "not mine"}\n{"send": {}}\n')
        answers = [json.loads(await asyncio.wait_for(reader.readline(), 10.0)) for _ in range(2)]
    assert answers == [{"fault": "only root and the user who started the daemon may send commands"}] * 2
    assert (rig.events, rig.bench.events, failed) == ([], [], [])


async def test_a_client_that_goes_before_its_answer_is_no_failure(rig: Rig, tmp_path: Path) -> None:
    request = {"id": "k1", "device": "mag", "command": "rate", "args": {"rate": "5"}}
    async with client(rig, tmp_path) as (_, writer, failed):
        writer.write((json.dumps({"send": request}) + "\n").encode() * 20)
        await until_async(lambda: rig.bench.sent)
        writer.transport.abort()
        await asyncio.sleep(0.01)
        rig.bench.confirm_sending()
        rig.bench.answer()
        await until_async(lambda: not client_tasks())
    assert failed == []
    assert len(rig.bench.sent) == 1


async def test_a_daemon_that_ends_with_a_connected_client_reports_no_error(rig: Rig, tmp_path: Path) -> None:
    wrong: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: wrong.append(context))
    async with client(rig, tmp_path):
        await until_async(client_tasks)
        tasks = client_tasks()
        for task in tasks:  # as the end of the loop does
            task.cancel()
        await asyncio.wait(tasks)
        await asyncio.sleep(0)
    assert wrong == []


def client_tasks() -> list[asyncio.Task[Any]]:
    """The tasks that serve clients."""
    return [task for task in asyncio.all_tasks() if "serve_client" in str(task.get_coro())]


@contextlib.asynccontextmanager
async def client(
    rig: Rig, tmp_path: Path
) -> AsyncIterator[tuple[asyncio.StreamReader, asyncio.StreamWriter, list[str]]]:
    """A connection to the control socket of these requests, and its failures."""
    failed: list[str] = []
    directory = run_directory.make("s", str(tmp_path))
    server = await serve_commands(
        directory.bind(), rig.requests.handle_command, lambda unit, error: failed.append(f"{unit}: {error}")
    )
    reader, writer = await asyncio.open_unix_connection(str(directory.control_socket))
    try:
        yield reader, writer, failed
    finally:
        writer.close()
        server.close()
        directory.withdraw()


async def test_alarms_are_acknowledged_at_the_socket_and_on_the_page(rig: Rig) -> None:
    """By whom is known."""
    changes: list[tuple[str, Any]] = []

    def note_change(note: RecorderNote) -> None:
        assert isinstance(note, AlarmRecord)
        changes.append((note.change, note.acknowledged_by))

    rig.alarms._record_note = note_change
    condition = Condition("losses", Severity.CAUTION, "DATA LOST")
    rig.alarms.record(condition)
    assert await rig.requests.handle_command({"acknowledge": "losses"}, "anna") == {"acknowledged": 1, "t_ns": 7}
    assert await rig.requests.handle_command({"acknowledge": None}, "anna") == {"acknowledged": 0, "t_ns": 7}
    assert "fault" in await rig.requests.handle_command({"acknowledge": 3}, "anna")
    rig.alarms.record(condition)
    rig.requests.on_page_message(PageAcknowledgement(None, "berta"))
    assert [who for change, who in changes if change == "acknowledged"] == [
        "anna",
        "the page (the owner's key, berta)",
    ]
