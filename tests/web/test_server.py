"""The page's server: what it serves, to whom, and that nothing in it points outside."""

import asyncio
import json
import re
import socket
from collections.abc import AsyncIterator, Callable
from typing import Any

import aiohttp
import pytest

from fti.errors import MissingError
from fti.messages.control import CommandProgress, DeviceCommands, PageCommand, PageMark, UsableDevices
from fti.messages.tables import to_table
from fti.web.commands import CommandGate, Send
from fti.web.live_state import LiveState
from fti.web.server import PageServer, static_files

MS = 1_000_000
KEY = "the-key-of-this-start"
WITHOUT_KEY = "view only; to control: fti page"
WRONG_KEY = "the key is old; to control: fti page"
OUTSIDE = re.compile(
    rb"(?:https?:|wss?:)?//(?!www\.w3\.org/(?:2000/svg|1999/xlink))[a-z0-9$.-]+\.[a-z]{2,}", re.IGNORECASE
)


def make_server(live: LiveState, now_ns: Callable[[], int], send: Send) -> PageServer:
    return PageServer(live, now_ns, CommandGate(KEY, send, now_ns), lambda peer, here: f"alice:{peer[1] != here[1]}")


MAG = DeviceCommands("mag", "hmr2300", "line", True, {})


def progress(n: int, state: str) -> CommandProgress:
    texts = {"device": "mag", "command": "reset", "who": "me", "data": "", "title": "", "outcome": "", "detail": ""}
    return CommandProgress(
        id=f"k{n}", number=n, args={}, state=state, ended=False, t_ns=n, sent_ns=None, answered_ns=None, **texts
    )


class Site:
    """A served live state whose clock the test sets."""

    def __init__(self, client: aiohttp.ClientSession) -> None:
        self.now_ns = 0
        self.taken: list[Any] = []
        self.listens = True
        self.live = LiveState(0)
        self.client = client
        self.server = make_server(self.live, lambda: self.now_ns, self.update)
        self.port = 0

    def update(self, command: Any) -> bool:
        self.taken.append(command)
        return self.listens

    async def status(self, path: str = "/", **headers: str) -> int:
        async with self.client.get(f"http://127.0.0.1:{self.port}{path}", headers=headers) as response:
            return response.status

    def connect(self, **headers: str) -> Any:
        headers.setdefault("Origin", f"http://127.0.0.1:{self.port}")
        return self.client.ws_connect(f"http://127.0.0.1:{self.port}/ws", headers=headers)


@pytest.fixture
async def site() -> AsyncIterator[Site]:
    async with aiohttp.ClientSession() as client:
        result = Site(client)
        result.port = await result.server.start(0)
        yield result
        await result.server.stop()


async def test_every_part_of_the_page_is_served_with_the_policy(site: Site) -> None:
    for path, (body, content_type) in static_files().items():
        async with site.client.get(f"http://127.0.0.1:{site.port}{path}") as response:
            assert (response.status, response.content_type) == (200, content_type)
            assert await response.read() == body
            assert response.headers["Content-Security-Policy"].startswith("default-src 'self';")
            assert response.headers["X-Content-Type-Options"] == "nosniff"


@pytest.mark.parametrize(
    "path", ["/no_such.js", "/..%2fserver.py", "/../server.py", "//etc/passwd", "/vendor", "/vendor/"]
)
async def test_nothing_else_is_served(site: Site, path: str) -> None:
    assert await site.status(path) == 404


async def test_nothing_can_be_sent(site: Site) -> None:
    async with site.client.post(f"http://127.0.0.1:{site.port}/", data=b"x") as response:
        assert response.status == 405


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "[::1]"])
async def test_own_names_and_own_origin_are_welcome(site: Site, name: str) -> None:
    host = f"{name}:{site.port}"
    assert await site.status(Host=host, Origin=f"http://{host}") == 200
    async with site.connect(Host=host, Origin=f"http://{host}") as ws:
        assert (await ws.receive_json())["type"] == "history"


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "localhost.evil.example:{port}"]
)
async def test_a_strange_host_is_refused(site: Site, host: str) -> None:
    assert await site.status(Host=host.format(port=site.port)) == 403


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "https://127.0.0.1:{port}", "http://127.0.0.1:1", "http://localhost:{port}", "null"],
)
async def test_a_strange_origin_is_refused(site: Site, origin: str) -> None:
    origin = origin.format(port=site.port)
    assert await site.status(Origin=origin) == 403
    with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
        await site.connect(Origin=origin)


async def test_a_page_without_scripts_shows_that_it_has_no_connection(site: Site) -> None:
    async with site.client.get(f"http://127.0.0.1:{site.port}/") as response:
        assert '<body class="disconnected">' in await response.text()


async def test_the_socket_demands_an_origin(site: Site) -> None:
    with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
        await site.client.ws_connect(f"http://127.0.0.1:{site.port}/ws")


async def test_the_socket_sends_history_and_then_states(site: Site) -> None:
    site.live.update("/health", {"t_ns": 7}, 0)
    site.live.update("/nav/glide_slope", {"valid": True, "t_ns": 7, "dh": 1.0}, 0)
    async with site.connect() as ws:
        assert (await ws.receive_json())["type"] == "history"
        first = await ws.receive_json()
        assert (first["type"], first["health"], first["t_ns"]) == ("state", {"t_ns": 7}, 7)
        assert first["outputs"]["/nav/glide_slope"]["valid"]
        site.now_ns = 5000 * MS
        while (later := await ws.receive_json())["t_ns"] == 7:
            pass
    assert later["outputs"]["/nav/glide_slope"]["late"]
    assert [alarm["id"] for alarm in later["alarms"]] == ["daemon"]


# --------------------------------------------------------------------------------------------------------- commands


async def answers(ws: Any, *commands: Any) -> list[Any]:
    """Send commands; returns the answer to each, in order."""
    for n, command in enumerate(commands):
        await ws.send_str(json.dumps({"id": n, **command}))
    content: dict[int, Any] = {}
    async with asyncio.timeout(20.0):
        while len(content) < len(commands):
            message = await ws.receive_json()
            if message["type"] == "answer":
                content[message["id"]] = message["fault"]
    return [content[n] for n in range(len(commands))]


async def test_a_mark_goes_to_the_daemon(site: Site) -> None:
    async with site.connect() as ws:
        text = "  begin of\u0000\n approach\u202e 3 – Ä \ud83d\ude80 "
        assert await answers(ws, {"command": "mark", "text": text, "key": KEY}) == [None]
        assert site.taken == [PageMark("begin of approach 3 – Ä \U0001f680", "alice:True")]
        site.listens = False
        assert await answers(ws, {"command": "mark", "text": "x", "key": KEY}) == ["the daemon cannot be reached"]


@pytest.mark.parametrize(
    ("key", "fault"),
    [*[(key, WITHOUT_KEY) for key in (None, "", 7, ["a"])], *[(key, WRONG_KEY) for key in ("x", "\u00e4", "\ud800")]],
)
async def test_without_the_key_of_the_owner_nothing_is_done(site: Site, key: Any, fault: str) -> None:
    async with site.connect() as ws:
        found = await answers(ws, {"command": "mark", "text": "x", "key": key}, {"command": "check", "key": key})
    assert found == [fault] * 2
    assert site.taken == []


async def test_a_page_asks_whether_its_key_fits(site: Site) -> None:
    async with site.connect() as ws:
        assert await answers(ws, *[{"command": "check", "key": KEY}] * 20) == [None] * 20
    assert site.taken == []


async def test_nothing_that_is_served_has_the_key(site: Site) -> None:
    for path in static_files():
        async with site.client.get(f"http://127.0.0.1:{site.port}{path}") as response:
            assert KEY.encode() not in await response.read() + repr(response.headers).encode()
    async with site.connect() as ws:
        site.server.board.update(UsableDevices((MAG,)))
        assert KEY not in json.dumps([await ws.receive_json() for _ in range(4)])


async def test_who_tries_keys_is_cut_off(site: Site) -> None:
    async with site.connect() as ws:
        for n in range(3):
            await ws.send_str(json.dumps({"id": n, "command": "check", "key": f"guess {n}"}))
        for n in range(3, 6):
            await ws.send_str(json.dumps({"id": n, "command": "mark", "text": "x", "key": KEY}))
        async with asyncio.timeout(20.0):
            messages = [json.loads(message.data) async for message in ws]
        assert ws.close_code == aiohttp.WSCloseCode.POLICY_VIOLATION
    assert [m["fault"] for m in messages if m["type"] == "answer"] == [WRONG_KEY] * 3
    assert site.taken == []
    async with site.connect() as ws:
        assert await answers(ws, {"command": "check", "key": KEY}) == [None]


async def test_a_snapshot_is_a_mark_that_triggers(site: Site) -> None:
    async with site.connect() as ws:
        assert await answers(ws, {"command": "snapshot", "text": "flutter", "key": KEY}) == [None]
    assert site.taken == [PageMark("flutter", "alice:True", is_trigger=True)]


async def test_a_command_to_a_device_goes_to_the_daemon(site: Site) -> None:
    request = {"command": "send", "device": "mag", "name": "set_rate", "args": {"rate": "20"}, "request": "r-1"}
    async with site.connect() as ws:
        assert await answers(ws, request | {"key": KEY}) == [None]
        assert await answers(ws, request | {"key": "x"}) == [WRONG_KEY]
    assert site.taken == [PageCommand("r-1", "mag", "set_rate", "alice:True", {"rate": "20"})]


@pytest.mark.parametrize(
    "change", [{"args": ["x"]}, {"args": {"rate": 20}}, {"device": 7}, {"request": None}, {"name": {}}]
)
async def test_what_is_no_command_to_a_device_is_refused(site: Site, change: dict[str, Any]) -> None:
    request = {"command": "send", "device": "mag", "name": "set_rate", "args": {}, "request": "r-1"} | change
    async with site.connect() as ws:
        assert await answers(ws, request | {"key": KEY}) == ["unknown command"]
    assert site.taken == []


async def test_pages_receive_commands_after_a_change(site: Site) -> None:
    async with site.connect() as ws:
        kinds = [(await ws.receive_json())["type"] for _ in range(3)]
        assert "commands" not in kinds
        site.server.board.update(UsableDevices((MAG,)))
        while (message := await ws.receive_json())["type"] != "commands":
            pass
        assert message == {"type": "commands", "devices": [to_table(MAG)], "requests": []}
        for n in range(25):
            site.server.board.update(progress(n, "sending"))
        site.server.board.update(progress(24, "acknowledged"))
        while (message := await ws.receive_json())["type"] != "commands":
            pass
        assert [request["id"] for request in message["requests"]] == [f"k{n}" for n in range(24, 4, -1)]
        assert message["requests"][0]["state"] == "acknowledged"
    async with site.connect() as ws:
        assert [(await ws.receive_json())["type"] for _ in range(2)] == ["history", "commands"]


@pytest.mark.parametrize(
    ("command", "fault"),
    [
        ({"command": "mark", "text": "x" * 201}, "a mark must have 1 to 200 characters, not 201"),
        ({"command": "mark", "text": " \n"}, "a mark must have 1 to 200 characters, not 0"),
        ({"command": "mark"}, "unknown command"),
        ({"command": "mark", "text": ["x"]}, "unknown command"),
        ({"command": "stop", "text": "x"}, "unknown command"),
        ({"command": ["mark"], "text": "x"}, "unknown command"),
    ],
)
async def test_what_is_no_mark_is_refused(site: Site, command: dict[str, Any], fault: str) -> None:
    async with site.connect() as ws:
        assert await answers(ws, {**command, "key": KEY}) == [fault]
    assert site.taken == []


async def test_the_longest_mark_is_taken_in_any_script(site: Site) -> None:
    async with site.connect() as ws:
        assert await answers(ws, {"command": "mark", "text": "ä" * 200, "key": KEY}) == [None]
    assert site.taken == [PageMark("ä" * 200, "alice:True")]


async def test_a_flood_is_stopped_for_all_pages_together(site: Site) -> None:
    mark = {"command": "mark", "text": "x", "key": KEY}
    async with site.connect() as first, site.connect() as second:
        found = await answers(first, *[mark] * 30) + await answers(second, *[mark] * 30)
        assert found == [None] * 5 + ["more than 5 marks or commands per second"] * 55
        site.now_ns += 1_000_000_000
        assert await answers(second, *[mark] * 6) == [None] * 5 + ["more than 5 marks or commands per second"]
    assert len(site.taken) == 10


@pytest.mark.parametrize("noise", ["", "[" * 2000, "7", "[]", '"mark"', "{}", '{"type": "state"}', "{"])
async def test_noise_is_not_answered(site: Site, noise: str) -> None:
    async with site.connect() as ws:
        await ws.send_str(noise)
        assert [(await ws.receive_json())["type"] for _ in range(4)] == ["history", "state", "state", "state"]


async def test_a_large_message_ends_the_connection(site: Site) -> None:
    async with site.connect() as ws:
        await ws.send_bytes(b"x" * 100_000)
        async with asyncio.timeout(10.0):
            kinds = [message.type async for message in ws]
    assert ws.closed
    assert set(kinds) <= {aiohttp.WSMsgType.TEXT}


async def test_the_end_of_the_server_closes_its_sockets(site: Site) -> None:
    async with site.connect() as ws:
        await ws.receive_json()
        stopping = asyncio.create_task(site.server.stop())
        async with asyncio.timeout(10.0):
            while (await ws.receive()).type == aiohttp.WSMsgType.TEXT:
                pass
        assert ws.close_code == aiohttp.WSCloseCode.GOING_AWAY
        await stopping


async def test_a_port_in_use_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(MissingError, match=f"display.port = {port}: cannot be served on 127.0.0.1: .*in use"):
            await make_server(LiveState(0), lambda: 0, lambda command: True).start(port)


def test_no_file_of_the_page_points_outside() -> None:
    for path, (body, content_type) in static_files().items():
        if content_type.startswith("text/") and not path.startswith("/vendor/"):
            assert not OUTSIDE.findall(body), path


def test_no_inline_script_or_style() -> None:
    page = static_files()["/"][0].decode()
    assert not re.search(r"<style|style=|\son\w+=|javascript:|<script(?![^>]*\ssrc=)", page)


def test_the_vendored_parts_carry_their_licences() -> None:
    folders = {path.rsplit("/", 1)[0] for path in static_files() if path.count("/") > 2}
    assert folders == {"/vendor/uplot-1.6.32", "/vendor/b612"}
    assert all(b"Copyright" in static_files()[f"{folder}/LICENSE.txt"][0] for folder in folders)
