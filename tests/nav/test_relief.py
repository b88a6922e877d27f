"""The relief that is assumed below an altimeter over unknown ground."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.nav.altimetry.relief import RELIEF_UNKNOWN_M, ReliefEstimator
from fti.nav.navigation import NavState
from fti.nav.sources import PositionState

SPEED, HZ, SECOND = 60.0, 10, 1_000_000_000


def nav(alt: float | None, speed: float | None = SPEED) -> NavState:
    position = PositionState(0.8, 0.2, alt, 1.0, 1.0, speed, 0.0 if speed is not None else None, 0.0, 0)
    return NavState(0, None, position, None, None)


def flown(profile: list[float], alts: list[float | None], speed: float | None = SPEED) -> ReliefEstimator:
    found = ReliefEstimator(None)
    for k, (ground, alt) in enumerate(zip(profile, alts, strict=True)):
        nearest = (500.0 if alt is None else alt) - ground
        found.take(k * SECOND // HZ, nearest, nearest, nav(alt, speed))
    return found


def test_what_is_configured_counts_and_before_there_is_a_profile_ten_metres() -> None:
    assert ReliefEstimator(3.0).sd(50.0) == 3.0
    assert ReliefEstimator(None).sd(50.0) == RELIEF_UNKNOWN_M
    assert flown([0.0] * 20, [500.0] * 20).sd(50.0) == RELIEF_UNKNOWN_M  # two seconds


def test_hills_give_the_structure_function_of_their_profile() -> None:
    """A sine of amplitude A and length W along the track: D(L) = sqrt(2) A |sin(pi L / W)|."""
    along = np.arange(300) * SPEED / HZ
    hills = (20.0 * np.sin(2.0 * math.pi * along / 300.0)).tolist()
    found = flown(hills, [500.0] * 300)
    for beside in (12.0, 60.0, 150.0):
        wanted = math.sqrt(2.0) * 20.0 * abs(math.sin(math.pi * beside / 300.0))
        assert found.sd(beside) == pytest.approx(wanted, rel=0.1)


def test_level_ground_and_a_climb_have_none() -> None:
    assert flown([100.0] * 100, [500.0 + k for k in range(100)]).sd(80.0) == pytest.approx(0.0, abs=1e-9)
    climb = [-2.0 * k for k in range(100)]  # the height above the ground grows, and nobody knows the altitude
    assert flown(climb, [None] * 100).sd(80.0) == pytest.approx(0.0, abs=1e-6)


def test_without_a_speed_it_is_what_far_places_differ_by() -> None:
    along = np.arange(300) * SPEED / HZ
    hills = (20.0 * np.sin(2.0 * math.pi * along / 300.0)).tolist()
    assert flown(hills, [500.0] * 300, speed=None).sd(1.0) == pytest.approx(20.0, rel=0.1)


def test_without_an_altitude_a_value_that_repeats_does_not_make_the_ground_level() -> None:
    assert flown([0.0] * 300, [None] * 300).sd(80.0) == RELIEF_UNKNOWN_M
    along = np.arange(200) * SPEED / HZ
    hills = (20.0 * np.sin(2.0 * math.pi * along / 300.0)).tolist()
    stuck = flown([*hills, *[hills[-1]] * 100], [None] * 300)  # for 10 s
    assert stuck.sd(80.0) == RELIEF_UNKNOWN_M


def test_a_silence_begins_a_new_profile() -> None:
    found = flown([0.0] * 100, [500.0] * 100)
    found.take(60 * SECOND, 400.0, 400.0, nav(500.0))
    assert found.sd(50.0) == RELIEF_UNKNOWN_M
