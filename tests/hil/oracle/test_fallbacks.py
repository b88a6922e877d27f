"""Who must take the place of the devices that have the position, and from when on."""

from __future__ import annotations

import pytest

from fti.config import Config
from fti.devices import bind_devices
from fti.hil import scenario as scenarios
from fti.hil.oracle.fallbacks import fallback_flags
from fti.hil.oracle.roles import AircraftRoles
from fti.hil.scenario import Scenario

SOLUTION, EVENT = "/nav/nav_solution", "/fti/event/nav"
OUTAGE = {"kind": "gnss_outage", "devices": ("receiver",), "from_s": 20.0, "to_s": 40.0}
CUT = {"kind": "cut", "devices": ("ins",), "from_s": 25.0, "to_s": 30.0}
Due = tuple[int, str, float, float]


@pytest.fixture(scope="module")
def config() -> Config:
    return scenarios.load_config(scenarios.load(scenarios.find("fallbacks")))


def due(config: Config, *faults: dict[str, object]) -> list[Due]:
    """Fault, words at the solution, from and until."""
    flight = Scenario.model_validate({"title": "x", "description": "x", "config": "x", "fault": faults})
    rows = fallback_flags(flight.fault, AircraftRoles(config, bind_devices(config), flight))
    expected_flags = [(i, expected_flag) for i, one in rows for expected_flag in one.expected_flags]
    assert [expected_flag.place for _, expected_flag in expected_flags] == [SOLUTION, EVENT] * (
        len(expected_flags) // 2
    )
    return [
        (i, " or ".join(expected_flag.words), expected_flag.from_s, expected_flag.until_s)
        for i, expected_flag in expected_flags
        if expected_flag.place == SOLUTION
    ]


def without(config: Config, **tables: object) -> Config:
    return config.model_copy(update={"nav": config.nav.model_copy(update=tables)})


def test_the_filter_takes_the_place_of_a_receiver(config: Config) -> None:
    assert due(config, OUTAGE) == [(0, "position from filter", 20.0, 40.0)]


def test_radio_takes_over_when_the_inertial_unit_goes_and_keeps_it_until_the_satellites_are_back(
    config: Config,
) -> None:
    expected_flags = [(0, "position from filter", 20.0, 25.0), (1, "position from radio", 25.0, 40.0)]
    assert due(config, OUTAGE, CUT) == expected_flags


def test_radio_takes_over_at_once_where_the_inertial_unit_went_before(config: Config) -> None:
    before = {**CUT, "from_s": 15.0, "to_s": 45.0}
    assert due(config, OUTAGE, before) == [(0, "position from radio", 20.0, 40.0)]


def test_without_a_filter_radio_is_the_first(config: Config) -> None:
    assert due(without(config, filter=None), OUTAGE) == [(0, "position from radio", 20.0, 40.0)]


def test_nothing_takes_over_where_nothing_is_configured(config: Config) -> None:
    assert due(without(config, filter=None, radio=None), OUTAGE) == []


def test_nothing_takes_over_while_another_device_has_the_position(config: Config) -> None:
    two = without(config, position=("receiver", "ahrs"))
    assert due(two, OUTAGE) == []
    lost = {"kind": "cut", "devices": ("ahrs",), "from_s": 30.0, "to_s": 33.0}
    assert due(two, OUTAGE, lost) == [(1, "position from filter", 30.0, 33.0)]


def test_a_cut_inertial_unit_alone_takes_no_position_away(config: Config) -> None:
    assert due(config, CUT) == []


def test_an_outage_that_ends_before_it_is_noticed_has_no_expected_flag(config: Config) -> None:
    assert due(config, {**OUTAGE, "to_s": 20.4}) == []
