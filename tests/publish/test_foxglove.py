"""The Foxglove server against a client that is written from the specification of the protocol."""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import aiohttp
import jsonschema
import pytest

from fti.bus.loopback import choose_port
from fti.config import FoxgloveTable
from fti.logger.schemas import foxglove_schema, schema_of
from fti.messages.outputs import GlideSlope
from fti.publish.message import PublishedMessage, SessionIdentity
from fti.publish.sink import SinkError
from fti.publish.sinks.foxglove import BACKLOG_MESSAGES, FoxgloveSink
from tests.helpers import ROOT, until, until_async
from tests.publish.bus_messages import alarms, event, glide_slope, solution
from tests.publish.foxglove_client import SUBPROTOCOL, Connection, FoxgloveClient
from tests.publish.solutions import T_NS, message

SOLUTION, GLIDE, LOCATION, EVENT = "/nav/nav_solution", "/nav/glide_slope", "/nav/location", "/fti/event"


@pytest.fixture
def port() -> int:
    return choose_port(0)


@pytest.fixture
def sink(port: int) -> Iterator[FoxgloveSink]:
    made = FoxgloveSink(FoxgloveTable(port=port), SessionIdentity("D-EFTI", "nominal"))
    made.open()
    yield made
    made.close()


async def served(sink: FoxgloveSink, predicate: Callable[[], object], what: str = "") -> None:
    """Wait, while the sink is called as its thread calls it without messages."""
    await until_async(lambda: sink.send([]) or predicate(), what=what)  # type: ignore[func-returns-value]


async def sees(sink: FoxgloveSink, client: FoxgloveClient, *topics: str) -> None:
    """Wait for the newest value of topics, which comes because the client has subscribed."""
    for topic in topics:
        await served(sink, lambda topic=topic: client.of(topic), topic)  # type: ignore[misc]


def newest_ns(client: FoxgloveClient, topic: str) -> int:
    """Time of the newest message after T_NS [ns]; -1 without one."""
    newest = client.newest(topic)
    return newest.log_ns - T_NS if newest else -1


async def test_every_output_comes_with_its_schema(sink: FoxgloveSink, port: int) -> None:
    sent = [message(solution()), message(glide_slope()), event("low"), alarms()]
    sink.send(sent)
    async with Connection(port) as client:
        topics = {SOLUTION, GLIDE, LOCATION, "/nav/pose", "/nav/transform", "/nav/track", EVENT, "/alarms"}
        await sees(sink, client, *topics - {EVENT})
        assert topics <= set(client.channels) and sink.count_peers() == 1
        await until_async(lambda: sink.send(sent) or client.of(EVENT), what="an event")  # type: ignore[func-returns-value]
        for topic in topics:
            channel = client.channels[topic]
            assert (channel["encoding"], channel["schemaEncoding"]) == ("json", "jsonschema"), topic
            schema = json.loads(channel["schema"])
            assert schema["title"] == channel["schemaName"]
            jsonschema.Draft7Validator.check_schema(schema)
            for each in client.of(topic):
                jsonschema.Draft7Validator(schema).validate(each.content)
        newest = client.newest(GLIDE)
        assert newest and newest.log_ns == T_NS
        assert newest.content == json.loads(sent[1].payload)
        log = client.newest(EVENT)
        assert log and (log.content["message"], log.content["level"]) == ("low", 3)
    await until_async(lambda: sink.count_peers() == 0, what="the client has gone")


async def test_topics_and_schemas_are_those_of_files(sink: FoxgloveSink, port: int) -> None:
    """A field of a file is live too, with the same unit; live there is the age as well."""
    sink.send([message(glide_slope()), message(solution()), event("x")])
    async with Connection(port) as client:
        await until_async(lambda: {GLIDE, EVENT, LOCATION} <= set(client.channels), what="the channels")
        live, file = json.loads(client.channels[GLIDE]["schema"]), json.loads(schema_of(GlideSlope).data)
        assert client.channels[GLIDE]["schemaName"] == schema_of(GlideSlope).name
        added = {"age_ms", "max_age_ms", "late"}
        assert live["properties"].keys() - file["properties"].keys() == added
        assert {name: live["properties"][name] for name in live["properties"].keys() - added} == file["properties"]
        assert live["properties"]["deviation"]["description"] == "[rad]"
        for topic, name in ((EVENT, "Log"), (LOCATION, "LocationFix")):
            assert client.channels[topic]["schema"].encode() == foxglove_schema(name).data


async def test_the_server_names_itself_and_accepts_nothing(sink: FoxgloveSink, port: int) -> None:
    sink.send([message(glide_slope())])
    async with Connection(port) as client:
        await sees(sink, client, GLIDE)
        assert client.info["name"] == "fti D-EFTI nominal"
        assert client.info["sessionId"].startswith("nominal/")
        assert client.info["capabilities"] == []
        wanted = {"id": 1, "topic": "/command", "encoding": "json", "schemaName": "x"}
        await client.send(op="advertise", channels=[wanted])
        await client.publish(1, b'{"send": "it"}')
        await client.send(op="setParameters", parameters=[{"name": "x", "value": 1}])
        await until_async(lambda: len(client.statuses) >= 3, what="three refusals")
        assert {status["level"] for status in client.statuses} == {2}, client.statuses  # errors
        texts = " ".join(status["message"] for status in client.statuses)
        assert "clientPublish" in texts and "parameters" in texts
        sink.send([message(glide_slope(T_NS + 1))])
        await until_async(lambda: newest_ns(client, GLIDE) == 1)


async def test_a_client_of_another_protocol_is_refused(sink: FoxgloveSink, port: int) -> None:
    async with aiohttp.ClientSession() as session:
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await session.ws_connect(f"http://127.0.0.1:{port}", protocols=["other"])


async def test_no_position_while_it_is_invalid(sink: FoxgloveSink, port: int) -> None:
    sink.send([message(solution())])
    async with Connection(port) as client:
        await sees(sink, client, LOCATION, SOLUTION)
        sink.send([message(solution(T_NS + 40, valid=False))])
        sink.send([message(solution(T_NS + 80), age_ms=600.0)])  # late, therefore invalid
        await until_async(lambda: newest_ns(client, SOLUTION) == 80, what="the late solution")
        assert {each.log_ns for each in client.of(LOCATION)} == {T_NS}
    async with Connection(port) as client:  # and none for one that comes now
        await sees(sink, client, SOLUTION)
        await served(sink, lambda: client.of("/nav/track"))
        assert not client.of(LOCATION) and not client.of("/nav/pose")


async def test_an_output_that_ends_becomes_late(sink: FoxgloveSink, port: int) -> None:
    """Navigation that has died sends no invalid output; a panel would show its last valid one."""
    sink.send([message(glide_slope()), message(solution())])
    async with Connection(port) as client:
        await sees(sink, client, GLIDE)
        await served(sink, lambda: newest_ns(client, GLIDE) > 0, "a late output")
        newest = client.newest(GLIDE)
        assert newest and newest.content["late"] and not newest.content["valid"] and newest.content["dots"] == 0.1
        assert newest.content["age_ms"] > 500.0 and newest.log_ns > T_NS + 500_000_000
    async with Connection(port) as client:
        await sees(sink, client, GLIDE, SOLUTION)
        assert {each.content["valid"] for each in client.of(GLIDE) + client.of(SOLUTION)} == {False}
        assert not client.of(LOCATION)


async def test_what_has_waited_is_late_and_what_is_no_message_is_left_out(sink: FoxgloveSink, port: int) -> None:
    """An output of the queue after a minute without a server is the newest one, but not valid."""
    waited = message(solution(), received_s=time.monotonic() - 60.0)
    sink.send([PublishedMessage(GLIDE, b'{"t_ns": "now"}', 1), PublishedMessage("/other", b"{}", 1), waited])
    async with Connection(port) as client:
        await sees(sink, client, SOLUTION)
        newest = client.newest(SOLUTION)
        assert newest and newest.content["late"] and not newest.content["valid"]
        assert newest.content["age_ms"] == pytest.approx(60_020.0, abs=5_000.0)
        assert {each.topic for each in client.messages} == {SOLUTION} and "/other" not in client.channels


async def test_a_client_that_waits_gets_the_first_event(sink: FoxgloveSink, port: int) -> None:
    async with Connection(port) as client:
        await until_async(lambda: sink.count_peers() == 1, what="a subscription before any message")
        sink.send([event("first")])
        await until_async(lambda: client.of(EVENT))


async def test_a_late_client_gets_the_newest_values_at_once_but_no_event_again(sink: FoxgloveSink, port: int) -> None:
    sink.send([message(solution()), message(glide_slope()), event("once")])
    async with Connection(port) as first:
        await sees(sink, first, SOLUTION, GLIDE, LOCATION, "/nav/track")
        sink.send([event("twice")])
        await until_async(lambda: first.of(EVENT))
        async with Connection(port) as second:
            await sees(sink, second, SOLUTION, GLIDE, LOCATION, "/nav/track")
            assert not second.of(EVENT)
        assert [each.content["message"] for each in first.of(EVENT)] == ["twice"]


async def test_a_used_port_is_reported_and_used_as_soon_as_it_is_free(port: int) -> None:
    sink = FoxgloveSink(FoxgloveTable(port=port), SessionIdentity("D-EFTI", "nominal"))
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", port))
        other.listen()
        with pytest.raises(SinkError, match=f"publish.foxglove.port: 127.0.0.1:{port}: .*in use"):
            sink.open()
        sink.close()
    sink.open()
    sink.send([message(glide_slope())])
    async with Connection(port) as client:
        await sees(sink, client, GLIDE)
    sink.close()


async def test_a_server_that_is_started_again_serves_the_same_topics(sink: FoxgloveSink, port: int) -> None:
    sink.send([message(glide_slope())])
    async with Connection(port) as client:
        await sees(sink, client, GLIDE)
        sink.close()
        await until_async(lambda: client.has_ended, what="the end of the connection")

    def opens() -> bool:
        try:
            sink.open()
        except SinkError:
            return False
        return True

    until(opens, what="the port")
    sink.send([message(glide_slope())])
    async with Connection(port) as client:
        await sees(sink, client, GLIDE)


async def test_a_hundred_clients_get_every_message(sink: FoxgloveSink, port: int) -> None:
    sink.send([message(glide_slope())])
    async with contextlib.AsyncExitStack() as stack:
        session = await stack.enter_async_context(aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=0)))
        clients = [await stack.enter_async_context(Connection(port, session)) for _ in range(100)]
        await until_async(lambda: sink.count_peers() == 100, what="all clients")
        for i in range(1, 51):
            sink.send([message(glide_slope(T_NS + i))])
            await asyncio.sleep(0.005)
        for client in clients:
            await until_async(lambda client=client: newest_ns(client, GLIDE) == 50)  # type: ignore[misc]
            assert {each.log_ns - T_NS for each in client.of(GLIDE)} >= set(range(1, 51))


@contextlib.contextmanager
def client_program(port: int) -> Iterator[subprocess.Popen[str]]:
    """A client in a process of its own."""
    program = [sys.executable, "-m", "tests.publish.foxglove_client", str(port)]
    process = subprocess.Popen(program, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


async def test_a_stopped_client_delays_nobody(sink: FoxgloveSink, port: int) -> None:
    """It loses the oldest messages, the others none; what waits for it is bounded."""
    topic, text, count = EVENT, 4000 * "x", 5000  # more bytes than the buffers of the sockets
    sink.send([event("first")])
    with client_program(port) as stopped:
        assert stopped.stdout
        await until_async(lambda: sink.count_peers() == 1)
        sink.send([event("second")])  # an event is not repeated
        assert (await asyncio.to_thread(stopped.stdout.readline)).split() == [topic, str(T_NS)]
        stopped.send_signal(signal.SIGSTOP)
        async with Connection(port) as client:
            await until_async(lambda: sink.count_peers() == 2)
            for i in range(count):
                sink.send([event(text, T_NS + i)])
                if i % 100 == 99:  # it has room for more
                    await until_async(lambda i=i: newest_ns(client, topic) == i)  # type: ignore[misc]
            assert [each.log_ns - T_NS for each in client.of(topic)] == list(range(count))
        stopped.send_signal(signal.SIGCONT)
        lines = [""]
        while lines[-1] != f"{topic} {T_NS + count - 1}":
            lines.append((await asyncio.to_thread(stopped.stdout.readline)).strip())
            assert lines[-1], lines[-2]
        assert BACKLOG_MESSAGES <= len(lines) < count


async def test_a_client_that_floods_is_disconnected_and_delays_nobody(sink: FoxgloveSink, port: int) -> None:
    """It sends requests and does not read the errors."""
    sink.send([message(glide_slope())])
    async with Connection(port) as client, aiohttp.ClientSession() as session:
        await sees(sink, client, GLIDE)
        flood = await session.ws_connect(f"http://127.0.0.1:{port}", protocols=[SUBPROTOCOL])
        wrong = json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 10_000}]})
        sent = 0
        with pytest.raises(aiohttp.ClientConnectionResetError):
            while True:
                await flood.send_str(wrong)
                if (sent := sent + 1) % 100 == 0:
                    sink.send([message(glide_slope(T_NS + sent))])
                    await asyncio.sleep(0.0)
        await until_async(lambda: newest_ns(client, GLIDE) == sent // 100 * 100)
