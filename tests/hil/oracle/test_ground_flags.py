"""What known ground must say of an altimeter that is wrong, and of a place that is another one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fti.devices import bind_devices
from fti.hil import scenario as scenarios
from fti.hil.oracle.fault_flags import flags_of_fault
from fti.hil.oracle.flag_definitions import FaultFlags
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.hil.tables.fault_types import Bias, Fog, Forced, GnssDegraded, GnssOffset, Noise, Ramp, Stuck, WrongUnit

T = np.arange(0.0, 60.0, 0.1)
LEVEL = TruthSeries(T, 0 * T + 200.0, 4000.0 - 50.0 * T, *[0 * T] * 4)
RADIO, LASER = "/nav/height_above_ground/altimeter", "/nav/height_above_ground/autopilot"
WHEN: dict[str, Any] = {"from_s": 20.0, "to_s": 40.0}
OF_LASER: dict[str, Any] = {"devices": ("autopilot",), "quantity": "range.slant_range", **WHEN}
UNMONITORED, SMALL = "no monitor compares", "not wrong by more than"


def craft_of(name: str) -> AircraftRoles:
    scenario = scenarios.load(scenarios.find(name))
    config = scenarios.load_config(scenario)
    return AircraftRoles(config, bind_devices(config), scenario)


@pytest.fixture(scope="module")
def craft() -> AircraftRoles:
    return craft_of("nominal")


def due(flags: list[FaultFlags]) -> list[tuple[str, tuple[str, ...], float, float]]:
    """Place, words, and from when until when [s], to a tenth."""
    return [(d.place, d.words, round(d.from_s, 1), round(d.until_s, 1)) for one in flags for d in one.expected_flags]


@pytest.mark.parametrize(
    ("fault", "from_s"),
    [
        (Bias(kind="bias", value=50.0, **OF_LASER), 20.0),
        (Ramp(kind="ramp", rate=-6.0, **OF_LASER), 25.1),  # 30 m after 5 s
        (WrongUnit(kind="wrong_unit", factor=0.3048, **OF_LASER), 20.0),
        (Forced(kind="forced", value=40.0, **OF_LASER), 20.0),
        (Noise(kind="noise", sd=50.0, **OF_LASER), 20.0),
        (Fog(kind="fog", devices=("autopilot",), visibility_m=20.0, echo_m=(75.0, 5.0), **WHEN), 20.0),
    ],
    ids=lambda value: getattr(value, "kind", None),
)
def test_a_wrong_range_must_be_seen(craft: AircraftRoles, fault: Any, from_s: float) -> None:
    assert due(flags_of_fault(fault, craft, LEVEL)) == [(LASER, ("deviation",), from_s, 39.9)]


def test_a_stuck_altimeter_must_be_seen_by_the_climb_where_the_ground_is_not_known() -> None:
    """10 m and a fifth of 220 m, at 2 m/s; over known ground the range tells it, too, and its deviation before."""
    climbing = replace(LEVEL, height_agl=200.1 + 2.0 * T, climb=0 * T + 2.0)
    fault = Stuck(kind="stuck", devices=("altimeter",), from_s=10.0, to_s=50.0)
    known, unknown = craft_of("nominal"), craft_of("nominal")
    unknown.has_terrain = False
    assert due(flags_of_fault(fault, unknown, climbing)) == [(RADIO, ("stuck",), 37.1, 49.9)]
    assert due(flags_of_fault(fault, known, climbing)) == [
        (RADIO, ("stuck",), 37.1, 49.9),
        (RADIO, ("deviation",), 25.1, 49.9),
    ]
    assert due(flags_of_fault(fault, unknown, LEVEL)) == []


def test_it_must_be_gone_a_second_and_a_message_after_the_fault(craft: AircraftRoles) -> None:
    """However long it stood, and however early the fault was no longer to be seen."""
    low = replace(LEVEL, height_agl=np.where(T < 30.0, 200.0, 50.0))
    for truth in (LEVEL, low):
        (one,) = flags_of_fault(Forced(kind="forced", value=40.0, **OF_LASER), craft, truth)
        (expected_flag,) = one.expected_flags
        assert expected_flag.until_s + expected_flag.clears_s == pytest.approx(
            WHEN["to_s"] + 1.0 + craft.period_s(expected_flag.place.rpartition("/")[2])
        )


@pytest.mark.parametrize(
    ("fault", "unknown"),
    [
        (Bias(kind="bias", value=20.0, **OF_LASER), SMALL),
        (Bias(kind="bias", value=150.0, **OF_LASER), SMALL),  # beyond the range of the device: another flag
        (Forced(kind="forced", value=190.0, **OF_LASER), SMALL),
        (Bias(kind="bias", devices=("ahrs",), quantity="attitude.roll", value=0.5, **WHEN), UNMONITORED),
    ],
)
def test_what_is_little_or_is_compared_with_nothing_is_not_due(craft: AircraftRoles, fault: Any, unknown: str) -> None:
    (one,) = flags_of_fault(fault, craft, LEVEL)
    assert one.expected_flags == ()
    assert unknown in one.unknown


def test_without_known_ground_nobody_knows() -> None:
    wrong = Bias(kind="bias", value=50.0, **{**OF_LASER, "devices": ("laser",)})
    (one,) = flags_of_fault(wrong, craft_of("gauntlet_serial"), LEVEL)
    assert one.expected_flags == ()
    assert UNMONITORED in one.unknown


def test_the_range_of_the_beam_counts_where_the_truth_has_it(craft: AircraftRoles) -> None:
    """Banked over a slope the beam is 70 m longer than the aircraft is high."""
    beam = 0 * T + 270.0
    banked = replace(LEVEL, ranges={"autopilot": (beam, beam, beam)})
    assert flags_of_fault(Forced(kind="forced", value=200.0, **OF_LASER), craft, LEVEL)[0].expected_flags == ()
    assert due(flags_of_fault(Forced(kind="forced", value=200.0, **OF_LASER), craft, banked)) == [
        (LASER, ("deviation",), 20.0, 39.9)
    ]


def test_a_place_that_is_drawn_up_is_seen_by_the_altimeter_where_it_counts(craft: AircraftRoles) -> None:
    drawn = GnssOffset(kind="gnss_offset", devices=("receiver",), up_m=60.0, north_m=100.0, over_s=10.0, **WHEN)
    above, alone = replace(LEVEL, offset=0 * T), craft_of("fallbacks")
    alone.filter_gnss = ()
    assert due(flags_of_fault(drawn, alone, above)) == [(RADIO, ("deviation",), 25.1, 39.9)]
    (unused,) = flags_of_fault(
        drawn.model_copy(update={"devices": ("gnss",)}), craft, LEVEL
    )  # the inertial system is preferred
    assert unused.expected_flags == ()
    assert "position offset" in unused.unknown


def test_a_receiver_that_aids_the_filter_and_is_drawn_away_is_refused() -> None:
    drawn = GnssOffset(kind="gnss_offset", devices=("receiver",), north_m=100.0, over_s=10.0, **WHEN)
    (one,) = flags_of_fault(drawn, craft_of("fallbacks"), LEVEL)
    assert due([one]) == [("/nav/nav_solution", ("position not from receiver",), 20.0, 40.0)]
    slow = drawn.model_copy(update={"over_s": 60.0})
    assert flags_of_fault(slow, craft_of("fallbacks"), LEVEL)[0].expected_flags == ()


def test_a_receiver_reports_its_accuracy_and_others_cannot(craft: AircraftRoles) -> None:
    worse = GnssDegraded(kind="gnss_degraded", horizontal_m=5.0, vertical_m=7.0, **WHEN)
    found = {one.subject: one for one in flags_of_fault(worse, craft, LEVEL)}
    assert {(d.place, d.value) for d in found["gnss"].expected_flags} == {
        ("/gnss/position.horizontal_sd", 5.0),
        ("/gnss/position.vertical_sd", 7.0),
    }
    assert {name for name, one in found.items() if one.unknown} == {"ins", "ahrs"}
