"""The page in a real browser, fed by the real display process over the real bus."""

import asyncio
import math
import os
import pwd
import signal
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from fti.bus.message import encode
from fti.messages.topics import BUS_ALARMS
from fti.reason_texts import REASONS
from tests.alarm_cases import CASES, Daemon, daemon_with
from tests.run_dirs import running_daemon
from tests.web.chromium import Chromium, Page, by_testid, running_chromium
from tests.web.fake_daemon import DRIFT, KEY, PROVISIONAL, SESSION, DisplayProcess, FakeDaemon, make_clock, make_sinks

pytestmark = [pytest.mark.browser, pytest.mark.e2e]

WITHOUT_KEY = "view only; to control: fti page"
WRONG_KEY = "the key is old; to control: fti page"
LASER = "height-laser_altimeter"
SOLUTION = "/nav/nav_solution"
MAY_COMMAND = f"!{by_testid('mark-text')}.hidden"
FRESH = f"document.body?.className === '' && {by_testid('origin')}?.textContent === 'HIL'"
#: Whose browser it is.
ME = pwd.getpwuid(os.getuid()).pw_name


@pytest.fixture
def daemon() -> Iterator[FakeDaemon]:
    result = FakeDaemon(lead_s=70.0)
    yield result
    result.close()


@pytest.fixture
def display(daemon: FakeDaemon) -> Iterator[DisplayProcess]:
    result = DisplayProcess(daemon)
    daemon.start()
    yield result
    result.close()


@pytest.fixture(scope="module")
def chromium() -> Iterator[str]:
    """The address of one browser for all tests."""
    with running_chromium() as address:
        yield address


@pytest.fixture
async def browser(chromium: str) -> AsyncIterator[Chromium]:
    """An empty profile."""
    async with Chromium(chromium) as result:
        yield result


@pytest.fixture
async def page(display: DisplayProcess, browser: Chromium) -> Page:
    opened = await browser.open(display.owner_url)
    await opened.wait_for(f"{FRESH} && {MAY_COMMAND}")
    return opened


def is_struck(testid: str) -> str:
    style = f"getComputedStyle({by_testid(testid)})"
    return f"{style}.textDecorationLine === 'line-through'"


def shows(testid: str, words: str) -> str:
    return f"{by_testid(testid)}?.textContent.includes('{words}')"


def counts_colours(plot: str) -> str:
    """How many pixels of a plot's canvas are not transparent."""
    canvas = f"document.querySelector('[data-testid=\"{plot}\"] canvas')"
    pixels = f"{canvas}.getContext('2d').getImageData(0, 0, {canvas}.width, {canvas}.height).data"
    return f"{pixels}.reduce((sum, v, i) => sum + (i % 4 === 3 && v > 0), 0)"


def counts_marks(plot: str) -> str:
    """How many pixels of a plot's canvas have the colour of the marks."""
    canvas = f"document.querySelector('[data-testid=\"{plot}\"] canvas')"
    image = f"{canvas}.getContext('2d').getImageData(0, 0, {canvas}.width, {canvas}.height)"
    pixels = f"new Uint32Array({image}.data.buffer)"
    return f"{pixels}.reduce((sum, v) => sum + (v === 0xfff4eee8), 0)"


async def test_values_change_and_nothing_comes_from_outside(page: Page, display: DisplayProcess) -> None:
    before = await page.text(f"{LASER}-agl")
    assert float(before) > 0
    await page.wait_for(f"{by_testid(f'{LASER}-agl')}.textContent !== '{before}'")
    assert not await page.eval(is_struck(f"{LASER}-agl"))
    assert await page.text(f"{LASER}-validity") == "VALID"
    assert await page.text("session") == SESSION
    assert await page.text("recording") == "RECORDING"
    assert await page.text("link-gnss_line-state") == "absent"
    assert "ttyUSB3 does not exist" in await page.text("link-gnss_line-hint")
    assert not await page.eval(f"{by_testid('no-alarms')}.hidden")
    await page.wait_for(f"{counts_colours('heights-plot')} > 3000")
    assert {urlsplit(url).netloc for url in page.requests} == {f"127.0.0.1:{display.port}"}
    assert page.problems == []


SIZES = ((1024, 768), (1280, 800), (1440, 900), (1920, 1080))
PANELS = ("heights", "integrity", "glide", "attitude")


async def test_it_stands_on_one_screen_and_a_narrow_one_scrolls_down_only(page: Page) -> None:
    for width, height in SIZES[1:]:
        await page.resize(width, height)
        assert await page.eval("document.documentElement.scrollHeight") == height
        assert await page.eval("document.documentElement.scrollWidth") == width
        assert await page.eval(CUT_OFF) == []
    for width in (1024, 760, 360):
        await page.resize(width, 768)
        assert await page.eval("document.documentElement.scrollWidth") == width


@pytest.mark.parametrize("breakers", [None, {"radar_altimeter": "tripped"}])
async def test_all_instruments_stand_on_one_screen(
    page: Page, daemon: FakeDaemon, tmp_path: Path, breakers: dict[str, str] | None
) -> None:
    """On the smallest one, too, with alarms, and in the laboratory."""
    await raise_alert(daemon, page)
    daemon.breakers = breakers
    await page.wait_for(f"document.getElementById('laboratory').hidden === {'true' if breakers is None else 'false'}")
    for width, height in SIZES:
        await page.resize(width, height)
        boxes = await page.eval(
            f"{list(PANELS)}.map((id) => document.getElementById(id).getBoundingClientRect().toJSON())"
        )
        for panel, box in zip(PANELS, boxes, strict=True):
            assert 0 <= box["left"] < box["right"] <= width, panel
            assert 0 <= box["top"] < box["bottom"] <= height, panel
            assert box["width"] > 250, panel
            assert box["height"] > 250, panel
        assert await page.eval(HIDDEN_PARTS) == []
        await page.screenshot(tmp_path / f"instruments_{width}.png")


#: Sizes on the screen [px] of all texts that one can see, by the text, if they are below 14.  The instruments follow a
#: change of the window in a later frame, so it is waited for.
SMALL_TEXTS = """[...document.querySelectorAll('body *')].filter((e) =>
    [...e.childNodes].some((n) => n.nodeType === Node.TEXT_NODE && n.data.trim()) && e.checkVisibility()
    || e.matches('input, select, button')).map((e) => {
  const matrix = e instanceof SVGElement ? e.getScreenCTM() : { a: 1, b: 0 };
  return [e.textContent || e.placeholder, parseFloat(getComputedStyle(e).fontSize) * Math.hypot(matrix.a, matrix.b)];
}).filter(([, size]) => size < 13.99)"""

#: Records the sizes of the texts that are written on a canvas from now on.
WATCH_CANVAS = """(() => {
    const write = CanvasRenderingContext2D.prototype.fillText;
    window.canvasTexts = {};
    CanvasRenderingContext2D.prototype.fillText = function (text, ...where) {
        canvasTexts[text] = parseFloat(this.font.match(/([\\d.]+)px/)[1]) / devicePixelRatio;
        write.call(this, text, ...where);
    };
})()"""


async def test_no_text_is_smaller_than_14_pixels(page: Page, daemon: FakeDaemon, display: DisplayProcess) -> None:
    """With everything that the page can show."""
    display.send("UsableDevices", devices=[*CATALOGUE, PDU])
    display.send("CommandProgress", **make_request("k1", 1, "waiting", "waiting"))
    daemon.breakers = {"radar_altimeter": "tripped"}
    daemon.change_health = make_clocks
    daemon.muted.discard(PROVISIONAL)
    await raise_alert(daemon, page)
    daemon.publish_event("info", "mark", "approach 3")
    await page.eval(WATCH_CANVAS)
    await page.wait_for(shows("device-ins-gps-state", "not used"))
    await page.eval(f"{by_testid('alarm-more')}.click()")
    await page.wait_for(f"{by_testid('breaker-gnss')} && canvasTexts['approach 3']")
    for width, height in (*SIZES, (360, 640)):
        await page.resize(width, height)
        await page.wait_for(f"!{SMALL_TEXTS}.length")
        await page.press("c")
        await page.wait_for(f"!{SMALL_TEXTS}.length")
        await page.press("c")
    await page.press("?")
    await page.wait_for(f"!{SMALL_TEXTS}.length")
    sizes = await page.eval("canvasTexts")
    assert {text for text in sizes if text[-1].isdigit() and ":" not in text}, "the axes of values"
    assert min(sizes.values()) >= 14


#: Instruments that hide a part of themselves; texts that are cut off or shortened; cells that need a second line.
HIDDEN_PARTS = """[
    ...[...document.querySelectorAll('main .panel, .sensors, .fallbacks')]
        .filter((e) => e.scrollHeight > e.clientHeight),
    ...[...document.querySelectorAll('main :is(.panel, .panel :not(svg, svg *))')]
        .filter((e) => e.scrollWidth > e.clientWidth && e.clientWidth),
    ...[...document.querySelectorAll('.motion dt')].filter((e) => e.clientHeight > 20),
    ...[...document.querySelectorAll('main .validity')].filter((e) => e.textContent && e.offsetHeight < 10),
].map((e) => e.id || e.textContent)"""


async def test_a_small_screen_hides_no_part_of_an_instrument(page: Page, daemon: FakeDaemon) -> None:
    daemon.changes[SOLUTION] = {
        "hpl": 1066.0,
        "vpl": 120.0,
        "heading_pl": math.radians(179.0),
        "tilt_pl": math.radians(12.0),
    }
    await page.resize(1280, 800)
    await page.wait_for(f"{by_testid('attitude-lon-sd')}.textContent === 'HPL 1066 · VPL 120'")
    assert await page.eval("document.documentElement.scrollHeight") == 800
    assert await page.eval(HIDDEN_PARTS) == []
    daemon.breakers = {}
    await page.wait_for("!document.getElementById('laboratory').hidden")
    assert await page.eval(HIDDEN_PARTS) == []


#: The longest text first.
REASONS_BY_LENGTH = sorted(REASONS, key=lambda reason: -len(REASONS[reason]))
HEIGHTS = ("/nav/height_below_aircraft", *(f"/nav/height_above_ground/{n}_altimeter" for n in ("laser", "radar")))
REASON_PLACES = (
    *("height-below-validity", f"{LASER}-validity", "height-radar_altimeter-validity"),
    *("glide-validity", "attitude-validity", "integrity-reasons"),
    *("fallback-filter-validity", "fallback-vertical-validity", "fallback-fix-validity"),
)


def is_cut_off(testid: str) -> str:
    """Whether the text of an element reaches beyond a box that hides it, beyond its panel or behind another text."""
    return f"""(() => {{
        const e = {by_testid(testid)};
        const range = document.createRange();
        range.selectNodeContents(e);
        const text = range.getBoundingClientRect();
        const style = getComputedStyle(e);
        if (style.textOverflow === 'ellipsis' || style.webkitLineClamp !== 'none') return true;
        for (let box = e.parentElement; box.id !== 'attitude' && box.tagName !== 'MAIN'; box = box.parentElement) {{
            const outer = box.getBoundingClientRect();
            if (text.left < outer.left || text.right > outer.right + 1) return true;
            if (text.top < outer.top - 3 || text.bottom > outer.bottom + 3) return true;
        }}
        return false;
    }})()"""


async def test_the_longest_reasons_fit_their_place(page: Page, daemon: FakeDaemon, tmp_path: Path) -> None:
    one, two = REASONS_BY_LENGTH[:1], REASONS_BY_LENGTH[:2]
    for topic in (*HEIGHTS, "/nav/filter_solution", "/nav/vertical_solution", "/nav/position_fix"):
        daemon.changes[topic] = {"valid": False, "reasons": one}
    daemon.changes["/nav/glide_slope"] = {"valid": False, "reasons": two}
    daemon.changes[SOLUTION] = {"valid": False, "reasons": two, "attitude_valid": False, "attitude_reasons": one}
    daemon.changes[SOLUTION] |= {"position_source": "radio", "altitude_source": "vertical", "hpl": 1066.0, "vpl": 120.0}
    daemon.change_integrity = lambda fields: fields | {"state": "unavailable", "reasons": two, "valid": False}
    words = REASONS[one[0]]
    await page.wait_for(" && ".join(shows(place, words) for place in REASON_PLACES))
    for width, height in SIZES:
        await page.resize(width, height)
        assert [place for place in REASON_PLACES if await page.eval(is_cut_off(place))] == [], width
        assert await page.eval(HIDDEN_PARTS) == [], width
        await page.screenshot(tmp_path / f"reasons_{width}.png")


#: Numbers that reach beyond their panel, remarks that are shortened, panels that hide a part of what is in them.
CUT_OFF = """[
    ...[...document.querySelectorAll(':is(.panel, #banner) :is(b, dd, td.number, span.ground, .fallbacks span)')]
        .filter((e) => e.getBoundingClientRect().right > e.closest('.panel, #banner').getBoundingClientRect().right),
    ...[...document.querySelectorAll('.sensor span, h2 .note')]
        .filter((e) => e.scrollWidth > e.clientWidth && e.clientWidth),
    ...[...document.querySelectorAll('.panel')].filter((e) => e.scrollHeight > e.clientHeight),
].map((e) => e.id || e.textContent)"""


async def test_how_far_an_unconfirmed_source_is_off_is_shown_as_long_as_it_is_published(
    page: Page, daemon: FakeDaemon
) -> None:
    row = by_testid("fallback-provisional-gnss")
    assert await page.eval(f"{row} === null")
    daemon.muted.discard(PROVISIONAL)
    await page.wait_for(f"{row} !== null")
    assert await page.text("fallback-provisional-gnss-sd") == "104 m off, height −1 m · HPL 154"
    assert await page.text("fallback-provisional-gnss-validity") == "not confirmed after a fault"
    assert "used again after a step back that cancels it, or fti readmit" in await page.eval(f"{row}.title")
    await page.resize(1440, 900)
    assert await page.eval("document.documentElement.scrollHeight") == 900
    assert await page.eval(CUT_OFF) == []
    daemon.muted.add(PROVISIONAL)
    await page.wait_for(f"{row} === null")


async def test_the_drift_over_the_ground_is_shown(page: Page, daemon: FakeDaemon) -> None:
    daemon.muted.discard(DRIFT)
    await page.wait_for(f"{by_testid('fallback-drift')} !== null")
    assert await page.text("fallback-drift-sd") == "0.50 ± 0.06 m, 48 %"
    assert await page.text("fallback-drift-validity") == "valid"
    title = await page.eval(f"{by_testid('fallback-drift')}.title")
    assert "3 directions determined; 48 % of the points on common ground; 8 of 41 pairs did not aid" in title
    await page.resize(1440, 900)
    assert await page.eval("document.documentElement.scrollHeight") == 900
    assert await page.eval(CUT_OFF) == []
    missing = dict.fromkeys(("north", "east", "down", "north_sd", "east_sd", "down_sd", "overlap", "interval"))
    daemon.changes[DRIFT] = {"valid": False, "reasons": ["not_calibrated"], **missing}
    await page.wait_for(f"{by_testid('fallback-drift-validity')}.textContent === 'not calibrated with satellites yet'")


async def test_what_takes_the_place_of_devices_is_reported_and_a_known_attitude_stays(
    page: Page, daemon: FakeDaemon
) -> None:
    assert await page.text("attitude-alt-sd") == "± 2.1"
    assert await page.text("attitude-lat-sd") == "± 1.5 m"
    assert await page.text("attitude-lon-sd") == "HPL 15 · VPL 20"
    assert await page.text("fallback-filter-validity") == "aided"
    assert await page.text("fallback-fix-validity") == "no DME ranges, geometry gives no position"
    assert await page.text("fallback-ground-sd") == "± 5 m"
    assert await page.text("fallback-ground-validity") == "valid, map not verified"
    by_radio = {"position_source": "radio", "altitude_source": "radio", "horizontal_sd": 222.0}
    by_radio |= {"hpl": 1066.0, "unchecked": ["nothing_to_compare"]}
    daemon.changes[SOLUTION] = {
        **by_radio,
        "valid": False,
        "reasons": ["no_velocity"],
        "vel_north": None,
        "vel_down": None,
    }
    await page.wait_for(f"{by_testid('attitude-sources')}.textContent === 'pos radio · att ins'")
    assert await page.text("attitude-validity") == "no velocity"
    assert await page.text("attitude-lat-sd") == "± 222 m"
    assert await page.text("attitude-lon-sd") == "HPL 1066 · VPL 20"
    assert await page.eval("document.querySelector('.cells .lon .sd').classList.contains('unchecked')")
    assert await page.text("attitude-speed") == "–"
    assert not await page.eval(is_struck("attitude-roll"))
    assert not await page.eval("document.querySelector('.horizon').classList.contains('unusable')")
    await page.wait_for(shows("alarm-position", "POSITION NOT VALID"))
    assert "no velocity" in await page.text("alarm-position")


async def test_the_attitude_shows_its_protection_level_and_whether_it_is_valid(page: Page, daemon: FakeDaemon) -> None:
    assert await page.text("attitude-state") == "ATT VALID"
    levels = [await page.text(f"attitude-{name}-sd") for name in ("roll", "pitch", "heading")]
    assert levels == ["PL 0.4", "PL 0.4", "PL 6.4"]
    daemon.changes[SOLUTION] = {"attitude_unchecked": ["nothing_to_compare"], "tilt_pl": math.radians(4.8)}
    await page.wait_for(f"{by_testid('attitude-state')}.textContent === 'ATT UNCHECKED'")
    assert await page.text("attitude-roll-sd") == "PL 4.8"
    assert await page.eval("document.querySelector('.cells .roll .sd').classList.contains('unchecked')")
    assert await page.eval(f"{by_testid('attitude-state')}.title") == "nothing to compare with"
    why = {"reasons": ["attitude_level"], "attitude_reasons": ["attitude_level"]}
    daemon.changes[SOLUTION] = {"valid": False, "attitude_valid": False, **why, "tilt_pl": math.radians(3.36)}
    await page.wait_for(f"{by_testid('attitude-state')}.textContent === 'ATT NOT VALID'")
    assert await page.text("attitude-validity") == "attitude protection level above alert limit"
    daemon.muted.add("/nav/nav_solution")
    await page.wait_for(f"{by_testid('attitude-state')}.textContent === ''")


async def test_the_height_below_has_the_vertical_protection_level_beside_it(page: Page, daemon: FakeDaemon) -> None:
    assert await page.text("height-below-vpl") == "alt VPL 20 m"
    daemon.changes[SOLUTION] = {"vpl": 44.2, "unchecked": ["nothing_to_compare"]}
    await page.wait_for(f"{by_testid('height-below-vpl')}.textContent === 'alt VPL 44 m'")
    assert await page.eval(f"{by_testid('height-below-vpl')}.classList.contains('unchecked')")
    daemon.changes[SOLUTION] = {"vpl": None}
    await page.wait_for(f"{by_testid('height-below-vpl')}.textContent === ''")


async def test_one_height_is_large_and_names_its_source(page: Page) -> None:
    await page.wait_for(f"{by_testid('height-below-source')}.textContent === 'by radar altimeter'")
    size = "parseFloat(getComputedStyle({}).fontSize)"
    small = await page.eval(size.format(by_testid(f"{LASER}-agl")))
    assert await page.eval(size.format(by_testid("height-below"))) >= 2 * small
    assert (await page.text("height-below-sd")) == "± 1.2"


async def test_a_stopped_sensor_is_struck_out_and_the_others_are_not(page: Page, daemon: FakeDaemon) -> None:
    daemon.muted.add("/nav/height_above_ground/laser_altimeter")
    await page.wait_for(f"{is_struck(f'{LASER}-agl')} && {is_struck(f'{LASER}-raw')}")
    assert (await page.text(f"{LASER}-validity")).startswith("STALE ")
    assert not await page.eval(is_struck("height-radar_altimeter-agl"))
    daemon.muted.clear()
    await page.wait_for(f"!({is_struck(f'{LASER}-agl')})")


async def test_a_stopped_navigation_is_announced(page: Page, daemon: FakeDaemon) -> None:
    assert await page.eval(f"{by_testid('alarm-navigation')} === null")
    daemon.stop_navigation()
    await page.wait_for(shows("alarm-navigation", "NAVIGATION STOPPED"))
    values = (f"{LASER}-agl", "glide-deviation", "attitude-roll", "integrity-state", "t1")
    await page.wait_for(" && ".join(is_struck(testid) for testid in values))
    assert await page.eval(f"getComputedStyle({by_testid('glide-needle')}).display") == "none"


async def test_a_stopped_daemon_is_announced(page: Page, daemon: FakeDaemon) -> None:
    daemon.muted.add("/health")
    await page.wait_for(shows("alarm-daemon", "DAEMON STOPPED"))
    await page.wait_for(is_struck("recording"))


async def test_a_lost_connection_is_unmistakable_and_ends(
    page: Page, daemon: FakeDaemon, display: DisplayProcess
) -> None:
    display.send("UsableDevices", devices=CATALOGUE)
    await page.wait_for(f"!{by_testid('commands-open')}.hidden")
    display.process.send_signal(signal.SIGSTOP)
    await page.eval(f"{by_testid('commands-send')}.click()")
    display.process.kill()
    display.process.wait()
    await page.wait_for("document.body.classList.contains('disconnected')")
    await page.wait_for(shows("commands-word", "may have been sent"))
    assert await page.eval(f"{by_testid('commands-send')}.disabled")  # another click would be another command
    box = await page.eval(f"(({by_testid('no-connection')}).firstElementChild.getBoundingClientRect()).toJSON()")
    assert box["width"] == 1440
    assert await page.eval(f"getComputedStyle({by_testid('no-connection')}).display") == "grid"
    assert (await page.text("no-connection-text")).startswith("values are frozen since ")
    await page.eval(f"{by_testid('mark-button')}.click()")
    await page.wait_for(shows("mark-answer", "no connection"))
    successor = DisplayProcess(daemon, display.port)
    try:
        await page.wait_for(FRESH)
        await page.eval(f"{by_testid('mark-text')}.value = 'second display'")
        await page.wait_for(f"{by_testid('mark-button')}.click() || {shows('mark-answer', 'marked')}")
        assert await asyncio.to_thread(successor.read_message) == mark("second display")
    finally:
        await asyncio.to_thread(successor.close)


async def test_without_the_key_the_page_only_shows(
    daemon: FakeDaemon, display: DisplayProcess, browser: Chromium
) -> None:
    daemon.breakers = {}
    display.send("UsableDevices", devices=[*CATALOGUE, PDU])
    for address, fault in ((display.url, WITHOUT_KEY), (f"{display.url}#key=of_an_earlier_start", WRONG_KEY)):
        page = await browser.open(address)
        await page.wait_for(f"{FRESH} && {shows('view-only', fault)}")
        await page.wait_for(f"!{by_testid('commands-open')}.hidden && {by_testid('breaker-gnss')}?.disabled")
        for testid in ("mark-text", "mark-button", "snapshot-button"):
            assert await page.eval(f"{by_testid(testid)}.hidden")
        assert await page.eval(f"{by_testid('commands-send')}.disabled")
        assert await page.text("commands-word") == fault
        await page.press("m")
        assert await page.eval("document.activeElement === document.body")
        assert await page.eval(CUT_OFF) == []
        assert page.problems == []
    display.control.setblocking(False)
    with pytest.raises(BlockingIOError):
        display.control.recv(1)


async def test_the_key_leaves_the_address_and_stays_in_its_tab(page: Page, display: DisplayProcess) -> None:
    assert await page.eval("location.href") == display.url
    assert await page.eval(f"document.documentElement.outerHTML.includes('{KEY}')") is False
    assert not any(KEY in url for url in page.requests if "#" not in url)
    await page.reload()
    await page.wait_for(f"{FRESH} && {MAY_COMMAND}")


async def test_a_page_that_is_open_already_takes_the_key(display: DisplayProcess, browser: Chromium) -> None:
    page = await browser.open(display.url)
    await page.wait_for(f"{FRESH} && {shows('view-only', WITHOUT_KEY)}")
    await page.eval(f"void (location.href = '{display.owner_url}')")
    await page.wait_for(MAY_COMMAND)
    assert await page.eval("location.hash") == ""


async def test_the_file_of_the_run_directory_leads_to_the_page_with_the_key(
    display: DisplayProcess, browser: Chromium, tmp_path: Path
) -> None:
    with running_daemon(tmp_path / "run", page=display.owner_url) as made:
        page = await browser.open((made.path / "page.html").as_uri())
        await page.wait_for(f"location.href === '{display.url}' && {FRESH} && {MAY_COMMAND}")


async def test_a_display_that_hangs_is_a_lost_connection(page: Page, display: DisplayProcess) -> None:
    display.send("UsableDevices", devices=CATALOGUE)
    await page.wait_for(f"!{by_testid('commands-open')}.hidden")
    display.process.send_signal(signal.SIGSTOP)
    try:
        await page.wait_for(shows("no-connection-text", "values are frozen since "))
        await page.eval(f"{by_testid('commands-send')}.click()")  # it would go out when the display goes on
        await page.wait_for(shows("commands-word", "no connection"))
    finally:
        display.process.send_signal(signal.SIGCONT)
    await page.wait_for(FRESH)


async def test_an_alert_is_a_red_block_and_an_alarm(page: Page, daemon: FakeDaemon, tmp_path: Path) -> None:
    daemon.change_integrity = make_alert
    await page.wait_for(shows("alarm-integrity_alert", "GROUND CLEARANCE ALERT"))
    await page.wait_for(f"{by_testid('integrity-state')}.textContent === 'ALERT'")
    block = f"getComputedStyle({by_testid('integrity-state')}.parentElement).backgroundColor"
    assert await page.eval(block) == "rgb(208, 23, 39)"
    assert await page.text("integrity-reasons") == "obstacle"
    await page.screenshot(tmp_path / "alert.png")
    assert (tmp_path / "alert.png").stat().st_size > 20_000


def lasts(testid: str, words: str) -> str:
    """The alarm is there, and has not ended."""
    return f"{shows(testid, words)} && !{by_testid(testid)}.classList.contains('ended')"


async def raise_alert(daemon: FakeDaemon, page: Page) -> None:
    daemon.change_integrity = make_alert
    await page.wait_for(lasts("alarm-integrity_alert", "GROUND CLEARANCE ALERT"))


async def test_an_alarm_that_has_ended_stays_until_it_is_acknowledged(
    page: Page, daemon: FakeDaemon, display: DisplayProcess
) -> None:
    """With the key; the daemon records the user, and every page shows the same."""
    tile = "alarm-integrity_alert"
    await raise_alert(daemon, page)
    daemon.change_integrity = lambda fields: fields
    await page.wait_for(f"{by_testid(tile)}.classList.contains('ended')")
    assert "ended after" in await page.text(tile)
    await page.reload()
    await page.wait_for(f"{FRESH} && {shows(tile, 'ended after')} && {MAY_COMMAND}")
    await page.press("a")
    assert await asyncio.to_thread(display.read_message) == {"PageAcknowledgement": {"alarm_id": None, "who": ME}}
    daemon.alarms.acknowledge(ME, None)
    await page.wait_for(f"{by_testid(tile)} === null && !{by_testid('no-alarms')}.hidden")


async def test_an_alarm_that_lasts_is_acknowledged_alone_and_stays(
    page: Page, daemon: FakeDaemon, display: DisplayProcess
) -> None:
    tile = "alarm-integrity_alert"
    await raise_alert(daemon, page)
    await page.eval(f"{by_testid(tile)}.click()")
    assert await asyncio.to_thread(display.read_message) == {
        "PageAcknowledgement": {"alarm_id": "integrity_alert", "who": ME}
    }
    daemon.alarms.acknowledge("berta", "integrity_alert")
    await page.wait_for(f"{by_testid(tile)}.classList.contains('acknowledged')")
    await page.eval(f"{by_testid('alarm-more')}.click()")
    await page.wait_for(shows("alarm-list", "acknowledged by berta"))
    assert await page.eval(f"{by_testid('acknowledge')}.hidden")


async def test_every_alarm_is_shown_until_it_has_ended_and_was_acknowledged(page: Page, daemon: FakeDaemon) -> None:
    daemon.muted.add(BUS_ALARMS)
    for case in CASES:
        case_daemon = daemon_with(case)

        def publish(case_daemon: Daemon = case_daemon) -> None:
            daemon.hub.publish(BUS_ALARMS, encode({"t_ns": case_daemon.clock.time_ns, "alarms": case_daemon.rows}))

        publish()
        tile = f"alarm-{case.identity}"
        await page.wait_for(shows(tile, case.title))
        assert await page.eval(f"{by_testid(tile)}.dataset.severity") == case.severity
        assert await page.eval(f"{by_testid(tile)}.classList.contains('ended')") is case.is_moment
        if case.ends:
            case.ends(case_daemon)
            publish()
        if case.is_latched:
            await page.wait_for(f"{by_testid(tile)}?.classList.contains('ended')")
            case_daemon.board.acknowledge(ME, None)
            publish()
        await page.wait_for(f"{by_testid(tile)} === null")


@pytest.mark.parametrize("late_s", [0.5, 1.0, 5.0])
async def test_outputs_that_are_late_in_an_alert_end_no_alarm(page: Page, daemon: FakeDaemon, late_s: float) -> None:
    """The value that would have ended it is struck out."""
    tile = "alarm-integrity_alert"
    await raise_alert(daemon, page)
    daemon.muted.add("/nav/clearance_integrity")
    end = asyncio.get_running_loop().time() + late_s
    while asyncio.get_running_loop().time() < end:
        assert await page.eval(lasts(tile, "GROUND CLEARANCE ALERT"))
        await asyncio.sleep(0.05)
    await page.wait_for(is_struck("integrity-state"))
    assert await page.eval(lasts(tile, "GROUND CLEARANCE ALERT"))


async def test_who_may_not_command_may_not_acknowledge(
    display: DisplayProcess, daemon: FakeDaemon, browser: Chromium
) -> None:
    daemon.change_integrity = make_alert
    page = await browser.open(display.url)
    await page.wait_for(lasts("alarm-integrity_alert", "GROUND CLEARANCE ALERT"))
    await page.wait_for(f"{by_testid('acknowledge')}.title === '{WITHOUT_KEY}'")
    assert await page.eval(f"{by_testid('acknowledge')}.disabled")


async def test_alarms_outlast_a_display(page: Page, daemon: FakeDaemon, display: DisplayProcess, chromium: str) -> None:
    await raise_alert(daemon, page)
    begun = await page.text("alarm-integrity_alert")
    other = DisplayProcess(daemon)
    try:
        async with Chromium(chromium) as browser:
            second = await browser.open(other.url)
            await second.wait_for(lasts("alarm-integrity_alert", begun[: begun.index("·")]))
    finally:
        other.close()


async def test_banner_and_alarms_stay_visible_on_a_small_screen(page: Page, daemon: FakeDaemon) -> None:
    await raise_alert(daemon, page)
    await page.resize(1000, 700)
    await page.eval("scrollTo(0, document.documentElement.scrollHeight)")
    await page.wait_for("scrollY > 300")
    for place in ("document.getElementById('banner')", by_testid("alarm-integrity_alert")):
        box = await page.eval(f"(({{top, bottom}}) => [top, bottom])({place}.getBoundingClientRect())")
        assert 0 <= box[0] < box[1] <= 700


async def test_the_tone_is_chosen_and_remembered(page: Page) -> None:
    assert await page.text("tone") == "TONE OFF"
    await page.eval(f"{by_testid('tone')}.click()")
    await page.wait_for("localStorage.getItem('fti-tone') === 'on'")
    await page.reload()
    await page.wait_for(f"{FRESH} && ({shows('tone', 'TONE: CLICK')} || {shows('tone', 'TONE ON')})")


def make_alert(fields: dict[str, Any]) -> dict[str, Any]:
    return fields | {"state": "alert", "reasons": ("obstacle",), "valid": False, "t4_ratio": 2.3}


async def test_a_mark_goes_up_and_comes_back_as_event_and_line(
    page: Page, daemon: FakeDaemon, display: DisplayProcess, tmp_path: Path
) -> None:
    await page.wait_for(f"{counts_marks('heights-plot')} === 0 && {counts_colours('heights-plot')} > 3000")
    await page.press("m")
    assert await page.eval(f"document.activeElement === {by_testid('mark-text')}")
    await page.type_text("approach 3 <b>")
    await page.press("Enter")
    assert await asyncio.to_thread(display.read_message) == mark("approach 3 <b>")
    await page.wait_for(shows("mark-answer", "marked"))
    assert await page.eval(f"{by_testid('mark-text')}.value === '' && document.activeElement === document.body")
    daemon.publish_event("info", "mark", "approach 3 <b>")
    await page.wait_for(shows("events", "approach 3 <b>"))
    for plot in ("heights-plot", "glide-plot"):
        await page.wait_for(f"{counts_marks(plot)} > 20")
    await page.screenshot(tmp_path / "mark.png")
    assert page.problems == []
    await page.eval(f"{by_testid('mark-button')}.click()")
    assert await asyncio.to_thread(display.read_message) == mark("mark")  # there may be no time for words
    await page.eval(f"for (let i = 0; i < 20; i += 1) {by_testid('mark-button')}.click()")
    await page.wait_for(shows("mark-answer", "more than 5 marks or commands per second"))


async def test_a_fallback_medium_and_a_snapshot_session_are_reported(
    page: Page, daemon: FakeDaemon, display: DisplayProcess
) -> None:
    assert await page.eval(f"{by_testid('mode')}.parentElement.hidden && {by_testid('snapshot-button')}.hidden")
    daemon.change_health = make_fallback_snapshot
    await page.wait_for(shows("alarm-storage_fallback", "RECORDING TO THE FALLBACK"))
    assert "/media/usb is full" in await page.text("alarm-storage_fallback")
    assert await page.text("mode") == "SNAPSHOT"
    assert await page.text("recording") == "WAITING"
    assert "gradient" in await page.eval(f"getComputedStyle({by_testid('mode')}.parentElement).backgroundImage")
    assert not await page.eval(f"{by_testid('mode')}.parentElement.hidden")
    for width, height in ((1440, 900), (1920, 1080)):
        await page.resize(width, height)
        assert await page.eval(CUT_OFF) == []
    await page.eval(f"{by_testid('snapshot-button')}.click()")
    assert await asyncio.to_thread(display.read_message) == mark("snapshot", is_trigger=True)
    await page.wait_for(shows("mark-answer", "triggered"))


def make_fallback_snapshot(health: dict[str, Any]) -> None:
    health["storage"].update(state="fallback", hint="/media/usb is full; recording to /data")
    health["session"].update(mode="snapshot", origin="flight")
    health["snapshot"] = {"state": "waiting", "held_s": 60.0, "held_mb": 3.1, "file": None}


def add_sinks(health: dict[str, Any]) -> None:
    health["sinks"] = make_sinks()


async def test_sinks_are_reported_with_their_failures_and_losses(
    page: Page, daemon: FakeDaemon, tmp_path: Path
) -> None:
    assert await page.eval("document.getElementById('sinks').hidden")
    daemon.change_health = add_sinks
    await page.wait_for(shows("sink-mqtt-state", "retrying"))
    assert await page.text("sink-mqtt-hint") == f"{make_sinks()['mqtt']['hint']}; 17 events lost"
    assert await page.eval(f"{by_testid('sink-foxglove-hint')}.parentElement.hidden")
    cells = f"[...{by_testid('sink-foxglove')}.querySelectorAll('td.number')].map((e) => e.textContent)"
    assert await page.eval(cells) == ["2", "41234", "0", "0"]
    assert await page.text("sink-foxglove-state") == "connected"
    assert "2 of 3 connected" in await page.eval("document.querySelector('#sinks h2').textContent")
    for width, height in SIZES:
        await page.resize(width, height)
        assert await page.eval(CUT_OFF) == []
        await page.wait_for(f"!{SMALL_TEXTS}.length")
        await page.screenshot(tmp_path / f"sinks_{width}.png")
    daemon.change_health = lambda health: None
    await page.wait_for("document.getElementById('sinks').hidden")


async def test_the_clock_of_each_device_is_reported_as_far_as_it_is_known(page: Page, daemon: FakeDaemon) -> None:
    assert await page.text("device-ins-gps-offset") == "\u2212213.46 ± 0.04 ms"
    assert await page.text("device-ins-gps-drift") == "+1.10 ± 0.02 ppm"
    assert await page.text("device-ins-gps-late") == "1.3 % late"
    assert await page.text("device-ins-gps-state") == ""
    daemon.change_health = make_clocks
    await page.wait_for(shows("device-ins-gps-state", "not used"))
    assert await page.text("device-air_data-utc-offset") == "+604800.250 s"
    assert await page.text("device-laser_altimeter-boot-offset") == "on at 09:31:07.125"
    for testid, words in (("gnss-utc", "does not fit: arrival time used"), ("laser_altimeter-utc", "learning")):
        assert words in await page.text(f"device-{testid}-state")
        assert await page.text(f"device-{testid}-offset") == ""
    assert "refused" in await page.eval(f"{by_testid('device-ins-gps-offset')}.closest('tr').title")
    for width, height in ((1440, 900), (1920, 1080)):
        await page.resize(width, height)
        assert await page.eval(CUT_OFF) == []
        assert await page.eval(SIDE_BY_SIDE)
    daemon.change_health = lambda health: health["devices"].pop("ins")["clocks"].clear()
    await page.wait_for("!document.querySelector('tr.clock')")  # it is the only device with one


#: The parts of a clock's line do not run into each other.
SIDE_BY_SIDE = """[...document.querySelectorAll('tr.clock div')].every((line) => {
    const boxes = [...line.children].filter((e) => e.textContent).map((e) => {
        const range = document.createRange();
        range.selectNodeContents(e);
        return range.getBoundingClientRect();
    });
    return boxes.every((box, i) => i === 0 || box.left >= boxes[i - 1].right || box.top >= boxes[i - 1].bottom - 2);
})"""


def make_clocks(health: dict[str, Any]) -> None:
    on_ms = 1_775_986_267_125.0  # 2026-04-12 09:31:07.125 UTC
    clocks = {
        "ins": [make_clock("gps", -9999.9, used=False)],
        "air_data": [make_clock("utc", 604_800_250.0)],
        "laser_altimeter": [make_clock("utc", 0.1, state="learning", offset_sd_ms=None), make_clock("boot", -on_ms)],
        "gnss": [make_clock("utc", 1.0, state="away")],
    }
    for name, known in clocks.items():
        health["devices"][name]["clocks"] = known


def mark(text: str, *, is_trigger: bool = False) -> dict[str, Any]:
    """The message of the display process for a mark."""
    return {"PageMark": {"text": text, "who": ME, "is_trigger": is_trigger}}


CATALOGUE = [
    {
        "name": "magnetometer",
        "driver": "hmr2300",
        "link": "mag_line",
        "transmit": True,
        "commands": {
            "set_rate": {
                "does": "set the rate of continuous output",
                "arguments": {
                    "rate": "messages a second: 10, 20, 25, 30, 40, 50, 60, 100, 123 or 154",
                    "format": "binary or ascii (default: binary)",
                },
                "answered": True,
            },
            "degauss": {"does": "set and reset the sensor's strap once", "arguments": {}, "answered": False},
        },
    },
    {
        "name": "deflection_pickups",
        "driver": "deflection_pickups",
        "link": "pickups_can",
        "transmit": True,
        "commands": {"store": {"does": "store the table", "arguments": {"surface": "its name"}, "answered": True}},
    },
]


def make_request(key: str, number: int, state: str, outcome: str, **more: Any) -> dict[str, Any]:
    ended = state not in ("sending", "waiting")
    what = f"{number}: magnetometer set_rate rate=50" if number else "magnetometer set_rate rate=7"
    fields: dict[str, Any] = {
        "id": key,
        "number": number,
        "title": what,
        "outcome": outcome,
        "state": state,
        "ended": ended,
    }
    fields |= {"device": "magnetometer", "command": "set_rate", "args": {}, "detail": ""}
    fields |= {"sent_ns": None, "answered_ns": None}
    return fields | {"t_ns": 1_775_986_267_000_000_000 + number, "who": "the page", "data": "2a303157450d"} | more


async def test_a_command_goes_down_once_and_its_end_comes_back(
    page: Page, display: DisplayProcess, tmp_path: Path
) -> None:
    assert await page.eval(f"{by_testid('commands-open')}.hidden")
    display.send("UsableDevices", devices=CATALOGUE)
    await page.wait_for(f"!{by_testid('commands-open')}.hidden")
    await page.eval(f"{by_testid('commands-open')}.click()")
    assert await page.eval("document.getElementById('links').hidden && !document.getElementById('commands').hidden")
    assert await page.text("commands-does") == "set the rate of continuous output"
    await page.eval(f"{by_testid('commands-argument-rate')}.focus()")
    await page.type_text("50")
    await page.eval(f"for (let i = 0; i < 5; i += 1) {by_testid('commands-send')}.click()")
    request_sent = await asyncio.to_thread(display.read_message)
    request = {"device": "magnetometer", "command": "set_rate", "args": {"rate": "50"}, "who": ME}
    assert request_sent["PageCommand"] == request | {"id": request_sent["PageCommand"]["id"]}
    assert await page.eval(f"{by_testid('commands-send')}.disabled")
    key = request_sent["PageCommand"]["id"]
    for number, (state, outcome) in enumerate(EARLIER, 1):
        display.send("CommandProgress", **make_request(f"k{number}", number, state, outcome))
    display.send("CommandProgress", **make_request(key, 7, "waiting", "waiting"))
    await page.wait_for(shows("commands-word", "waiting"))
    assert await page.eval(f"{by_testid('commands-send')}.disabled")
    display.send("CommandProgress", **make_request(key, 7, "acknowledged", "acknowledged after 34 ms"))
    await page.wait_for(f"!{by_testid('commands-send')}.disabled")
    assert await page.text("commands-word") == "acknowledged after 34 ms"
    states = "[...document.querySelectorAll('#commands li')].map((item) => item.dataset.state)"
    assert await page.eval(states) == ["acknowledged", *(state for state, _ in reversed(EARLIER))]
    for width, height in ((1440, 900), (1920, 1080)):
        await page.resize(width, height)
        assert await page.eval(CUT_OFF) == []
        await page.screenshot(tmp_path / f"commands_{width}.png")
    await page.resize(360, 640)
    widths = (
        "[...document.querySelectorAll('#commands :is(select, .arguments small, li span)')].map((e) => e.offsetWidth)"
    )
    assert min(await page.eval(widths)) >= 130
    await page.resize(1440, 900)
    await shows_what_the_chosen_command_takes(page, display)
    await page.eval(f"{by_testid('commands-close')}.click()")
    assert await page.text("link-gnss_line-state") == "absent"
    assert page.problems == []
    display.control.setblocking(False)
    with pytest.raises(BlockingIOError):  # however often it was clicked
        display.control.recv(1)


EARLIER = [
    ("denied", "denied: magnetometer: set_rate: rate = 7: must be one of 10, 20, 25, 30, 40, 50, 60, 100, 123, 154"),
    ("timed out", "timed out: no answer within 3 s; recorder was restarted meanwhile"),
    ("refused", "refused after 12 ms: WE OFF"),
    ("sent", "sent: the device does not acknowledge it"),
]


async def shows_what_the_chosen_command_takes(page: Page, display: DisplayProcess) -> None:
    await page.eval(choose("commands-name", "degauss"))
    assert await page.text("commands-does") == "set and reset the sensor's strap once (not acknowledged)"
    assert await page.eval("document.querySelectorAll('.arguments input').length") == 0
    await page.eval(choose("commands-device", "deflection_pickups"))
    assert await page.text("commands-does") == "store the table"
    await page.eval(f"{by_testid('commands-argument-surface')}.focus()")
    await page.press("m")
    assert await page.eval(f"{by_testid('commands-argument-surface')}.value") == "m"  # and no mark
    display.send("UsableDevices", devices=CATALOGUE)  # a repeated catalogue does not change the input
    display.send("CommandProgress", **make_request("k", 1, "waiting", "waiting"))
    await page.wait_for(shows("commands-answers", "waiting"))
    assert await page.eval(f"{by_testid('commands-argument-surface')}.value") == "m"
    await page.eval(f"{by_testid('commands-argument-surface')}.value = 'm'.repeat(2000)")
    await page.eval(f"{by_testid('commands-send')}.click()")
    await page.wait_for(shows("commands-word", "the command is too long"))


def choose(testid: str, value: str) -> str:
    return f"{by_testid(testid)}.value = '{value}', {by_testid(testid)}.dispatchEvent(new Event('change'))"


SHARED_HISTORY = """
(async () => {
  const { HistoryPlot } = await import("/plot.js");
  const history = { t: [1, 2, 3], series: { a: [1, 1, 1] } };
  const options = { series: [{ key: "a", color: "#fff" }], digits: 0, range: () => [0, 10] };
  const plots = [0, 1].map(() => new HistoryPlot(document.createElement("div"), options));
  for (const plot of plots) plot.load(history);
  for (const plot of plots) plot.add(3.5, [7]);
  return plots.map((plot) => plot.data.map((column) => column.at(-1)));
})()
"""


async def test_plots_of_one_history_go_on_each_by_itself(page: Page) -> None:
    assert await page.eval(SHARED_HISTORY) == [[3.5, 7], [3.5, 7]]


#: Four flat lines of a plot as one sees them without colours: height of the line, and number of its pieces in 300 px.
CURVES = """
(async () => {
  const [{ HistoryPlot }, { seriesOf }] = await Promise.all([import("/plot.js"), import("/heights.js")]);
  const place = document.createElement("div");
  place.style = "position: fixed; inset: 0 auto auto 0; width: 600px; height: 300px; z-index: 99";
  document.body.append(place);
  const series = seriesOf(["a", "b"]);
  const t = Array.from({ length: 600 }, (_, i) => i / 5);
  const plot = new HistoryPlot(place, { series, digits: 0, range: () => [0, 50] });
  plot.plot.setSize({ width: 600, height: 300 });
  plot.load({ t, series: Object.fromEntries(series.map(({ key }, i) => [key, t.map(() => 8 + 10 * i)])) });
  await new Promise((resolve) => setTimeout(resolve));
  const { ctx } = plot.plot;
  const isDrawn = (x, y) => ctx.getImageData(x, y, 1, 1).data[3] > 100 && ctx.getImageData(x, y, 1, 1).data[0] > 60;
  const curves = series.map((_, i) => {
    const y = Math.round(plot.plot.valToPos(8 + 10 * i, "y", true));
    const along = Array.from({ length: 300 }, (_, x) => isDrawn(150 + x, y));
    const column = 150 + along.indexOf(true);
    const width = Array.from({ length: 11 }, (_, dy) => isDrawn(column + 1, y - 5 + dy)).filter(Boolean).length;
    return [width, along.filter((on, x) => on && !along[x - 1]).length];
  });
  place.remove();
  return curves;
})()
"""


async def test_the_curves_of_the_heights_differ_without_their_colours(page: Page) -> None:
    raw_a, height_a, raw_b, height_b = await page.eval(CURVES)
    assert height_a[1] == 1, "one piece"
    assert height_b[1] > 5, "dashes"
    assert raw_a[1] > raw_b[1] + 10 > height_b[1] + 20, "dots, near and far"
    assert height_a[0] > height_b[0]
    names = [f"height-{name}_altimeter-{kind}" for name in ("laser", "radar") for kind in ("line", "raw-line")]
    paths = ", ".join(f"{by_testid(name)}.firstChild" for name in names)
    style = "[getComputedStyle(e).strokeDasharray, getComputedStyle(e).strokeWidth]"
    legend = await page.eval(f"[{paths}].map((e) => {style})")
    assert len({tuple(line) for line in legend}) == len(names)
    assert legend[0][0] == "none"
    assert "," in legend[2][0]


PDU = {
    "name": "pdu",
    "driver": "power_unit",
    "link": "pdu_line",
    "transmit": True,
    "commands": {"off": {"does": "switch a breaker off", "arguments": {"breaker": "which"}, "answered": True}},
}


async def test_the_laboratory_is_there_with_its_emulator_and_struck_out_without(
    page: Page, daemon: FakeDaemon, tmp_path: Path
) -> None:
    hidden = "document.getElementById('laboratory').hidden"
    assert await page.eval(hidden)
    daemon.breakers = {"radar_altimeter": "tripped"}
    await page.wait_for(f"!{hidden}")
    await page.wait_for(shows("breaker-radar_altimeter", "TRIPPED"))
    assert await page.text("laboratory-scenario") == "Fog over the threshold"
    assert await page.text("laboratory-faults") == "laser altimeter: fog, 75 m until 96 s"
    assert await page.text("laboratory-holds") == "held"
    assert await page.eval(f"{by_testid('breaker-gnss')}.disabled")  # nothing takes a command
    assert await page.eval(f"{by_testid('breaker-pdu')}.hidden")
    for width, height in ((1440, 900), (1920, 1080)):
        await page.resize(width, height)
        assert await page.eval("document.documentElement.scrollHeight") == height
        assert await page.eval(CUT_OFF) == []
        await page.screenshot(tmp_path / f"laboratory_{width}.png")
    daemon.breakers = None
    await page.wait_for(is_struck("laboratory-scenario"))
    assert "silent for" in await page.eval("document.querySelector('#laboratory h2').textContent")
    assert not await page.eval(hidden)
    assert page.problems == []


QUESTION = f"{by_testid('question')}.open"


async def test_a_breaker_asks_and_is_switched_once_and_a_refusal_is_reported(
    page: Page, daemon: FakeDaemon, display: DisplayProcess
) -> None:
    daemon.breakers = {"radar_altimeter": "tripped"}
    display.send("UsableDevices", devices=[PDU])
    button = by_testid("breaker-radar_altimeter")
    await page.wait_for(f"{button} && !{button}.disabled")
    await page.eval(f"for (let i = 0; i < 3; i += 1) {button}.click()")
    assert await page.text("question-title") == "Reset tripped breaker radar altimeter?"
    await page.eval(f"for (let i = 0; i < 3; i += 1) {by_testid('question-yes')}.click()")
    request_sent = (await asyncio.to_thread(display.read_message))["PageCommand"]
    assert request_sent == {
        "device": "pdu",
        "command": "reset",
        "args": {"breaker": "radar_altimeter"},
        "id": request_sent["id"],
        "who": ME,
    }
    await page.wait_for(f"{button}.disabled && !{QUESTION}")
    refused = make_request(request_sent["id"], 1, "refused", "refused after 2 ms: it is hot", args=request_sent["args"])
    display.send("CommandProgress", **refused)
    await page.wait_for(shows("laboratory-said", "radar altimeter: refused after 2 ms: it is hot"))
    await page.wait_for(f"!{button}.disabled")
    await page.eval(f"{by_testid('breaker-gnss')}.focus()")
    for key in ("Enter", "Tab", "Enter"):  # the question begins on CANCEL
        await page.press(key)
    request_sent = (await asyncio.to_thread(display.read_message))["PageCommand"]
    assert (request_sent["command"], request_sent["args"]) == ("off", {"breaker": "gnss"})


async def test_a_breaker_is_not_switched_without_consent_or_when_its_state_has_changed(
    page: Page, daemon: FakeDaemon, display: DisplayProcess
) -> None:
    daemon.breakers = {}
    display.send("UsableDevices", devices=[PDU])
    button = by_testid("breaker-radar_altimeter")
    await page.wait_for(f"{button} && !{button}.disabled")
    for answer in ("Enter", "Escape"):
        await page.eval(f"{button}.focus()")
        await page.press("Enter")
        await page.wait_for(QUESTION)
        assert await page.text("question-title") == "Switch off breaker radar altimeter?"
        await page.press("m")  # keys wait for the answer
        assert await page.eval(f"document.activeElement === {by_testid('question-no')}")
        await page.press(answer)
        await page.wait_for(f"!{QUESTION} && document.activeElement === {button}")
    await page.press("Enter")
    await page.wait_for(QUESTION)
    daemon.breakers = {"radar_altimeter": "tripped"}
    await page.wait_for(f"!{QUESTION}")
    await page.eval(f"{button}.click()")
    await page.wait_for(QUESTION)
    display.process.send_signal(signal.SIGSTOP)
    await page.wait_for(f"!{QUESTION} && document.body.classList.contains('disconnected')")
    display.process.send_signal(signal.SIGCONT)
    await page.wait_for(FRESH)
    display.control.setblocking(False)
    with pytest.raises(BlockingIOError):
        display.control.recv(1)


FOCUSED = "document.activeElement.dataset.testid ?? document.activeElement.tagName"


async def test_tab_begins_with_the_alarms_and_ends_with_the_breakers(
    page: Page, daemon: FakeDaemon, display: DisplayProcess
) -> None:
    daemon.breakers = {}
    display.send("UsableDevices", devices=[*CATALOGUE, PDU])
    await raise_alert(daemon, page)
    await page.wait_for(f"!{by_testid('commands-open')}.hidden && {by_testid('breaker-gnss')}?.disabled === false")
    order: list[str] = []
    while len(order) < 30 and (not order or order[-1] != "BODY"):
        await page.press("Tab")
        order.append(await page.eval(FOCUSED))
        outline = "getComputedStyle(document.activeElement).outlineStyle"
        assert order[-1] == "BODY" or await page.eval(outline) == "solid", order
    controls = ["alarm-integrity_alert", "alarm-more", "acknowledge", "tone", "keys-open"]
    assert order[: len(controls)] == controls
    rest = [name for name in order if name.startswith(("commands", "mark", "breaker"))]
    assert rest[:3] == ["commands-open", "mark-text", "mark-button"]
    assert all(name.startswith("breaker-") for name in rest[3:])
    assert len(rest) == 9


async def test_keys_open_and_close_and_do_nothing_while_one_types(
    page: Page, daemon: FakeDaemon, display: DisplayProcess
) -> None:
    listed = f"{by_testid('keys')}.open"
    await page.press("c")  # no device takes commands
    assert await page.eval("document.getElementById('commands').hidden")
    display.send("UsableDevices", devices=CATALOGUE)
    await raise_alert(daemon, page)
    await page.wait_for(f"!{by_testid('commands-open')}.hidden")
    await page.press("?")
    assert await page.eval(listed)
    keys = "[...document.querySelectorAll('kbd')].map((e) => e.textContent)"
    assert set(await page.eval(keys)) == {"?", "Esc", "a", "m", "c"}
    await page.press("a")  # the list is open
    for key in ("?", "?", "Escape"):
        await page.press(key)
    assert not await page.eval(listed)
    await page.press("c")
    assert await page.eval(f"document.activeElement === {by_testid('commands-device')}")
    await page.press("c")  # it is typed
    assert await page.eval("document.getElementById('links').hidden")
    await page.press("Escape")
    assert await page.eval("document.getElementById('commands').hidden && !document.getElementById('links').hidden")
    await page.eval(f"{by_testid('alarm-more')}.click()")
    await page.press("m")
    for key in "acm?":
        await page.press(key)
    assert await page.eval(f"{by_testid('mark-text')}.value") == "acm?"
    await page.press("Escape")
    assert await page.eval("document.activeElement === document.body")
    assert not await page.eval(f"{by_testid('alarm-list')}.hidden")  # it leaves the field only
    await page.press("Escape")
    assert await page.eval(f"{by_testid('alarm-list')}.hidden")
    await page.press("a")
    assert await asyncio.to_thread(display.read_message) == {"PageAcknowledgement": {"alarm_id": None, "who": ME}}


async def test_the_field_of_a_mark_comes_to_a_small_screen(page: Page, display: DisplayProcess) -> None:
    await page.resize(1024, 768)
    await page.press("m")
    box = await page.eval(f"{by_testid('mark-text')}.getBoundingClientRect().toJSON()")
    assert 0 < box["top"] < box["bottom"] < 768
    await page.press("Enter")
    assert await asyncio.to_thread(display.read_message) == mark("mark")
    await page.wait_for(shows("mark-answer", "marked"))
    assert await page.eval("scrollY") == 0
    await page.wait_for("!document.querySelector('.mark.called')")
