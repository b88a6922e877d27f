"""Foreign zenoh clients: they read what the bus has, and nothing that they send reaches anybody."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
import zenoh

from fti.bus.client import Publisher, Subscriber
from fti.bus.loopback import choose_port, describe_endpoint
from fti.bus.zenoh_endpoint import ZenohEndpoint
from fti.clock import SystemClock
from fti.errors import MissingError
from fti.messages.control import FromChild, Stop, ToDisplay
from fti.service import zenoh as relay
from fti.service.control_channel import ControlChannel
from tests.bus.running_hub import DEADLINE_S, RunningHub, wait_for
from tests.helpers import fail

NAME = "test_1"


class ForeignClient:
    """A zenoh client that reads everything and sends what it likes."""

    def __init__(self, endpoint: str) -> None:
        table = {
            "mode": "client",
            "connect": {"endpoints": [endpoint], "timeout_ms": 20000},
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        }
        self.session = zenoh.open(zenoh.Config.from_json5(json.dumps(table)))
        self.messages: list[tuple[str, bytes]] = []
        self.alive: dict[str, bool] = {}
        self.session.declare_subscriber("**", self._take)
        self.session.liveliness().declare_subscriber("fti/*/@alive/*", self._take_alive, history=True)

    def _take(self, sample: zenoh.Sample) -> None:
        self.messages.append((str(sample.key_expr), sample.payload.to_bytes()))

    def _take_alive(self, sample: zenoh.Sample) -> None:
        self.alive[str(sample.key_expr)] = sample.kind == zenoh.SampleKind.PUT

    def close(self) -> None:
        self.session.close()  # type: ignore[no-untyped-call]


class ZenohProcess:
    """The real process, started as the supervisor starts it."""

    def __init__(self, bus: Path) -> None:
        self.port = choose_port(0)
        self.control, theirs = socket.socketpair()
        where = ("--bus", str(bus), "--session", NAME, "--port", str(self.port), "--epoch-ns", "0")
        command = [sys.executable, "-m", "fti.service.zenoh", *where, "--control-fd", str(theirs.fileno())]
        self.process = subprocess.Popen(command, pass_fds=[theirs.fileno()])
        theirs.close()
        assert b"Ready" in self.control.recv(1000)

    def close(self) -> None:
        """For a child, the end of the channel is the end."""
        self.control.close()
        assert self.process.wait(DEADLINE_S) == 0


@pytest.fixture
def running() -> Iterator[RunningHub]:
    with RunningHub() as made:
        yield made


def publish_until(running: RunningHub, topic: str, client: ForeignClient) -> None:
    """A subscription takes a moment to become known."""
    key = f"fti/{NAME}{topic}"

    def arrived() -> bool:
        running.hub.publish(topic, b"payload")
        return (key, b"payload") in client.messages

    wait_for(arrived, topic)


def test_clients_read_and_what_they_send_reaches_nobody(running: RunningHub) -> None:
    messages: list[tuple[str, bytes]] = []
    with (
        closing(Publisher(running.hub.path, "navigation")) as navigation,
        closing(Subscriber(running.hub.path, "page", lambda topic, payload, _: messages.append((topic, payload)))),
        closing(ZenohProcess(running.hub.path)) as process,
        closing(ForeignClient(describe_endpoint(process.port))) as hostile,
        closing(ForeignClient(describe_endpoint(process.port))) as reader,
    ):
        publish_until(running, "/health", reader)
        publish_until(running, "/health", hostile)
        tokens = [f"fti/{NAME}/@alive/{name}" for name in ("navigation", "supervisor")]
        wait_for(lambda: all(reader.alive.get(token) for token in tokens), "liveliness")
        for key in (f"fti/{NAME}/nav/clearance_integrity", f"fti/{NAME}/health", "other"):
            hostile.session.put(key, b"spoofed")
            hostile.session.delete(key)
        token = hostile.session.liveliness().declare_token(f"fti/{NAME}/@alive/emulator")
        navigation.publish("/nav/last", b"true")
        wait_for(lambda: (f"fti/{NAME}/nav/last", b"true") in reader.messages, "an output")
        publish_until(running, "/event", reader)
        assert {payload for _, payload in reader.messages} == {b"payload", b"true"}
        assert set(reader.alive) == set(tokens)
        assert {payload for _, payload in messages} == {b"payload", b"true"}
        navigation.close()
        wait_for(lambda: reader.alive.get(tokens[0]) is False, "the end of navigation")
        token.undeclare()  # type: ignore[no-untyped-call]
    assert running.warnings == []


def test_a_port_in_use_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(
            MissingError, match=f"bus.port = {port}: cannot be used on 127.0.0.1: Address already in use"
        ):
            choose_port(port)


class PanicException(BaseException):
    """As pyo3 has it: no Exception."""


class Failing:
    """An endpoint that panics at its nth message."""

    def __init__(self, good: int) -> None:
        self.good, self.payloads = good, list[bytes]()
        self.closed = False

    def publish(self, topic: str, payload: bytes) -> None:
        if len(self.payloads) >= self.good:
            raise PanicException("called `Result::unwrap()` on an `Err` value: SystemTimeError")
        self.payloads.append(payload)

    def set_alive(self, process: str, is_alive: bool) -> None:
        pass

    def close(self) -> None:
        self.closed = True


def test_a_panic_of_the_library_is_reported_once_and_tried_again(
    running: RunningHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Failing] = []
    ours, theirs = socket.socketpair()
    supervisor = ControlChannel(ours, FromChild)

    def open_endpoint(port: int, session_name: str) -> Failing:
        made.append(Failing(good=len(made) % 3))
        if len(made) == 1:
            raise PanicException("clock before 1970")
        if len(made) == 6:
            supervisor.send(Stop())
        return made[-1]

    def keep_publishing() -> None:
        while not ending.wait(0.002):
            running.hub.publish("/health", b"well")

    monkeypatch.setattr(ZenohEndpoint, "open", open_endpoint)
    monkeypatch.setattr(relay, "RETRY_S", 0.05)
    ending = threading.Event()
    thread = threading.Thread(target=keep_publishing)
    thread.start()
    relay.ZenohRelay(running.hub.path, NAME, 1, clock=SystemClock(0), channel=ControlChannel(theirs, ToDisplay)).run()
    ending.set()
    thread.join()
    assert [message.text for message in supervisor.receive(fail)] == [
        "zenoh clients receive no data: PanicException: clock before 1970",
        "zenoh clients receive no data: PanicException: called `Result::unwrap()` on an `Err` value: SystemTimeError",
    ]
    assert len(made) == 6
    assert all(endpoint.closed for endpoint in made[1:])
    supervisor.close()
    theirs.close()
