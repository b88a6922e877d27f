"""A flight seen by a client of Foxglove, and its files: the same topics, schemas and positions."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import aiohttp
import jsonschema
import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema

from fti.bus.loopback import choose_port
from fti.example_files import FOLDER
from tests.e2e.harness import FTI, fti
from tests.helpers import ROOT, until_async
from tests.processes import children_of
from tests.publish.foxglove_client import Connection, FoxgloveClient
from tests.publish.test_layouts import ONLY_LIVE, keys_with

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(600)]
CONFIGS = ROOT / "configs"
OUTPUTS = (
    "nav_solution",
    "height_above_ground/altimeter",
    "height_below_aircraft",
    "clearance_integrity",
    "glide_slope",
)
SCENE = ("location", "pose", "transform", "track")
LOCATION, POSITIONS = "/nav/location", 5
OTHERS = {"/fti/event", "/fti/health", "/alarms", "/hil"}
START_S, POLL_S = 120.0, 0.05
DURATION_S = 12


def write_scenario(folder: Path, port: int) -> Path:
    """A short approach with a Foxglove server."""
    text = (CONFIGS / "demo.toml").read_text().replace('"profiles/', f'"{CONFIGS}/profiles/')
    config = folder / "demo.toml"
    config.write_text(f'{text}\n[publish]\naircraft = "D-EFTI"\n[publish.foxglove]\nport = {port}\n')
    approach = (CONFIGS / "scenarios" / "nominal.toml").read_text().replace("../demo.toml", str(config))
    scenario = folder / "short.toml"
    scenario.write_text(approach + '\n[flight]\nkind = "approach"\nduration_s = 30\n')
    return scenario


async def connect(port: int) -> Connection:
    """A connection as soon as the server listens."""
    for _ in range(round(START_S / POLL_S)):
        connection = Connection(port)
        try:
            await connection.open()
        except aiohttp.ClientError:
            await asyncio.sleep(POLL_S)
            continue
        return connection
    raise AssertionError("the server does not listen")


@contextlib.contextmanager
def demonstration(scenario: Path, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A daemon that flies a scenario for some seconds."""
    where = ("--out", str(folder / "out"), "--run-dir", str(folder / "run"))
    command = [*FTI, "demo", "--headless", "--scenario", str(scenario), "--duration", str(DURATION_S), *where]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def publish_pid(parent: int) -> int:
    """Process number of the publish process."""
    (pid,) = (p for p in children_of(parent) if b"fti.service.publish" in Path(f"/proc/{p}/cmdline").read_bytes())
    return pid


def messages_of(files: Iterator[Path]) -> list[tuple[Schema | None, Channel, Message]]:
    return [found for file in files for found in make_reader(io.BytesIO(file.read_bytes())).iter_messages()]


async def test_a_client_sees_every_output_as_files_have_it_also_after_a_kill(tmp_path: Path) -> None:
    port = choose_port(0)
    with demonstration(write_scenario(tmp_path, port), tmp_path) as process:
        first = await connect(port)
        topics = {f"/nav/{name}" for name in (*OUTPUTS, *SCENE)} | OTHERS
        await until_async(lambda: topics <= {each.topic for each in first.client.messages}, START_S, "every topic")
        await until_async(lambda: len(first.client.of(LOCATION)) >= POSITIONS, what="positions")
        os.kill(publish_pid(process.pid), signal.SIGKILL)
        await until_async(lambda: first.client.has_ended, what="the end of the connection")
        second = await connect(port)
        await until_async(lambda: len(second.client.of(LOCATION)) >= POSITIONS, what="positions after the restart")
        text, _ = await asyncio.to_thread(process.communicate, timeout=START_S)
        assert process.returncode == 0, text
    for connection in (first, second):
        await connection.close()
    assert first.client.info["sessionId"] != second.client.info["sessionId"]
    (session,) = (tmp_path / "out").glob("demo_*")
    assert first.client.info["name"] == f"fti D-EFTI {session.name}"
    for client in (first.client, second.client):
        check_messages(client)
    compare_with_files(first.client, session)
    compare_with_files(second.client, session)
    verified = fti("verify", str(session))
    assert verified.returncode == 0, verified.stdout + verified.stderr


def check_messages(client: FoxgloveClient) -> None:
    """Each message follows its schema, and none that is late or not valid is a position."""
    validators = {topic: jsonschema.Draft7Validator(json.loads(c["schema"])) for topic, c in client.channels.items()}
    for message in client.messages:
        validators[message.topic].validate(message.content)
    solutions = client.of("/nav/nav_solution")
    assert not any(each.content["valid"] and each.content["late"] for each in solutions)
    valid = {each.log_ns for each in solutions if each.content["valid"]}
    assert {each.log_ns for each in client.of(LOCATION) if each.log_ns > solutions[0].log_ns} <= valid


def compare_with_files(client: FoxgloveClient, session: Path) -> None:
    """The same schemas and positions; the layout finds its topics in both."""
    rows = messages_of(session.glob("*.mcap"))
    schemas = {channel.topic: schema for schema, channel, _ in rows if schema}
    for topic in schemas.keys() & client.channels.keys():
        live, file = client.channels[topic], schemas[topic]
        assert live["schemaName"] == file.name, topic
        live_fields, file_fields = json.loads(live["schema"])["properties"], json.loads(file.data)["properties"]
        assert live_fields.keys() - file_fields.keys() <= {"age_ms", "max_age_ms", "late"}, topic
        assert {name: live_fields[name] for name in file_fields} == file_fields, topic
    positions = {m.log_time: json.loads(m.data) for _, channel, m in rows if channel.topic == LOCATION}
    found = client.of(LOCATION)
    assert len(found) >= POSITIONS
    assert [each.content for each in found] == [positions[each.log_ns] for each in found]
    layout: dict[str, Any] = json.loads((FOLDER / "layouts" / "foxglove.json").read_text())["configById"]
    used = {text.split(".")[0] for text in keys_with(layout, {"value", "path", "topicPath", "followTopic"})}
    assert used - ONLY_LIVE <= schemas.keys()
    assert used <= client.channels.keys()
