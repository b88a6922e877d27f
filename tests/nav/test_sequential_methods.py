"""Sequential filters as methods: their state from profile to profile, with a navigated position that is corrected."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import pytest

from fti.arrays import Array
from fti.nav.match_task import MatchTask
from fti.nav.sequential_methods import MAX_GAP_S, SequentialMethod
from fti.nav.terrain_filters.point_mass import PointMassFilter
from fti.nav.terrain_filters.terrain_filter import TerrainFilter
from fti.nav.terrain_matching.fix import MatchFix, MatchLimits, MatchPriors, Refusal
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import TerrainWindow, finest_window
from fti.study.ground_flights import relief
from fti.terrain.terrain import Terrain

GROUND = relief("hills", 0)
SAMPLES, PERIOD_S, VELOCITY = 50, 0.2, np.array([36.0, 48.0])
FIRST, SECOND = np.array([-40.0, 25.0]), np.array([-3.0, 2.0])


@dataclass
class Heights:
    """Of a profile: the samples, as far as the methods read them."""

    samples: Any
    ground: object = GROUND


@dataclass
class Samples:
    t: Array
    origins: Array


@dataclass
class Task:
    heights: Heights
    profile: Profile
    priors: MatchPriors
    height_sd: float = 3.0
    reach_m: float = 300.0
    limits: MatchLimits = MatchLimits()  # noqa: RUF009 - frozen

    def search_area(self) -> tuple[Profile, TerrainWindow, Lattice]:
        return self.profile, finest_window(GROUND), Lattice(2)


def task(begin_s: float, shift: Array, ground: Terrain = GROUND, cov: Array | None = None) -> MatchTask:
    """A profile that begins at a time; the true track is the same straight line for all."""
    t: Array = np.asarray(begin_s + PERIOD_S * np.arange(SAMPLES), dtype=np.float64)
    true: Array = -500.0 + VELOCITY * t[:, None]
    noise = np.random.default_rng(round(begin_s)).standard_normal(SAMPLES)
    up = ground.up(*true.T) + 1.5 + 0.5 * noise
    east, north = (true - shift).T
    profile = Profile(t, east, north, up, np.full(SAMPLES, 0.5), 3.0)
    origins = np.column_stack((east, north, np.zeros(SAMPLES)))
    found = Task(Heights(Samples(t, origins), ground), profile, MatchPriors(1.0, 0.05, cov))
    return cast(MatchTask, found)


def two_profiles(method: SequentialMethod, gap_s: float = 0.4) -> tuple[MatchFix, MatchFix]:
    first = method.match(task(0.0, FIRST))
    return first, method.match(task(SAMPLES * PERIOD_S - PERIOD_S + gap_s, SECOND))


@pytest.mark.parametrize("form", [PointMassFilter, TerrainFilter])
def test_a_filter_goes_on_with_the_corrected_position(form: Any) -> None:
    """Navigation was corrected by 44 m between the profiles."""
    first, second = two_profiles(SequentialMethod(form))
    for fix, shift in ((first, FIRST), (second, SECOND)):
        assert fix.is_usable
        assert np.hypot(*(fix.shift - shift)) < 4.0 * math.sqrt(np.trace(fix.cov))
        assert np.hypot(*(fix.shift - shift)) < 2.0
        assert fix.up == pytest.approx(-1.5, abs=1.0)


def test_what_it_knew_is_kept_and_lost_after_a_gap() -> None:
    """One sample of the second profile: the covariance is that of both profiles, or that of a start."""
    known, forgotten = SequentialMethod(PointMassFilter), SequentialMethod(PointMassFilter)
    for method, gap_s, sds in ((known, MAX_GAP_S - 0.1, (0.0, 3.0)), (forgotten, MAX_GAP_S + 0.1, (20.0, 100.0))):
        method.match(task(0.0, FIRST))
        given = task(SAMPLES * PERIOD_S - PERIOD_S + gap_s, SECOND)
        object.__setattr__(given.search_area()[0], "sd", np.full(SAMPLES, 1e4))
        low, high = sds
        assert low < math.sqrt(method.match(given).cov[0, 0]) < high


def test_a_new_search_and_another_ground_begin_anew() -> None:
    """With the covariance of the navigated position before, and without it again."""
    method = SequentialMethod(PointMassFilter)
    method.match(task(0.0, FIRST, cov=100.0 * np.eye(2)))
    before = method._tracked
    assert before is not None
    method.match(task(10.2, FIRST))
    searching = method._tracked
    assert searching is not None
    assert searching.filter is not before.filter
    method.match(task(20.4, FIRST, relief("hills", 1)))
    assert method._tracked is not None
    assert method._tracked.filter is not searching.filter


def test_a_position_that_the_ground_leaves_undetermined_is_refused() -> None:
    level = Terrain.from_array(np.zeros((2000, 2000)), 5.0, east0=-5000.0, north0=-5000.0)
    given = task(0.0, FIRST, level)
    window = TerrainWindow(level.finest.heights, 5.0, -5000.0, -5000.0)
    object.__setattr__(given, "search_area", lambda: (cast(Any, given).profile, window, Lattice(2)))
    assert SequentialMethod(TerrainFilter).match(given).refusals == {Refusal.FLAT}
