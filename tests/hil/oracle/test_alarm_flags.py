"""Which alarms follow from the flags of a fault."""

from __future__ import annotations

import pytest

from fti.devices import bind_devices
from fti.hil import scenario as scenarios
from fti.hil.oracle.alarm_flags import flags_of_alarms
from fti.hil.oracle.flag_definitions import ExpectedFlag, FaultFlags
from fti.hil.oracle.roles import AircraftRoles


@pytest.fixture(scope="module")
def craft() -> AircraftRoles:
    scenario = scenarios.load(scenarios.find("nominal"))
    config = scenarios.load_config(scenario)
    return AircraftRoles(config, bind_devices(config), scenario)


def due(craft: AircraftRoles, place: str, *words: str, until_s: float = 60.0) -> list[tuple[tuple[str, ...], float]]:
    """The alarms of a flag that is due from 20 s on within 1 s, and within what time each is."""
    flags = FaultFlags("subject", (ExpectedFlag(place, words, 20.0, until_s, 1.0, 2.0),), ())
    return [
        (expected_flag.words, expected_flag.within_s)
        for _, one in flags_of_alarms([(0, flags)], craft)
        for expected_flag in one.expected_flags
    ]


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
    craft: AircraftRoles, place: str, words: tuple[str, ...], alarm: str, within_s: float
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
def test_other_flags_have_none(craft: AircraftRoles, place: str, words: tuple[str, ...]) -> None:
    assert due(craft, place, *words) == []


def test_a_fault_that_is_too_short_for_the_alarm_has_none(craft: AircraftRoles) -> None:
    place = "/fti/health/devices/ins"
    assert due(craft, place, "wrong rate", until_s=28.0)
    assert due(craft, place, "wrong rate", until_s=26.0) == []


def test_a_fault_from_the_start_on_has_none(craft: AircraftRoles) -> None:
    """A device that was never good is expected for 10 s, and a position that was never valid was not lost."""
    flags = FaultFlags("ins", (ExpectedFlag("/nav/nav_solution", ("position not from ins",), 5.0, 60.0, 1.0, 2.0),), ())
    assert list(flags_of_alarms([(0, flags)], craft)) == []
