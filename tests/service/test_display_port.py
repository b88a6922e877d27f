"""A port of the page in use by another program: reported once, retried, without effect on the recording."""

from __future__ import annotations

import asyncio
import socket
from typing import Any

import pytest

from fti.messages.control import PagePort
from fti.service.display import __main__ as display
from fti.web.commands import CommandGate
from fti.web.live_state import LiveState
from fti.web.server import PageServer
from tests.helpers import until_async


async def test_a_busy_port_is_reported_once_and_the_page_comes_when_it_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(display, "RETRY_S", 0.01)
    messages: list[Any] = []
    server = PageServer(LiveState(0), lambda: 0, CommandGate("key", lambda _: True, lambda: 0), lambda peer, here: "")
    tries = 0
    start = server.start

    async def counted(port: int) -> int:
        nonlocal tries
        tries += 1
        return await start(port)

    monkeypatch.setattr(server, "start", counted)
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        starting = asyncio.create_task(display.start_page(server, port, messages.append))
        await until_async(lambda: tries >= 3)
        (message,) = messages
        fault = message.text
        assert fault.startswith(f"display.port = {port}: cannot be served on 127.0.0.1: Address already in use; ")
    await starting
    assert messages[1:] == [PagePort(port)]
    await server.stop()
