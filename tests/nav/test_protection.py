"""Protection levels of positions of devices, and devices that the filter contradicts."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace
from scipy.stats import norm, rayleigh

from fti.config import AlertLimits
from fti.geodesy.wgs84 import radii
from fti.messages.reasons import Reason
from fti.nav.attitude_protection import AttitudeLevels
from fti.nav.navigation import NavState, solution
from fti.nav.protection import (
    K_AXIS,
    K_RADIAL,
    FilterReference,
    Protection,
    compare_with_filter,
    differences,
    extrapolate_levels,
    is_beyond,
    stated_levels,
)
from fti.nav.separation.protection import K_MD_AXIS, K_MD_RADIAL
from fti.nav.source_check import SourceCheck
from fti.nav.source_interpolation import AttitudeState, PositionState

SECOND = 1_000_000_000
HERE = PositionState(0.8, 0.2, 700.0, 1.0, 2.0, 50.0, 0.0, 0.0, 0)
MERIDIAN, NORMAL = (float(r) for r in radii(0.8))
FILTER = FilterReference(HERE, 15.0, 20.0)
ASSUMED = {"ins": (5.0, 10.0)}


def moved(north: float, east: float = 0.0, up: float = 0.0) -> PositionState:
    lat = HERE.lat + north / MERIDIAN
    lon = HERE.lon + east / (NORMAL * math.cos(HERE.lat))
    return replace(HERE, lat=lat, lon=lon, alt=700.0 + up)


def test_factors_are_quantiles() -> None:
    """1e-5 on one axis and radially; 1e-3 of a source that is wrong already, on one side and radially."""
    assert pytest.approx(norm.isf(0.5e-5), abs=0.01) == K_AXIS
    assert pytest.approx(rayleigh.isf(1e-5), abs=0.01) == K_RADIAL
    assert pytest.approx(norm.isf(1e-3), abs=0.01) == K_MD_AXIS
    assert pytest.approx(rayleigh.isf(1e-3), abs=0.01) == K_MD_RADIAL


def test_differences_are_in_metres_and_across_the_date_line() -> None:
    assert differences(moved(30.0, 40.0, -7.0), HERE) == pytest.approx((50.0, 7.0), rel=1e-6)
    west, east = replace(HERE, lon=math.pi - 1e-6), replace(HERE, lon=-math.pi + 1e-6)
    assert differences(east, west)[0] == pytest.approx(2e-6 * NORMAL * math.cos(0.8), rel=1e-6)


def test_a_device_beside_the_filter_is_as_good_as_the_filter_and_the_difference() -> None:
    """Whatever sigma it states: 40 m away from a filter that holds 15 m it may be wrong by 55 m."""
    liar = replace(moved(40.0, up=-5.0), horizontal_sd=0.1, vertical_sd=0.1)
    protection = compare_with_filter(liar, FILTER)
    assert protection[:2] == pytest.approx((55.0, 25.0), rel=1e-6)
    assert protection[2:] == ((), False)
    assert compare_with_filter(replace(liar, alt=None), FILTER).vertical is None


def test_a_fix_that_steps_back_counts_at_once_and_flight_does_not() -> None:
    """50 m/s north for 0.2 s: 10 m on are the flight; the same place again is 10 m off, by how much it is higher."""
    level = Protection(15.0, 20.0)
    assert extrapolate_levels(level, HERE, moved(10.0), 0.2)[:2] == pytest.approx((15.0, 20.0), abs=1e-3)
    assert extrapolate_levels(level, HERE, moved(0.0), 0.2)[:2] == pytest.approx((25.0, 20.0), abs=1e-3)
    assert extrapolate_levels(level, HERE, moved(10.0, 3.0, 2.0), 0.2)[:2] == pytest.approx((18.0, 22.0), abs=1e-3)
    pole = replace(HERE, lat=math.pi / 2.0)
    assert extrapolate_levels(level, pole, pole, 0.0)[:2] == pytest.approx((15.0, 20.0))
    alone = stated_levels(HERE, (5.0, 10.0))
    assert extrapolate_levels(alone, HERE, moved(0.0), 0.2) == alone
    assert extrapolate_levels(Protection(15.0, None), HERE, moved(10.0, up=9.0), 0.2).vertical is None


def test_alone_it_has_the_level_of_its_own_sigma_or_of_its_kind() -> None:
    stated = stated_levels(HERE, (5.0, 10.0))
    assert stated[:2] == pytest.approx((4.8, 8.84))
    assert stated[2:] == ((Reason.NOTHING_TO_COMPARE,), False)
    for sd in (None, 0.0, -1.0, math.inf, math.nan):
        protection = stated_levels(replace(HERE, horizontal_sd=sd, vertical_sd=sd), (5.0, 10.0))
        assert protection[:2] == pytest.approx((24.0, 44.2))
        assert protection[2:] == ((Reason.NOTHING_TO_COMPARE,), True)


def test_alert_limits_are_of_levels_that_are_known() -> None:
    limits = AlertLimits()
    assert not is_beyond(Protection(200.0, 30.0), limits)
    assert is_beyond(Protection(200.1, 1.0), limits)
    assert is_beyond(Protection(1.0, 30.1), limits)
    assert not is_beyond(Protection(24.0, 44.2, (Reason.NOTHING_TO_COMPARE,), assumed=True), limits)
    assert not is_beyond(Protection(None, None), limits)


@pytest.mark.parametrize("why", [Reason.NOTHING_TO_COMPARE, Reason.REACQUIRED])
def test_a_configuration_can_demand_that_positions_are_compared(why: Reason) -> None:
    state = NavState(0, AttitudeState(0.0, 0.0, 0.0, None, None), HERE, "ins", "ins", "ins")
    alone = Protection(5.0, 5.0, (why,))
    tilted = AttitudeLevels(0.001, 0.01)
    outputs = {
        demand: solution(state, alone, tilted, AlertLimits(compared=demand), frozenset()) for demand in (False, True)
    }
    assert outputs[False].valid
    assert outputs[True].valid is (why is not Reason.NOTHING_TO_COMPARE)
    assert outputs[True].reasons == ((why,) if why is Reason.NOTHING_TO_COMPARE else ())


def test_a_device_that_the_filter_contradicts_is_refused_after_two_seconds() -> None:
    check, events = SourceCheck(ASSUMED), []
    for second in range(5):
        events += check.update(second * SECOND, {"ins": moved(100.0 if second >= 1 else 0.0)}, FILTER)
    assert check.refused == {"ins"}
    assert [event.t_ns for event in events] == [3 * SECOND]
    assert "ins: refused: 100 m from the filter" in events[0].text


def test_what_both_may_err_by_is_no_contradiction() -> None:
    check = SourceCheck(ASSUMED)
    inside = 15.0 + 4.80 * 1.0 - 0.5
    for second in range(10):
        assert check.update(second * SECOND, {"ins": moved(inside)}, FILTER) == []
    assert check.refused == frozenset()


def test_it_is_used_again_after_30_s_where_the_filter_would_see_the_same_again() -> None:
    check, uncertain = SourceCheck(ASSUMED), FilterReference(HERE, 60.0, 20.0)
    for second in range(10):
        check.update(second * SECOND, {"ins": moved(100.0)}, FILTER)
    for second in range(10, 60):  # it agrees with a filter that 100 m could not contradict
        assert check.update(second * SECOND, {"ins": HERE}, uncertain) == []
    assert check.refused == {"ins"}
    events = check.update(60 * SECOND, {"ins": HERE}, FILTER)
    assert check.refused == frozenset()
    assert "agrees" in events[0].text


def test_the_operator_ends_a_difference_that_is_too_small_to_resolve() -> None:
    """25 m beside levels of 15 and 20 m: agreement never ended it, and neither did 'fti readmit'."""
    check = SourceCheck(ASSUMED)
    for second in range(5):
        check.update(second * SECOND, {"ins": moved(25.0)}, FILTER)
    for second in range(5, 600):
        assert check.update(second * SECOND, {"ins": HERE}, FILTER) == []
    assert check.refused == {"ins"}
    (event,) = check.readmit("ins", 600 * SECOND)
    assert "ins: is used again" in event.text
    assert check.refused == frozenset()
    assert check.readmit("ins", 601 * SECOND) == []
    for second in range(601, 605):
        check.update(second * SECOND, {"ins": moved(25.0)}, FILTER)
    assert check.refused == {"ins"}, "one that goes on contradicting is refused again"


def test_a_wrong_altitude_alone_is_a_contradiction() -> None:
    check = SourceCheck(ASSUMED)
    for second in range(5):
        check.update(second * SECOND, {"ins": moved(0.0, up=47.0)}, FILTER)
    assert check.refused == {"ins"}
    for second in range(5):
        check.update(second * SECOND, {"ins": replace(HERE, alt=None)}, FILTER)
    assert check.refused == {"ins"}
