"""Headless Chromium over its DevTools protocol.

``async with Chromium() as browser: page = await browser.open(url)``; ``with running_chromium() as address:`` starts one
for several ``Chromium(address)``.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import itertools
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import aiohttp
import pytest

from tests.helpers import until

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--remote-debugging-port=0",
)
START_S = 120.0
WAIT_S = 60.0  # met, it costs nothing
#: A screenshot is a large message.
MAX_MESSAGE_BYTES = 64 * 2**20
#: Character of a key with a name.
NAMED_KEYS = {"Enter": "\r", "Tab": "\t", "Escape": "\x1b"}
#: What Chromium answers while a page changes its document.
NAVIGATED = "Inspected target navigated or closed"


class BrowserError(Exception):
    """The browser refused a command, or a script on the page threw."""


@contextlib.contextmanager
def running_chromium() -> Iterator[str]:
    """The address of a browser that runs until the block ends."""
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        pytest.skip("Chromium is not installed (Debian: chromium); the page is looked at in it")
    devnull = subprocess.DEVNULL
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        command = [program, *FLAGS, f"--user-data-dir={folder}", "about:blank"]
        with subprocess.Popen(command, stdout=devnull, stderr=devnull) as process:
            try:
                yield _find_address(Path(folder))
            finally:
                _end_process(process)


def _find_address(folder: Path) -> str:
    """The browser writes its port and path into its profile when it listens."""
    file = folder / "DevToolsActivePort"
    lines = until(lambda: file.exists() and file.read_text().split(), START_S, "Chromium to start")
    assert isinstance(lines, list)
    return f"ws://127.0.0.1:{lines[0]}{lines[1]}"


class Chromium:
    """An empty profile, gone with its pages at the end of the block; in the browser at the address, or in a new one."""

    def __init__(self, address: str = "") -> None:
        self._address = address
        self._stack = contextlib.AsyncExitStack()
        self._numbers = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._pages: dict[str, Page] = {}
        self._socket: aiohttp.ClientWebSocketResponse
        self._profile: str

    async def __aenter__(self) -> Chromium:
        async with self._stack as stack:
            address = self._address or await asyncio.to_thread(stack.enter_context, running_chromium())
            client = await stack.enter_async_context(aiohttp.ClientSession())
            connected = client.ws_connect(address, max_msg_size=MAX_MESSAGE_BYTES)
            self._socket = await stack.enter_async_context(connected)
            reader = asyncio.create_task(self._read(), name="devtools")
            stack.push_async_callback(_end_task, reader)
            self._profile = (await self.command("Target.createBrowserContext"))["browserContextId"]
            stack.push_async_callback(self.command, "Target.disposeBrowserContext", browserContextId=self._profile)
            self._stack = stack.pop_all()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._stack.aclose()

    async def _read(self) -> None:
        async for message in self._socket:
            found = message.json()
            if "id" in found:
                future = self._waiting.pop(found["id"], None)
                if future and not future.done():
                    future.set_result(found)
            elif page := self._pages.get(found.get("sessionId", "")):
                page.take(found["method"], found["params"])

    async def command(self, method: str, session: str | None = None, **params: Any) -> dict[str, Any]:
        """One DevTools command and its result."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": params} | ({"sessionId": session} if session else {})
        self._waiting[number] = asyncio.get_running_loop().create_future()
        await self._socket.send_json(message)
        answer = await asyncio.wait_for(self._waiting[number], START_S)
        if "error" in answer:
            raise BrowserError(f"{method}: {answer['error']['message']}")
        result: dict[str, Any] = answer["result"]
        return result

    async def open(self, url: str, width: int = 1440, height: int = 900) -> Page:
        """A new page of that size, navigated to the address."""
        target = await self.command("Target.createTarget", url="about:blank", browserContextId=self._profile)
        attached = await self.command("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        page = self._pages[attached["sessionId"]] = Page(self, attached["sessionId"])
        for domain in ("Page", "Runtime", "Network", "Log"):
            await page.command(f"{domain}.enable")
        await page.resize(width, height)
        await page.command("Page.navigate", url=url)
        await page.wait_for("document.readyState === 'complete'")
        return page


class Page:
    """One page.  ``requests``: every requested address; ``problems``: errors of the console."""

    def __init__(self, browser: Chromium, session: str) -> None:
        self._browser = browser
        self._session = session
        self.requests: list[str] = []
        self.problems: list[str] = []
        self._has_loaded = asyncio.Event()

    def take(self, method: str, params: dict[str, Any]) -> None:
        """Take one DevTools event."""
        match method:
            case "Page.loadEventFired":
                self._has_loaded.set()
            case "Network.requestWillBeSent":
                self.requests.append(params["request"]["url"])
            case "Network.webSocketCreated":
                self.requests.append(params["url"])
            case "Runtime.exceptionThrown":
                details = params["exceptionDetails"]
                self.problems.append(details.get("exception", {}).get("description", details["text"]))
            case "Log.entryAdded" if params["entry"]["level"] == "error":
                self.problems.append(f"{params['entry']['text']} {params['entry'].get('url', '')}")

    async def command(self, method: str, **params: Any) -> dict[str, Any]:
        """One DevTools command for this page."""
        return await self._browser.command(method, self._session, **params)

    async def eval(self, expression: str) -> Any:
        """Value of a JavaScript expression (a promise is awaited).  Raises BrowserError when it throws."""
        found = await self.command("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in found:
            raise BrowserError(found["exceptionDetails"].get("exception", {}).get("description", expression))
        return found["result"].get("value")

    async def wait_for(self, expression: str, seconds: float = WAIT_S) -> Any:
        """Poll until the expression is truthy; returns its value.  The page may load another document meanwhile."""
        end = asyncio.get_running_loop().time() + seconds
        while not (found := await self._eval_if_there(expression)):
            late = asyncio.get_running_loop().time() > end
            assert not late, f"waited {seconds:g} s for {expression}; console: {self.problems}"
            await asyncio.sleep(0.05)
        return found

    async def _eval_if_there(self, expression: str) -> Any:
        """The value; None while another document takes the place of this one."""
        try:
            return await self.eval(expression)
        except BrowserError as error:
            if NAVIGATED not in str(error):
                raise
            return None

    async def reload(self) -> None:
        """Load the page anew; nothing of the document before is there when this returns."""
        self._has_loaded.clear()
        await self.command("Page.reload")
        await asyncio.wait_for(self._has_loaded.wait(), WAIT_S)

    async def text(self, testid: str) -> str:
        """Text of the element with that data-testid."""
        return str(await self.eval(f"{by_testid(testid)}.textContent"))

    async def press(self, key: str) -> None:
        """Press and release a key: a character, Enter, Tab or Escape."""
        text = NAMED_KEYS.get(key, key)
        code = {"key": key, "windowsVirtualKeyCode": ord(text.upper())}
        await self.command("Input.dispatchKeyEvent", type="keyDown", text=text, **code)
        await self.command("Input.dispatchKeyEvent", type="keyUp", **code)

    async def type_text(self, text: str) -> None:
        """Type into what has the focus."""
        await self.command("Input.insertText", text=text)

    async def resize(self, width: int, height: int) -> None:
        """Give the page that size [px]."""
        size = {"width": width, "height": height}
        await self.command("Emulation.setDeviceMetricsOverride", **size, deviceScaleFactor=1, mobile=False)

    async def screenshot(self, path: str | Path) -> None:
        """Write what the page shows now as PNG."""
        found = await self.command("Page.captureScreenshot", format="png")
        await asyncio.to_thread(Path(path).write_bytes, base64.b64decode(found["data"]))


def by_testid(testid: str) -> str:
    """JavaScript expression of the element with that data-testid; null when there is none."""
    return f"document.querySelector('[data-testid=\"{testid}\"]')"


async def _end_task(task: asyncio.Task[None]) -> None:
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task


def _end_process(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(10.0)
    except subprocess.TimeoutExpired:
        process.kill()
