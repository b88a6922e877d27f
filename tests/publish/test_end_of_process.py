"""The end of the publish process while its sinks connect to a computer that does not answer."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from fti.config import MqttTable, Publish, ZenohTable
from tests.bus.running_hub import RunningHub, wait_for
from tests.publish.running_publisher import RunningPublisher


@pytest.fixture
def silent_port() -> Iterator[int]:
    """A port of loopback whose queue of connections is full: the kernel answers no further one."""
    with ExitStack() as stack:
        server = stack.enter_context(socket.create_server(("127.0.0.1", 0), backlog=0))
        port: int = server.getsockname()[1]
        for _ in range(4):
            client = stack.enter_context(socket.socket())
            client.setblocking(False)
            client.connect_ex(("127.0.0.1", port))
        yield port


def test_it_does_not_wait_for_sinks_that_connect(silent_port: int) -> None:
    """They give up after 5 s; the supervisor waits for 3 s."""
    tables = Publish(mqtt=MqttTable(port=silent_port), zenoh=ZenohTable(connect=f"tcp/127.0.0.1:{silent_port}"))
    with RunningHub() as hub, RunningPublisher(hub, tables) as running:
        running.publish_event(1)
        wait_for(lambda: [sink.state for sink in running.sinks.values()] == ["connecting"] * 2, "both sinks")
    texts = [event.text for event in running.events]
    assert texts == ["did not end within 2 s; its last messages are lost"] * 2
