"""A bus that goes down, seen from the emulator's node on it."""

from __future__ import annotations

import socket
from typing import Any

import can
import pytest

from fti.canframe import pack_can
from fti.config import CanLink
from fti.hil.ports import canbus
from fti.hil.ports.canbus import CanBusEndpoint
from tests.helpers import until_async

FRAME = pack_can(0x123, b"12345678")


class FailingBus:
    """A bus of python-can that accepts nothing while it is down."""

    def __init__(self) -> None:
        self.down = False
        self.ours, self.theirs = socket.socketpair()

    def fileno(self) -> int:
        return self.ours.fileno()

    def _check(self) -> None:
        if self.down:
            raise can.CanOperationError("Network is down", 100)

    def send(self, message: can.Message, timeout: float) -> None:
        self._check()

    def recv(self, timeout: float) -> can.Message | None:
        self.ours.recv(1)
        self._check()
        return None

    def shutdown(self) -> None:
        self.ours.close()
        self.theirs.close()


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> FailingBus:
    failing_bus = FailingBus()

    def make(*_: Any, **__: Any) -> FailingBus:
        return failing_bus

    monkeypatch.setattr(can, "Bus", make)
    return failing_bus


async def test_a_bus_that_goes_down_is_reported_counted_and_used_again(
    bus: FailingBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages: list[str] = []
    monkeypatch.setattr(canbus, "REFUSAL_TIMEOUT_S", 0.0)
    node = CanBusEndpoint(
        CanLink(name="bus", kind="can", interface="socketcan", channel="c0"), lambda _: [], messages.append
    )
    await node.open()
    try:
        node.send(FRAME)
        bus.down = True
        bus.theirs.send(b"!")  # the socket is readable, and says why
        await until_async(lambda: messages)
        node.send(FRAME)
        assert messages == ["bus: the bus accepts no frames: Network is down [Error Code 100]; frames are dropped"]
        bus.down = False
        node.send(FRAME)
        assert messages[1:] == ["bus: the bus accepts frames again"]
        assert (node.counters.messages, node.counters.dropped_messages) == (2, 1)
    finally:
        node.close()


async def test_a_queue_that_is_full_for_a_moment_is_no_news(bus: FailingBus) -> None:
    messages: list[str] = []
    node = CanBusEndpoint(
        CanLink(name="bus", kind="can", interface="socketcan", channel="c0"), lambda _: [], messages.append
    )
    await node.open()
    try:
        bus.down = True
        node.send(FRAME)
        bus.down = False
        node.send(FRAME)
        assert messages == []
        assert node.counters.dropped_messages == 1
    finally:
        node.close()
