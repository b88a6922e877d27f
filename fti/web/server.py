"""The server of the page: HTTP and a WebSocket on loopback, only for its own origin.

``/`` is the page, ``/<file>`` its parts, all read into memory from this package at the start.  ``/ws`` sends
``{"type": "history"}`` once and then ``{"type": "state"}`` at 10 Hz; if a link may transmit, also
``{"type": "commands"}`` at first and after each change.  A client may set a mark, trigger a snapshot, send a command to
a device, or acknowledge alarms: ``{"command": "mark" | "snapshot" | "send" | "acknowledge" | "check", ..., "key",
"id"}``; the key is never served (see ``fti.web.commands``).

A request is refused (403) when its Host is not this server on loopback (DNS rebinding), or when its Origin differs; the
WebSocket requires an Origin, because a browser lets any page open one.
"""

from __future__ import annotations

import asyncio
import json
import os
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any
from weakref import WeakSet

from aiohttp import WSCloseCode, WSMsgType, web
from aiohttp.typedefs import Handler

from fti.errors import MissingError
from fti.web.commands import CommandGate, CommandStatus, PageClient
from fti.web.connections import ConnectionLimits
from fti.web.live_state import LiveState

LOOPBACK = "127.0.0.1"
NAMES = ("127.0.0.1", "localhost", "[::1]")
PERIOD_S = 0.1
MAX_MESSAGE_BYTES = 2048
IDLE_S = 15.0  # timeout of idle keep-alive connections
CONTENT_TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
    ".woff2": "font/woff2",
    ".txt": "text/plain",
}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
UserLookup = Callable[[tuple[str, int], tuple[str, int]], str]
CLOSED = (WSMsgType.CLOSE, WSMsgType.CLOSING, WSMsgType.CLOSED, WSMsgType.ERROR)


def static_files() -> dict[str, tuple[bytes, str]]:
    """Content and content type of all parts of the page, by path on the server."""
    root = resources.files("fti.web") / "static"
    files = {
        path: (entry.read_bytes(), CONTENT_TYPES.get("." + entry.name.rpartition(".")[2], "application/octet-stream"))
        for path, entry in _walk(root, "/")
    }
    return files | {"/": files["/index.html"]}


def _walk(folder: Traversable, path: str) -> Iterator[tuple[str, Traversable]]:
    for entry in folder.iterdir():
        if entry.is_dir():
            yield from _walk(entry, f"{path}{entry.name}/")
        else:
            yield path + entry.name, entry


def to_json(message: Mapping[str, Any]) -> str:
    """A message as standard JSON.  Raises ValueError for NaN, which the checks of the bus exclude."""
    return json.dumps(message, allow_nan=False)


def is_allowed(request: web.Request) -> bool:
    """The request is for this server on loopback, and from its own page or without a page."""
    port = request.transport.get_extra_info("sockname")[1] if request.transport else None
    host = request.headers.get("Host")
    if host not in [f"{name}:{port}" for name in NAMES]:
        return False
    origin = request.headers.get("Origin")
    return origin == f"http://{host}" or (origin is None and not request.path.endswith("/ws"))


@web.middleware
async def guard_origin(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Refuse requests of other origins."""
    if not is_allowed(request):
        raise web.HTTPForbidden(text="only this server's own page on loopback is served", headers=HEADERS)
    return await handler(request)


async def received_texts(socket: web.WebSocketResponse, period_s: float) -> AsyncIterator[str]:
    """The texts that a browser sends within a period [s], or until it closes the connection."""
    loop = asyncio.get_running_loop()
    end_s = loop.time() + period_s
    while (remaining_s := end_s - loop.time()) > 0 and not socket.closed:
        try:
            message = await socket.receive(timeout=remaining_s)
        except TimeoutError:
            return
        if message.type in CLOSED:
            await socket.close()
        elif message.type is WSMsgType.TEXT:
            yield message.data


class LoopbackServer(ABC):
    """Serves the files of the page, and live states over WebSockets.

    now_ns  : monotonic clock; gate : handles commands; board : state of commands to devices
    user_of : returns the user of the program that is connected from one address to another
    """

    def __init__(self, now_ns: Callable[[], int], gate: CommandGate, user_of: UserLookup) -> None:
        self.now_ns = now_ns
        self.board = CommandStatus()
        self._gate = gate
        self._user_of = user_of
        self.files = static_files()
        self._sockets: WeakSet[web.WebSocketResponse] = WeakSet()
        self._runner: web.AppRunner | None = None
        self._limits = ConnectionLimits()

    def make_app(self) -> web.Application:
        """The application that ``start`` serves."""
        app = web.Application(middlewares=[self._limits.note_request, guard_origin])
        self.add_routes(app.router)
        app.on_shutdown.append(self._close_sockets)
        return app

    @abstractmethod
    def add_routes(self, router: web.UrlDispatcher) -> None:
        """Add what is served."""

    async def start(self, port: int) -> int:
        """Listen on a port of loopback, 0 for a free one; returns the port.  Raises MissingError when it is in use."""
        self._runner = web.AppRunner(
            self.make_app(), access_log=None, handle_signals=False, shutdown_timeout=1.0, keepalive_timeout=IDLE_S
        )
        await self._runner.setup()
        try:
            await web.TCPSite(self._runner, LOOPBACK, port).start()
        except OSError as error:
            await self.stop()
            reason = os.strerror(error.errno) if error.errno else str(error)
            raise MissingError(f"display.port = {port}: cannot be served on {LOOPBACK}: {reason}") from None
        assert self._runner.server is not None
        self._limits.watch(self._runner.server)
        chosen: int = self._runner.addresses[0][1]
        return chosen

    async def stop(self) -> None:
        """Close every connection, after it got the last state, and stop listening."""
        if self._sockets:
            await asyncio.sleep(2 * PERIOD_S)
        self._limits.stop()
        if self._runner:
            await self._runner.cleanup()

    def serve_file(self, path: str) -> web.Response:
        """A file of the page.  Raises HTTPNotFound."""
        found = self.files.get(path)
        if found is None:
            raise web.HTTPNotFound(text="no such file", headers=HEADERS)
        body, content_type = found
        charset = "utf-8" if content_type.startswith("text/") else None
        return web.Response(body=body, content_type=content_type, charset=charset, headers=HEADERS)

    async def open_socket(self, request: web.Request) -> web.WebSocketResponse:
        """Open a WebSocket, which ``stop`` closes."""
        socket = web.WebSocketResponse(max_msg_size=MAX_MESSAGE_BYTES, heartbeat=5.0)
        await socket.prepare(request)
        self._sockets.add(socket)
        return socket

    async def serve_socket(self, request: web.Request, live: LiveState) -> web.WebSocketResponse:
        """Send a live state until the browser closes the connection; answer its commands."""
        socket = await self.open_socket(request)
        assert request.transport is not None  # the socket has just been prepared
        peer, here = (request.transport.get_extra_info(end)[:2] for end in ("peername", "sockname"))
        client = PageClient(self._user_of(peer, here))
        try:
            await socket.send_str(to_json(live.history()))
            sent_version = 0
            while not socket.closed:
                if sent_version != self.board.version:
                    sent_version = self.board.version
                    await socket.send_str(to_json(self.board.message()))
                await socket.send_str(to_json(live.state(self.now_ns())))
                await self._pause(socket, client)
        except ConnectionResetError:
            pass  # the browser has closed the connection
        return socket

    async def _pause(self, socket: web.WebSocketResponse, client: PageClient) -> None:
        """Wait for the next period; answer commands meanwhile."""
        async for text in received_texts(socket, PERIOD_S):
            if answer := self._gate.handle_message(text, client):
                await socket.send_str(to_json(answer))
                if client.is_refused:
                    await socket.close(code=WSCloseCode.POLICY_VIOLATION)

    async def _close_sockets(self, app: web.Application) -> None:
        for socket in set(self._sockets):
            await socket.close(code=WSCloseCode.GOING_AWAY, message=b"the display ends")


class PageServer(LoopbackServer):
    """Serves the page of one live state; other arguments as those of ``LoopbackServer``."""

    def __init__(self, live: LiveState, now_ns: Callable[[], int], gate: CommandGate, user_of: UserLookup) -> None:
        super().__init__(now_ns, gate, user_of)
        self._live = live

    def add_routes(self, router: web.UrlDispatcher) -> None:
        """See ``LoopbackServer``."""
        router.add_get("/ws", self._serve_live)
        router.add_get("/{path:.*}", self._serve_path)

    async def _serve_path(self, request: web.Request) -> web.Response:
        return self.serve_file(request.path)

    async def _serve_live(self, request: web.Request) -> web.WebSocketResponse:
        return await self.serve_socket(request, self._live)
