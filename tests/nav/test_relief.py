"""The relief that is assumed below an altimeter over unknown ground."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.nav.altimetry.relief import RELIEF_UNKNOWN_M, ReliefEstimator
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import PositionState

SPEED, HZ, SECOND = 60.0, 10, 1_000_000_000


def nav(alt: float | None, speed: float | None = SPEED) -> NavState:
    position = PositionState(0.8, 0.2, alt, 1.0, 1.0, speed, 0.0 if speed is not None else None, 0.0, 0)
    return NavState(0, None, position, None, None)


def flight(profile: list[float], alts: list[float | None], speed: float | None = SPEED) -> ReliefEstimator:
    estimator = ReliefEstimator(None)
    for k, (ground, alt) in enumerate(zip(profile, alts, strict=True)):
        nearest = (500.0 if alt is None else alt) - ground
        estimator.feed(k * SECOND // HZ, nearest, nearest, nav(alt, speed))
    return estimator


def test_what_is_configured_counts_and_before_there_is_a_profile_ten_metres() -> None:
    assert ReliefEstimator(3.0).sd(50.0) == 3.0
    assert ReliefEstimator(None).sd(50.0) == RELIEF_UNKNOWN_M
    assert flight([0.0] * 20, [500.0] * 20).sd(50.0) == RELIEF_UNKNOWN_M  # two seconds


def test_hills_give_the_structure_function_of_their_profile() -> None:
    """A sine of amplitude A and length W along the track: D(L) = sqrt(2) A |sin(pi L / W)|."""
    along = np.arange(300) * SPEED / HZ
    hills = (20.0 * np.sin(2.0 * math.pi * along / 300.0)).tolist()
    estimator = flight(hills, [500.0] * 300)
    for beside in (12.0, 60.0, 150.0):
        wanted = math.sqrt(2.0) * 20.0 * abs(math.sin(math.pi * beside / 300.0))
        assert estimator.sd(beside) == pytest.approx(wanted, rel=0.1)


def test_level_ground_and_a_climb_have_none() -> None:
    assert flight([100.0] * 100, [500.0 + k for k in range(100)]).sd(80.0) == pytest.approx(0.0, abs=1e-9)
    climb = [-2.0 * k for k in range(100)]  # the height above the ground grows, and nobody knows the altitude
    assert flight(climb, [None] * 100).sd(80.0) == pytest.approx(0.0, abs=1e-6)


def test_without_a_speed_it_is_what_far_places_differ_by() -> None:
    along = np.arange(300) * SPEED / HZ
    hills = (20.0 * np.sin(2.0 * math.pi * along / 300.0)).tolist()
    assert flight(hills, [500.0] * 300, speed=None).sd(1.0) == pytest.approx(20.0, rel=0.1)


def test_without_an_altitude_a_value_that_repeats_does_not_make_the_ground_level() -> None:
    assert flight([0.0] * 300, [None] * 300).sd(80.0) == RELIEF_UNKNOWN_M
    along = np.arange(200) * SPEED / HZ
    hills = (20.0 * np.sin(2.0 * math.pi * along / 300.0)).tolist()
    stuck = flight([*hills, *[hills[-1]] * 100], [None] * 300)  # for 10 s
    assert stuck.sd(80.0) >= RELIEF_UNKNOWN_M


def test_a_silence_begins_a_new_profile() -> None:
    estimator = flight([0.0] * 100, [500.0] * 100)
    estimator.feed(60 * SECOND, 400.0, 400.0, nav(500.0))
    assert estimator.sd(50.0) == RELIEF_UNKNOWN_M


@pytest.mark.parametrize(("silent_s", "alt"), [(3.0, 500.0), (0.1, None)])
def test_after_a_silence_or_without_an_altitude_the_hills_of_before_are_assumed(
    silent_s: float, alt: float | None
) -> None:
    estimator, _ = over_hills(20.0, 40.0)
    at_ns = 40 * SECOND + round(silent_s * SECOND)
    estimator.feed(at_ns, 290.0, 290.0, nav(alt))
    assert estimator.sd(1.0) == pytest.approx(math.sqrt(2.0) * 20.0, rel=0.15)


def over_hills(relief_sd: float, seconds: float, stuck_s: float = math.inf) -> tuple[ReliefEstimator, float]:
    """In level flight at 60 m/s, with the height above the ground now less the one stated [m]."""
    estimator, held = ReliefEstimator(None), 0.0
    for k in range(round(seconds * HZ)):
        true = 300.0 - math.sqrt(2.0) * relief_sd * math.sin(2.0 * math.pi * k * SPEED / HZ / 700.0)
        held = round(true, 2) if k < stuck_s * HZ else held
        estimator.feed(k * SECOND // HZ, held, held, nav(500.0))
    return estimator, true - held


@pytest.mark.parametrize("stuck_for_s", [2.5, 10.0, 30.0, 60.0])
def test_a_value_that_repeats_in_level_flight_does_not_make_the_ground_level(stuck_for_s: float) -> None:
    """Hills of 20 m: the ground may differ by as much as it did before, and by ten metres at least."""
    estimator, error = over_hills(20.0, 30.0 + stuck_for_s, 30.0)
    assert estimator.sd(1.0) == pytest.approx(math.sqrt(2.0) * 20.0, rel=0.15)
    assert abs(error) <= 3.0 * estimator.sd(1.0)
    assert over_hills(2.0, 30.0 + stuck_for_s, 30.0)[0].sd(1.0) == RELIEF_UNKNOWN_M


def test_a_value_that_repeats_for_less_than_2_s_is_part_of_the_profile() -> None:
    """Steps of 1.5 m over hills: each value repeats for some samples."""
    along = np.arange(300) * SPEED / HZ
    hills = 20.0 * np.sin(2.0 * math.pi * along / 300.0)
    estimator = flight((500.0 - 1.524 * np.round((500.0 - hills) / 1.524)).tolist(), [500.0] * 300)
    for beside in (60.0, 150.0):
        wanted = math.sqrt(2.0) * 20.0 * abs(math.sin(math.pi * beside / 300.0))
        assert estimator.sd(beside) == pytest.approx(wanted, rel=0.1)


def test_after_a_stuck_value_a_new_profile_begins() -> None:
    estimator, _ = over_hills(20.0, 50.0, 30.0)
    for k in range(500, 560):
        estimator.feed(k * SECOND // HZ, 300.0 + 0.01 * k, 300.0, nav(500.0))
        if k < 540:
            assert estimator.sd(80.0) == pytest.approx(math.sqrt(2.0) * 20.0, rel=0.15)
    assert estimator.sd(80.0) == 0.0, "six seconds of level ground"


@pytest.mark.parametrize("speed", [0.1, 4.9, None])
def test_a_hover_does_not_show_the_ground_beside(speed: float | None) -> None:
    ranges = [0.1 * (k % 3) for k in range(100)]
    assert flight(ranges, [500.0] * 100, speed=speed).sd(30.0) == RELIEF_UNKNOWN_M


def test_who_flies_on_after_a_hover_has_no_profile_yet() -> None:
    estimator = flight([0.1 * (k % 3) for k in range(200)], [500.0] * 200, speed=0.5)
    for k in range(200, 240):
        estimator.feed(k * SECOND // HZ, 400.0 + 0.01 * k, 400.0, nav(500.0))
    assert estimator.sd(30.0) == RELIEF_UNKNOWN_M


def test_mountains_that_are_seen_in_short_pieces_are_not_forgotten() -> None:
    """100 m up and down in 20 s, 4.8 s of samples, 2.4 s of silence: 10 m had been assumed all the time."""
    relief, t_ns, estimator = ReliefEstimator(None), SECOND, []
    for piece in range(20):
        for k in range(24):
            ground = 100.0 * math.sin(2.0 * math.pi * t_ns / SECOND / 20.0)
            relief.feed(t_ns, 400.0 - ground + 0.01 * k, 400.0 - ground, nav(500.0))
            t_ns += SECOND // 5
            if piece >= 4:
                estimator.append(relief.sd(40.0))
        t_ns += 22 * SECOND // 10
    assert min(estimator) >= 40.0
