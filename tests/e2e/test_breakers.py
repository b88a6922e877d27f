"""A breaker of the emulated power unit, tripped and reset: on the page, in the terminal, and in the file."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from fti.logger.reading.recording import Recording
from tests.e2e.flights import demo_config, emulator
from tests.e2e.harness import START_S, Daemon, daemon, fti
from tests.helpers import until
from tests.web.chromium import Chromium, Page, by_testid

pytestmark = [pytest.mark.e2e, pytest.mark.alone, pytest.mark.browser, pytest.mark.timeout(300)]
HEIGHT = "height-altimeter-agl"
BREAKER = "breaker-altimeter"
BOOT_S = 1.0
LONG_S = 60.0
STRUCK = f"!({by_testid(HEIGHT)} && getComputedStyle({by_testid(HEIGHT)}).textDecorationLine === 'none')"
#: So slow that the flight lasts longer than the test.
SCENARIO = """
title = "Slow approach"
description = "An approach at a third of the usual speed."
config = "demo.toml"

[flight]
speed_mps = 20
duration_s = 215
"""


async def test_a_breaker_takes_the_altimeter_away_and_gives_it_back(tmp_path: Path) -> None:
    config, links, run_dir = demo_config(tmp_path), tmp_path / "links", str(tmp_path / "run")
    scenario = tmp_path / "slow.toml"
    scenario.write_text(SCENARIO)
    with emulator(str(scenario), config, links, "--wait", "--run-dir", run_dir) as flying:
        await asyncio.to_thread(until, lambda: links.is_dir() or flying.poll() is not None, START_S, "the ports")
        arguments = ("--links", str(links), "--run-dir", run_dir)
        with daemon(config, tmp_path / "out", *arguments) as running:
            running.run_dir = Path(run_dir)
            async with Chromium() as browser:
                page = await browser.open(await asyncio.to_thread(lambda: running.page))
                await page.wait_for(f"{by_testid(BREAKER)}?.textContent === 'ON' && !{STRUCK}", LONG_S)
                await trips_by_command(page, running, tmp_path)
                await is_reset_on_the_page(page)
                await refuses_itself(running)
                assert page.problems == []
            session = running.session
            await asyncio.to_thread(running.stop)
    stands_in_the_file(session)


async def trips_by_command(page: Page, running: Daemon, folder: Path) -> None:
    done = await send(running, "trip", "altimeter")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("1: pdu trip breaker=altimeter: acknowledged after ")
    await page.wait_for(f"{by_testid(BREAKER)}.textContent === 'TRIPPED' && {STRUCK}", LONG_S)
    await page.wait_for(f"{by_testid('link-radalt_line-state')}.textContent === 'silent'", LONG_S)
    await page.screenshot(folder / "tripped.png")
    await asyncio.to_thread(until, lambda: silent(watch(running)) == ["altimeter"], LONG_S, "the altimeter alone")
    state = await asyncio.to_thread(watch, running)
    assert state["hil"]["devices"]["altimeter"]["breaker"] == "tripped"
    assert state["hil"]["devices"]["gnss"]["breaker"] == "on"
    assert state["outputs"]["/nav/height_above_ground/altimeter"]["valid"] is False


def silent(state: dict[str, Any]) -> list[str]:
    """Devices from which nothing comes."""
    return [name for name, device in state["health"]["devices"].items() if device["state"] == "silent"]


async def is_reset_on_the_page(page: Page) -> None:
    await page.wait_for(f"!{by_testid(BREAKER)}.disabled")
    await page.eval(f"{by_testid(BREAKER)}.click()")
    await page.eval(f"{by_testid('question-yes')}.click()")
    await page.wait_for(f"{by_testid(BREAKER)}.textContent === 'ON' && !{STRUCK}", LONG_S)


async def refuses_itself(running: Daemon) -> None:
    done = await send(running, "off", "pdu")
    assert done.returncode == 1
    assert "refused" in done.stdout + done.stderr
    assert "pdu is not fed by this unit" in done.stdout + done.stderr


async def send(running: Daemon, command: str, breaker: str) -> Any:
    where = ("--run-dir", str(running.run_dir))
    return await asyncio.to_thread(fti, "send", "pdu", command, f"breaker={breaker}", *where)


def watch(running: Daemon) -> dict[str, Any]:
    done = fti("watch", "--once", "--json", "--run-dir", str(running.run_dir))
    content: dict[str, Any] = json.loads(done.stdout)
    return content


def stands_in_the_file(session: Path) -> None:
    """Each command with its end, and a line that was silent until the device had started."""
    recording = Recording.open(session)
    events = [json.loads(data) for *_, data in recording.messages("/fti/event", kind="raw")]
    texts = [event["message"] for event in events if event["name"] == "command"]
    ends = [text.partition(" after")[0] for text in texts if " after" in text]
    assert ends == [
        "1: pdu trip breaker=altimeter: acknowledged",
        "2: pdu reset breaker=altimeter: acknowledged",
        "3: pdu off breaker=pdu: refused",
    ]
    tripped, reset, _ = [frame.t_rx_ns for frame in recording.sent_frames()]
    arrivals = [frame.t_rx_ns for frame in recording.frames() if frame.link == "radalt_line"]
    between = [t for t in arrivals if tripped + 1e9 < t < reset + 1e9 * BOOT_S * 0.9]
    assert between == []
    assert any(t < tripped for t in arrivals)
    assert any(t > reset for t in arrivals)
    flags = [json.loads(data)["flags"] for *_, data in recording.messages("/pdu/device_status")]
    assert [] in flags
    assert ["altimeter_tripped"] in flags
    assert ["altimeter_starting"] in flags
