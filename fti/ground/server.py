"""The page of the ground station: an overview of all aircraft, and the page of each one; read-only, on loopback.

``/`` is the overview, ``/fleet/ws`` sends its rows twice a second.  ``/aircraft/<name>/`` is the page of an aircraft,
with the same files and WebSocket as that of a daemon.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable

from aiohttp import web

from fti.ground.fleet import Fleet, summaries
from fti.web.commands import CommandGate
from fti.web.server import LoopbackServer, received_texts, to_json

PERIOD_S = 0.5


class FleetServer(LoopbackServer):
    """Serves a fleet.  now_ns : monotonic clock"""

    def __init__(self, fleet: Fleet, now_ns: Callable[[], int]) -> None:
        unknown_key = secrets.token_urlsafe()  # no client has it: every command is refused
        gate = CommandGate(unknown_key, lambda message: False, now_ns)
        super().__init__(now_ns, gate, lambda peer, here: "")
        self._fleet = fleet

    def add_routes(self, router: web.UrlDispatcher) -> None:
        """See ``LoopbackServer``."""
        router.add_get("/fleet/ws", self._serve_overview)
        router.add_get("/aircraft/{name}/ws", self._serve_aircraft_socket)
        router.add_get("/aircraft/{name}/{path:.*}", self._serve_aircraft_file)
        router.add_get("/{path:.*}", self._serve_overview_file)

    async def _serve_overview_file(self, request: web.Request) -> web.Response:
        return self.serve_file("/fleet.html" if request.path == "/" else request.path)

    async def _serve_aircraft_file(self, request: web.Request) -> web.Response:
        return self.serve_file(f"/{request.match_info['path']}")

    async def _serve_aircraft_socket(self, request: web.Request) -> web.WebSocketResponse:
        live = self._fleet.find(request.match_info["name"])
        if live is None:
            raise web.HTTPNotFound(text="no such aircraft")
        return await self.serve_socket(request, live)

    async def _serve_overview(self, request: web.Request) -> web.WebSocketResponse:
        socket = await self.open_socket(request)
        try:
            while not socket.closed:
                rows = [*summaries(self._fleet.states(self.now_ns()))]
                await socket.send_str(to_json({"aircraft": rows}))
                async for _ in received_texts(socket, PERIOD_S):
                    pass  # a browser has no commands here
        except ConnectionResetError:
            pass  # the browser has closed the connection
        return socket
