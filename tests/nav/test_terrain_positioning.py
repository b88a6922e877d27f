"""Position from the ground in the live filter: flights over known ground whose sensors are drawn by the study's code.

The truth is the flight; the ground of the truth is that of the map unless a test displaces it.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.messages.reasons import Reason
from fti.nav import terrain_positioning
from fti.study.ground_flights import GroundCase, GroundRun, Satellites, fly
from fti.terrain.dem_error import DemError

SEED, NUMBER = 3, 4
OUTAGE = (Satellites(40.0, 160.0, None),)


def run(**changes: object) -> GroundRun:
    return fly(GroundCase(**{"seconds": 160.0, "window_s": 10.0, "map_sd": 2.0, **changes}), SEED, NUMBER)  # type: ignore[arg-type]


def reasons(flown: GroundRun) -> set[Reason]:
    return {reason for fix in flown.fixes for reason in fix.fix.reasons}


def contradictions(flown: GroundRun) -> list[float]:
    """When fixes begin to contradict the filter [s]."""
    return [t for t, event in flown.events if "the map or the position is wrong" in event.text]


@pytest.fixture(scope="module")
def outage() -> GroundRun:
    return run(satellites=OUTAGE)


def test_without_satellites_the_ground_bounds_the_error(outage: GroundRun) -> None:
    alone = run(satellites=OUTAGE, window_s=None)
    assert alone.distance[-1] > 20.0
    assert outage.distance[np.array(outage.t) > 45.0].max() < 12.0
    assert np.all(outage.distance < np.array(outage.hpl))


def test_fixes_state_their_error_and_what_is_not_verified(outage: GroundRun) -> None:
    valid = [each for each in outage.fixes if each.fix.valid]
    assert len(valid) >= 10
    for each in valid:
        fix = each.fix
        assert fix.north_sd is not None
        assert fix.east_sd is not None
        assert abs(each.error[0]) < 4.0 * fix.north_sd + 0.5
        assert abs(each.error[1]) < 4.0 * fix.east_sd + 0.5
        assert (Reason.MAP_UNVERIFIED in fix.unchecked) == (fix.t_ns > 50e9)
        assert fix.length == pytest.approx(600.0, rel=0.1)


def test_profiles_do_not_overlap(outage: GroundRun) -> None:
    marks = np.array([each.fix.t_valid_ns for each in outage.fixes]) / 1e9
    assert np.diff(marks).min() >= 10.0
    assert {each.fix.samples for each in outage.fixes} <= set(range(48, 54))


def test_a_search_needs_three_fixes_that_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terrain_positioning, "CERTAIN_SD_M", 0.0)
    flown = run(seconds=60.0)
    fixes = [each.fix for each in flown.fixes]
    first = next(k for k, fix in enumerate(fixes) if fix.valid)
    assert all(fix.is_search for fix in fixes[: first + 1])
    assert [fix.reasons for fix in fixes[max(first - 2, 0) : first]] == [(Reason.NOT_CONFIRMED,)] * 2
    assert not any(fix.is_search for fix in fixes[first + 1 :])


@pytest.mark.parametrize("north_m", [100.0, -60.0])
def test_a_displaced_map_is_announced_while_satellites_are_received(north_m: float) -> None:
    flown = run(seconds=70.0, map_shift=(0.0, north_m))
    assert not any(each.fix.valid for each in flown.fixes)
    assert contradictions(flown)[0] < 60.0
    assert flown.distance.max() < 8.0
    # the fix is where the displaced map has it: the distance is announced
    offsets = [each.error[0] for each in flown.fixes if each.fix.reasons == (Reason.REJECTED,)]
    assert offsets
    assert np.median(offsets) == pytest.approx(north_m, abs=8.0)


@pytest.mark.parametrize("dem_error", [None, DemError(noise_sd=1.0)], ids=["exact map", "map with errors"])
def test_flat_ground_gives_no_position(dem_error: DemError | None) -> None:
    flown = run(relief="flat", satellites=OUTAGE, dem_error=dem_error)
    assert not any(each.fix.valid for each in flown.fixes)
    assert Reason.GROUND_FLAT in reasons(flown)
    assert np.all(flown.distance < np.array(flown.hpl))


@pytest.mark.parametrize("speed_mps", [1.0])
def test_a_ramp_of_the_satellites_is_announced_by_the_ground(speed_mps: float) -> None:
    flown = run(seconds=140.0, ramp=(60.0, speed_mps, 0.1))
    alarms = [t for t, event in flown.events if event.level == "warning" and t > 60.0]
    assert alarms
    at = int(np.searchsorted(flown.t, alarms[0]))
    assert flown.distance[min(at, len(flown.t) - 1)] < 35.0
    assert np.all(flown.distance < np.array(flown.hpl) + 1.0)


def test_without_ramp_nothing_is_announced(outage: GroundRun) -> None:
    assert [event.text for _, event in outage.events if event.level == "warning"] == []
    assert not any(math.isnan(error) for each in outage.fixes for error in each.error)
