"""The page on a real daemon with emulated sensors, in a real browser."""

from __future__ import annotations

import asyncio
import json
import os
import signal
from pathlib import Path

import pytest

from tests.e2e.flights import demo_config, emulator
from tests.e2e.harness import START_S, daemon, fti
from tests.helpers import until
from tests.web.chromium import Chromium, Page, by_testid

pytestmark = [pytest.mark.e2e, pytest.mark.browser, pytest.mark.timeout(900)]
HEIGHT = "height-altimeter-agl"
LATE = "alarm-item-navigation_late"
LONG_S = 40.0
MARK = "over the threshold"


def _struck(testid: str) -> str:
    """JavaScript: is the element, or what it stands in, struck out?"""
    return (
        f"(() => {{ for (let e = {by_testid(testid)}; e; e = e.parentElement)"
        " if (getComputedStyle(e).textDecorationLine.includes('line-through')) return true; return false; })()"
    )


async def _moves(page: Page, testid: str) -> None:
    """The text of an element changes, and is a number."""
    await page.wait_for(f"Number.isFinite(parseFloat({by_testid(testid)}?.textContent))", LONG_S)
    before = await page.text(testid)
    await page.wait_for(f"{by_testid(testid)}.textContent !== '{before}'", LONG_S)


async def test_the_page_shows_the_flight_and_every_end_of_it(tmp_path: Path) -> None:
    config, links = demo_config(tmp_path), tmp_path / "links"
    with emulator("nominal", config, links, "--wait") as flying:
        await asyncio.to_thread(until, lambda: links.is_dir() or flying.poll() is not None, START_S, "the ports")
        with daemon(config, tmp_path / "out", "--links", str(links)) as running:
            async with Chromium() as browser:
                address = await asyncio.to_thread(lambda: running.page)
                page = await browser.open(address)
                await page.wait_for(f"{by_testid('origin')}.textContent === 'HIL'")
                for testid in (HEIGHT, "attitude-heading"):
                    await _moves(page, testid)
                await page.wait_for(f"!{_struck(HEIGHT)}")
                await page.wait_for(f"{by_testid('link-radalt_line-state')}.textContent === 'good'")

                flying.send_signal(signal.SIGSTOP)
                await page.wait_for(_struck(HEIGHT), LONG_S)
                await page.wait_for(f"{by_testid('link-radalt_line-state')}.textContent === 'silent'", LONG_S)
                flying.send_signal(signal.SIGCONT)
                await page.wait_for(f"!{_struck(HEIGHT)}", LONG_S)

                navigation = await asyncio.to_thread(running.pid_of, "navigation")
                os.kill(navigation, signal.SIGSTOP)
                await page.wait_for(f"!!{by_testid('alarm-more')}", LONG_S)
                await page.eval(f"{by_testid('alarm-more')}.click()")
                await page.wait_for(f"!!{by_testid(LATE)}", LONG_S)
                await page.wait_for(_struck(HEIGHT))
                os.kill(navigation, signal.SIGCONT)
                await page.wait_for(f"{by_testid(LATE)}?.textContent.includes('ended after')", LONG_S)
                await page.press("a")
                await page.wait_for(f"!{by_testid(LATE)}", LONG_S)

                await page.press("m")
                await page.type_text(MARK)
                await page.press("Enter")
                await page.wait_for(f"{by_testid('events')}.textContent.includes('{MARK}')", LONG_S)

                await page.screenshot(tmp_path / "page.png")
                await asyncio.to_thread(running.stop)
                await page.wait_for("document.body.classList.contains('disconnected')", LONG_S)
                text = f"getComputedStyle({by_testid('no-connection')}).display !== 'none'"
                assert await page.eval(text)
                assert await page.eval("document.getElementById('no-connection-title').textContent") == "STOPPED"
                assert await page.text("recording") == "STOPPED"
                assert not await page.eval("document.body.classList.contains('daemon-stopped')")
                await page.screenshot(tmp_path / "stopped.png")
                site = address.partition("#")[0]
                local = (site, site.replace("http:", "ws:"))
                assert page.requests
                assert all(url.startswith(local) for url in page.requests)
    assert _marks_of(tmp_path / "out") == [MARK]


def _marks_of(out: Path) -> list[str]:
    """Texts of the marks in the only session there, as ``fti info`` tells them."""
    (session,) = [path for path in out.iterdir() if list(path.glob("*.mcap"))]
    done = fti("info", str(session), "--json")
    return [event["text"] for event in json.loads(done.stdout)["events"] if event["source"] == "mark"]
