"""Which alarms follow from the flags of a fault, and which flags explain an alarm."""

from __future__ import annotations

import pytest

from fti.hil import scenario as scenarios
from fti.hil.expected.aircraft import Aircraft
from fti.hil.expected.alarm_flags import ORIGINS, alarms_of_flags, explaining
from fti.hil.expected.duties import Duty, May, Told
from fti.service.binding import bind_devices
from tests.helpers import ROOT


@pytest.fixture(scope="module")
def craft() -> Aircraft:
    scenario = scenarios.load(scenarios.find("nominal"))
    config = scenarios.load_config(scenario)
    return Aircraft(config, bind_devices(config), scenario)


def due(craft: Aircraft, place: str, *words: str, until_s: float = 60.0) -> list[tuple[tuple[str, ...], float]]:
    """The alarms of a flag that is due from 20 s on within 1 s, and within what time each is."""
    told = Told("subject", (Duty(place, words, 20.0, until_s, 1.0, 2.0),), ())
    return [(duty.words, duty.within_s) for _, one in alarms_of_flags([(0, told)], craft) for duty in one.duties]


@pytest.mark.parametrize(
    ("place", "words", "alarm", "within_s"),
    [
        ("/fti/health/devices/ins", ("silent", "noise"), "device:ins", 2.0),
        ("/fti/health/devices/ins", ("wrong rate",), "device:ins", 7.0),
        ("/fti/health/links/can0", ("silent",), "link:can0", 2.0),
        ("/nav/height_above_ground/altimeter", ("deviation",), "altimeter:altimeter", 2.5),
        ("/nav/clearance_integrity", ("obstacle",), "integrity_alert", 2.0),
        ("/nav/nav_solution", ("position not from ins",), "position", 2.0),
    ],
)
def test_a_flag_that_a_person_must_know_has_an_alarm(
    craft: Aircraft, place: str, words: tuple[str, ...], alarm: str, within_s: float
) -> None:
    ((alarms, allowed_s),) = due(craft, place, *words)
    assert alarm in alarms
    assert allowed_s == pytest.approx(within_s)


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("/fti/health/devices/ins", ("damaged bytes",)),
        ("/fti/health/devices/ins", ("clock away",)),
        ("/nav/height_above_ground/altimeter", ("device_flag", "no_return")),  # no return: out of its range
        ("/nav/height_above_ground/altimeter", ("stale",)),  # the device is silent
        ("/nav/nav_solution", ("position not from gnss",)),  # it is not the first one
        ("/fti/ledger/can0", ("slcan_bus_error",)),
    ],
)
def test_other_flags_have_none(craft: Aircraft, place: str, words: tuple[str, ...]) -> None:
    assert due(craft, place, *words) == []


def test_a_fault_that_is_too_short_for_the_alarm_has_none(craft: Aircraft) -> None:
    place = "/fti/health/devices/ins"
    assert due(craft, place, "wrong rate", until_s=28.0)
    assert due(craft, place, "wrong rate", until_s=26.0) == []


@pytest.mark.parametrize(
    ("alarm", "place", "explains"),
    [
        ("device:ins", "/fti/health/devices/ins", True),
        ("device:ins", "/fti/health/devices/gnss", False),
        ("device:ins", "/fti/health/devices", True),  # of all devices
        ("height", "/nav/height_above_ground/altimeter", True),  # of one of those on which it rests
        ("integrity_alert", "/nav/clearance_integrity", True),
        ("integrity_alert", "/nav/nav_solution", False),
        ("recorder", "/fti/health", False),
        ("recorder", "", True),  # the emulator was late
    ],
)
def test_flags_explain_their_alarm_and_no_other(craft: Aircraft, alarm: str, place: str, explains: bool) -> None:
    assert bool(explaining(alarm, [May(place, 20.0, 30.0, ("silent",))], craft)) is explains


@pytest.mark.parametrize(
    ("alarm", "place", "until_s"),
    [
        ("device:ins", "/fti/health/devices/ins", 31.0),
        ("altimeter:radar", "/nav/height_above_ground/radar", 44.0),  # the agreement that ends a refusal
        ("integrity_alert", "/nav/clearance_integrity", 32.0 + 2 * 400.0 / 35.0),  # another window of 400 m is full
    ],
)
def test_an_alarm_may_last_until_its_subject_is_judged_again(
    craft: Aircraft, alarm: str, place: str, until_s: float
) -> None:
    (one,) = explaining(alarm, [May(place, 20.0, 30.0)], craft)
    assert (one.from_s, one.until_s) == pytest.approx((20.0, until_s))


def test_every_alarm_of_the_page_about_alarms_is_explained_or_by_no_fault_of_a_sensor() -> None:
    """The page has each identity once; what is not explained is of the daemon and its computer."""
    page = (ROOT / "docs" / "alarms.md").read_text()
    rows = [line.split("|")[2] for line in page.split("## Conditions")[1].splitlines() if line.startswith("| ")]
    names = {part.strip(" `").partition(":")[0] for row in rows[1:] for part in row.split(",")}
    assert names - set(ORIGINS) == {
        *("terrain", "terrain_loading", "recording", "storage_...", "space", "navigation", "navigation_starting"),
        *("navigation_late", "clock_step", "recorder", "process"),
    }
