"""The ground station: two aircraft through a zenoh router, in the terminal and in the browser."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fti.bus.loopback import choose_port
from fti.config import Publish, ZenohTable
from fti.messages.outputs import Datum, HeightBelowAircraft, NavSolution
from fti.messages.tables import to_table
from tests.bus.running_hub import RunningHub, wait_for
from tests.e2e.harness import FTI, fti
from tests.publish.broker import find_program
from tests.publish.running_publisher import RunningPublisher
from tests.publish.zenoh_router import Router
from tests.web.chromium import Chromium, by_testid

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(300)]
SESSION = "demo_20261129T180000Z_0"
STAMP = {"age_ms": 10.0, "max_age_ms": 500.0, "late": False}


class EmulatedAircraft:
    """Publishes a position, a height and health twice a second until ``close``."""

    def __init__(self, name: str, endpoint: str, lat: float) -> None:
        self._hub = RunningHub()
        table = ZenohTable(connect=endpoint)
        self.publisher = RunningPublisher(self._hub, Publish(zenoh=table), aircraft=name, session=SESSION)
        self._lat = lat

    def send(self, height_agl: float, valid: bool = True) -> None:
        """Publish one set of outputs."""
        t_ns = time.time_ns()
        times: dict[str, Any] = {"t_ns": t_ns, "t_valid_ns": t_ns, "valid": valid, "reasons": ()}
        solution = NavSolution(**times, lat=self._lat, lon=0.2, alt=812.0)
        height = HeightBelowAircraft(**times, sensor="radalt", height_agl=height_agl, sd=0.3, datum=Datum.AGL)
        self.publisher.publish("/nav/nav_solution", **to_table(solution), **STAMP)
        self.publisher.publish("/nav/height_below_aircraft", **to_table(height), **STAMP)

    def close(self) -> None:
        """End it."""
        self.publisher.close()
        self._hub.close()


@contextlib.contextmanager
def aircraft(name: str, endpoint: str, lat: float) -> Iterator[EmulatedAircraft]:
    running = EmulatedAircraft(name, endpoint, lat)
    try:
        running.publisher.wait_for_state("zenoh", "connected")
        yield running
    finally:
        running.close()


@contextlib.contextmanager
def repeatedly(send: Callable[[], None]) -> Iterator[None]:
    """Calls a function three times a second."""
    ended = threading.Event()

    def run() -> None:
        while not ended.wait(0.3):
            send()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


# --------------------------------------------------------------------------------------- another computer


@pytest.fixture
def ground_computer() -> Iterator[tuple[str, list[str]]]:
    """A network namespace with one link to this one: its address, and the prefix of commands that run there."""
    ip = find_program("ip", "iproute2")
    name, link = f"ground{os.getpid()}", f"fti{os.getpid()}"

    def run(*words: str) -> None:
        done = subprocess.run([ip, *words], capture_output=True, text=True, check=False)
        if done.returncode:
            pytest.skip(f"network namespaces need the privileges of root: ip {' '.join(words)}: {done.stderr.strip()}")

    run("netns", "add", name)
    try:
        run("link", "add", f"{link}a", "type", "veth", "peer", "name", f"{link}b", "netns", name)
        run("addr", "add", "10.213.77.1/30", "dev", f"{link}a")
        run("link", "set", f"{link}a", "up")
        run("-n", name, "addr", "add", "10.213.77.2/30", "dev", f"{link}b")
        run("-n", name, "link", "set", f"{link}b", "up")
        run("-n", name, "link", "set", "lo", "up")
        yield "10.213.77.2", [ip, "netns", "exec", name]
    finally:
        subprocess.run([ip, "netns", "del", name], check=False)


def watch(prefix: list[str], endpoint: str, *arguments: str) -> dict[str, Any]:
    """What ``fti watch --router`` prints on a computer."""
    command = [*prefix, *FTI, "watch", "--router", endpoint, "--once", "--json", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    assert done.returncode == 0, done.stderr
    shown: dict[str, Any] = json.loads(done.stdout)["aircraft"]
    return shown


def test_two_aircraft_are_watched_on_another_computer(ground_computer: tuple[str, list[str]]) -> None:
    address, prefix = ground_computer
    endpoint = f"tcp/{address}:7447"
    router = Router(endpoint, prefix)
    try:
        with aircraft("D-EFTI", endpoint, 0.83) as first, aircraft("N-42", endpoint, 0.64) as second:
            first.send(101.5)
            wait_for(lambda: first.publisher.sinks["zenoh"].sent == 2, "two messages")
            time.sleep(0.6)
            queried = watch(prefix, endpoint)["D-EFTI"]["outputs"]["/nav/nav_solution"]
            assert (queried["lat"], queried["valid"], queried["late"]) == (0.83, False, True)
            assert queried["age_ms"] > 600.0
            with repeatedly(lambda: first.send(101.5)), repeatedly(lambda: second.send(33.0, valid=False)):
                shown = watch(prefix, endpoint)
            assert {name: state["session"] for name, state in shown.items()} == {"D-EFTI": SESSION, "N-42": SESSION}
            solution = shown["D-EFTI"]["outputs"]["/nav/nav_solution"]
            assert (solution["lat"], solution["valid"]) == (0.83, True)
            assert shown["N-42"]["outputs"]["/nav/height_below_aircraft"]["valid"] is False
            assert shown["D-EFTI"]["alarms"] == []
    finally:
        router.kill()


# ------------------------------------------------------------------------------------------------- this computer


@pytest.fixture
def router() -> Iterator[Router]:
    running = Router(f"tcp/127.0.0.1:{choose_port(0)}")
    yield running
    running.kill()


def test_without_an_aircraft_or_a_router_it_says_so(router: Router) -> None:
    done = fti("watch", "--router", router.endpoint, "--once")
    assert done.returncode == 2 and "no message of any aircraft within 10 s" in done.stderr
    nowhere = f"tcp/127.0.0.1:{choose_port(0)}"
    done = fti("watch", "--router", nowhere, "--once")
    assert done.returncode == 2 and nowhere in done.stderr
    done = fti("watch", "--aircraft", "D-EFTI")
    assert done.returncode == 2 and "--aircraft needs --router" in done.stderr
    done = fti("watch", "--ca-file", "ca.pem")
    assert done.returncode == 2 and "--ca-file needs --router" in done.stderr
    done = fti("ground", "--connect", "ground:7447")
    assert done.returncode == 2 and "connect" in done.stderr


@contextlib.contextmanager
def ground_station(endpoint: str) -> Iterator[str]:
    """A running ``fti ground``: address of its page."""
    command = [*FTI, "ground", "--connect", endpoint, "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout
    try:
        line = process.stdout.readline()
        assert line.startswith("ground station at http://127.0.0.1:"), line
        yield line.split()[-1]
        process.send_signal(signal.SIGINT)
        assert process.wait(30.0) == 130
    finally:
        process.kill()
        process.communicate()


@pytest.mark.browser
async def test_the_page_shows_every_aircraft_and_the_page_of_each(router: Router, tmp_path: Path) -> None:
    with (
        ground_station(router.endpoint) as address,
        aircraft("D-EFTI", router.endpoint, 0.83) as first,
        aircraft("N-42", router.endpoint, 0.64) as second,
        repeatedly(lambda: first.send(101.5)),
        repeatedly(lambda: second.send(33.0, valid=False)),
    ):
        async with Chromium() as browser:
            page = await browser.open(address)
            await page.wait_for("document.querySelectorAll('#rows tr').length === 2")
            await page.wait_for(f"{by_testid('height-D-EFTI')}.textContent === '101.5 m'")
            await page.wait_for(f"{by_testid('height-N-42')}.classList.contains('struck')")
            assert await page.text("position-D-EFTI") == "47.55550° N 011.45916° E"
            assert not await page.eval(f"{by_testid('height-D-EFTI')}.classList.contains('struck')")
            await page.screenshot(tmp_path / "fleet.png")
            await page.eval(f"{by_testid('aircraft-D-EFTI')}.click()")
            await page.wait_for("location.pathname === '/aircraft/D-EFTI/'")
            await page.wait_for("document.body.textContent.includes('101.5')")
            assert await page.text("aircraft") == "D-EFTI"
            await page.screenshot(tmp_path / "aircraft.png")
            os.kill(first.publisher.process.pid, signal.SIGSTOP)
            await page.wait_for("document.body.textContent.includes('NO CONTACT')")
            os.kill(first.publisher.process.pid, signal.SIGCONT)
            await page.wait_for("!document.body.textContent.includes('no message from the aircraft')")
