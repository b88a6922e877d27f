"""The display process: how it begins and the ways in which it ends."""

import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers import until
from tests.web.fake_daemon import KEY, DisplayProcess, FakeDaemon


@pytest.fixture
def daemon() -> Iterator[FakeDaemon]:
    result = FakeDaemon()
    yield result
    result.close()


@pytest.fixture
def display(daemon: FakeDaemon) -> Iterator[DisplayProcess]:
    result = DisplayProcess(daemon)
    yield result
    result.close()


@pytest.fixture(autouse=True)
def _started(daemon: FakeDaemon, display: DisplayProcess) -> None:
    daemon.start()


def end_of(display: DisplayProcess) -> int:
    until(lambda: display.process.poll() is not None, what="the display to exit")
    return int(display.process.returncode)


def test_it_serves_the_page_at_the_port_it_names(display: DisplayProcess) -> None:
    with urllib.request.urlopen(display.url, timeout=120) as response:
        assert b"<title>fti</title>" in response.read()


#: What another program of this machine can do: fetch all that is served, and claim to be its page.
FORGER = """
import asyncio, json, re, sys
import aiohttp

async def forge(address):
    async with aiohttp.ClientSession() as client:
        async with client.get(address) as response:
            served = await response.text()
        for key in ["", *re.findall("[A-Za-z0-9_-]{16,}", served)]:
            async with client.ws_connect(address + "ws", headers={"Origin": address[:-1]}) as ws:
                mark = {"command": "mark", "text": "forged", "id": 1, "token": key, "key": key}
                await ws.send_json(mark)
                while (answer := await ws.receive_json())["type"] != "answer":
                    pass
                print("refused" if answer["fault"] else "taken")

asyncio.run(forge(sys.argv[1]))
"""


def test_another_process_cannot_command(display: DisplayProcess) -> None:
    command = [sys.executable, "-c", FORGER, display.url]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert set(done.stdout.split()) == {"refused"}
    display.control.setblocking(False)
    with pytest.raises(BlockingIOError):
        display.control.recv(1)


def test_the_key_stands_where_no_other_user_can_read_it(display: DisplayProcess) -> None:
    place = Path("/proc") / str(display.process.pid)
    for name in ("cmdline", "environ"):
        assert KEY.encode() not in (place / name).read_bytes()


def test_it_ends_at_the_stop_message(display: DisplayProcess) -> None:
    display.control.sendall(b'{"Stop": {}}\n')
    assert end_of(display) == 0


def test_it_ends_with_its_supervisor(display: DisplayProcess) -> None:
    display.control.close()
    assert end_of(display) == 0


def test_sigterm_ends_it_and_sigint_does_not(display: DisplayProcess) -> None:
    display.process.send_signal(signal.SIGINT)
    with urllib.request.urlopen(display.url, timeout=120) as response:
        assert response.status == 200
    assert display.process.poll() is None
    display.process.send_signal(signal.SIGTERM)
    assert end_of(display) == 0


def test_a_missing_bus_is_one_sentence(daemon: FakeDaemon, capfd: pytest.CaptureFixture[str]) -> None:
    daemon.hub.path.unlink()
    with pytest.raises(ConnectionError, match="the display ended"):
        DisplayProcess(daemon)
    expected = f"fti display: {daemon.hub.path}: no bus of this user found; is the daemon running?\n"
    assert capfd.readouterr().err == expected
