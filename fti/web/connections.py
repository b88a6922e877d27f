"""Limits of the connections to the page, so that it stays reachable for its owner.

Any process of the machine can connect without sending a complete request.  Such a connection is closed after a timeout,
and the oldest ones at once when there are too many; connections with a request are not closed.
"""

from __future__ import annotations

import asyncio
from collections.abc import Collection

from aiohttp import web
from aiohttp.typedefs import Handler, Middleware
from aiohttp.web_protocol import RequestHandler

#: Timeout of the first complete request of a connection [s].
REQUEST_TIMEOUT_S = 5.0
#: Maximum number of connections without a request.
MAX_WAITING = 64
#: Maximum number of connections with a request; a browser has six and a WebSocket.
MAX_SERVED = 128
#: Period of the check [s].
PERIOD_S = 0.1


class ConnectionLimits:
    """Closes connections of a server without a request, and refuses requests of too many connections."""

    def __init__(self) -> None:
        self._since: dict[RequestHandler, float] = {}
        self._served: set[RequestHandler] = set()
        self._task: asyncio.Task[None] | None = None

    @property
    def note_request(self) -> Middleware:
        """The first middleware: counts complete requests, and refuses those of too many connections."""

        @web.middleware
        async def note(request: web.Request, handler: Handler) -> web.StreamResponse:
            if request.protocol not in self._served and len(self._served) >= MAX_SERVED:
                raise web.HTTPServiceUnavailable(text="too many connections")
            self._served.add(request.protocol)
            return await handler(request)

        return note

    def watch(self, server: web.Server) -> None:
        """Watch the connections of a server until ``stop``."""
        self._task = asyncio.create_task(self._watch(server), name="connection-limits")

    def stop(self) -> None:
        """Stop watching."""
        if self._task:
            self._task.cancel()
            self._task = None

    async def _watch(self, server: web.Server) -> None:
        while True:
            self.check(server.connections, asyncio.get_running_loop().time())
            await asyncio.sleep(PERIOD_S)

    def check(self, connections: Collection[RequestHandler], now: float) -> None:
        """Close connections after the timeout, and the oldest of too many.  now : time of the loop [s]"""
        self._served.intersection_update(connections)
        waiting = [one for one in connections if one not in self._served]
        self._since = {one: self._since.get(one, now) for one in waiting}
        waiting.sort(key=lambda one: self._since[one])
        too_many = len(waiting) - MAX_WAITING
        for n, one in enumerate(waiting):
            if n < too_many or now - self._since[one] > REQUEST_TIMEOUT_S:
                one.force_close()
