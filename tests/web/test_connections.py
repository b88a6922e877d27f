"""Half-open requests of other programs: the page stays reachable, and they are closed."""

from __future__ import annotations

import asyncio
import contextlib

import aiohttp

from fti.web import connections
from fti.web.commands import CommandGate
from fti.web.live_state import LiveState
from fti.web.server import PageServer
from tests.helpers import until_async

HALF = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "


async def _half_open(port: int, count: int) -> list[tuple[asyncio.StreamReader, asyncio.StreamWriter]]:
    opened = [await asyncio.open_connection("127.0.0.1", port) for _ in range(count)]
    for _, writer in opened:
        writer.write(HALF)
    return opened


async def _close(opened: list[tuple[asyncio.StreamReader, asyncio.StreamWriter]]) -> None:
    for _, writer in opened:
        writer.close()
    for _, writer in opened:
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()


async def _get(port: int) -> int:
    async with aiohttp.ClientSession() as client, client.get(f"http://127.0.0.1:{port}/") as response:
        await response.read()
        return response.status


async def test_of_288_half_open_requests_few_are_held_and_the_page_is_served() -> None:
    server = PageServer(LiveState(0), lambda: 0, CommandGate("key", lambda _: True, lambda: 0), lambda peer, here: "")
    port = await server.start(0)
    async with aiohttp.ClientSession() as owner:
        socket = await owner.ws_connect(f"http://127.0.0.1:{port}/ws", headers={"Origin": f"http://127.0.0.1:{port}"})
        opened = await _half_open(port, 288)
        assert await _get(port) == 200
        waiting = [reader for reader, _ in opened]
        await until_async(lambda: sum(reader.at_eof() for reader in waiting) >= 288 - connections.MAX_WAITING)
        assert (await socket.receive_json())["type"] == "history", "who has made a request is not closed"
        await socket.receive_json()
        assert not socket.closed
        await socket.close()
    await _close(opened)
    await server.stop()


async def test_a_connection_that_makes_no_request_is_closed() -> None:
    server = PageServer(LiveState(0), lambda: 0, CommandGate("key", lambda _: True, lambda: 0), lambda peer, here: "")
    port = await server.start(0)
    limits = server._limits
    (reader, writer), (silent, other) = (*await _half_open(port, 1), await asyncio.open_connection("127.0.0.1", port))
    runner = server._runner
    assert runner is not None
    assert runner.server is not None
    await until_async(lambda: len(runner.server.connections) == 2)  # type: ignore[union-attr]
    now = asyncio.get_running_loop().time()
    limits.check(runner.server.connections, now)
    assert not reader.at_eof()
    limits.check(runner.server.connections, now + connections.REQUEST_TIMEOUT_S + 0.1)
    assert (await reader.read(), await silent.read()) == (b"", b"")
    await _close([(reader, writer), (silent, other)])
    await server.stop()


async def test_more_connections_than_a_browser_has_are_refused() -> None:
    server = PageServer(LiveState(0), lambda: 0, CommandGate("key", lambda _: True, lambda: 0), lambda peer, here: "")
    port = await server.start(0)
    request = f"GET /nothing HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode()
    opened = []
    for _ in range(connections.MAX_SERVED):  # each with its request: more than 64 without one are not held
        opened.append(await asyncio.open_connection("127.0.0.1", port))
        reader, writer = opened[-1]
        writer.write(request)
        assert b"404" in await reader.readline()
    assert await _get(port) == 503
    await _close(opened)
    runner = server._runner
    assert runner is not None
    await until_async(lambda: runner.server is not None and not runner.server.connections)
    await asyncio.sleep(2 * connections.PERIOD_S)
    assert await _get(port) == 200
    await server.stop()
