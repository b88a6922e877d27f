"""The judge of maps: shift and lag that are put into simulated surveys, and its parts by hand."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fti.arrays import Array
from fti.errors import ConfigError
from fti.post.terrain_judge.fit import EAST, LAG, NORTH, MapFit
from fti.post.terrain_judge.judge import MapResult, compare, cover_rows, fit_terrain, judge, sector_share
from fti.post.terrain_judge.samples import RangeSamples, SensorTrack, block_numbers
from fti.terrain.files.land_cover import land_cover_at
from fti.terrain.terrain import Terrain
from tests.post.judge_survey import BIAS_M, CELL_M, HALF_M, POSTS, at_middle, displaced, fly, ground, samples
from tests.terrain.elevation_files import from_origin, write_tif

SHIFT_M, LAG_S = 30.0, 0.2
CROSSING = (0.0, 90.0, 180.0, 270.0)
#: 95 % of three Gaussian numbers are within this squared distance.
CHI2_95 = 7.815
GROUNDS = 5

relief = functools.cache(ground)


def simulate(run: int, headings_deg: tuple[float, ...]) -> tuple[MapResult, Array]:
    """The result of a survey, and what was put in: bias, shift east and north, lag."""
    rng = np.random.default_rng([22, run])
    true = relief(run % GROUNDS)
    angle = rng.uniform(0.0, 2.0 * math.pi)
    put_in = np.array([BIAS_M, SHIFT_M * math.sin(angle), SHIFT_M * math.cos(angle), LAG_S])
    measured = samples(true, headings_deg, LAG_S, rng)
    return fit_terrain("map", measured, displaced(true, put_in[1:3], rng), rng), put_in


def test_a_shift_of_30_m_and_a_lag_of_200_ms_are_found_within_their_sigma(scale: int) -> None:
    """Shift and lag together are inside the 95 % region of their covariance in 90 of 100 runs.

    The sigma is not too large either: the mean squared distance of three Gaussian numbers is 3.
    """
    runs = 100 if scale > 1 else 15
    distances = []
    for run in range(runs):
        result, put_in = simulate(run, CROSSING)
        assert result.refusals == ()
        error = (result.full.values - put_in)[1:]
        distances.append(float(error @ np.linalg.solve(result.full.cov[1:, 1:], error)))
        assert result.full.sds[[EAST, NORTH]].max() < 1.5
        assert result.full.sds[LAG] < 0.03
        assert result.full.spread_m < 0.5 * result.as_given.spread_m
    inside = sum(distance < CHI2_95 for distance in distances)
    print(
        f"seed 22, {runs} runs: shift of {SHIFT_M:g} m and lag of {LAG_S:g} s inside the 95 % region of the stated "
        f"covariance in {inside}; at least {0.9 * runs:g}; mean square {np.mean(distances) / 3.0:.2f} of the stated one"
    )
    assert inside >= 0.9 * runs
    assert 0.3 < np.mean(distances) / 3.0 < 1.7


def test_one_straight_leg_does_not_separate_shift_and_lag(scale: int) -> None:
    """Either alone explains the ranges; each is then wrong by the way of the other."""
    for run in range(3 * scale):
        result, put_in = simulate(run, (40.0,))
        assert "no legs with headings 60 deg apart" in result.refusals
        along = np.array([math.sin(math.radians(40.0)), math.cos(math.radians(40.0))])
        assert result.best is result.shifted
        assert result.shifted.values[LAG] == 0.0
        # late ranges place each hill too far ahead: the map seems to be behind
        seeming = put_in[1:3] @ along - LAG_S * 60.0
        assert result.shifted.values[1:3] @ along == pytest.approx(seeming, abs=4.0)
        assert result.as_given.values[[EAST, NORTH]].tolist() == [0.0, 0.0]


def test_a_radar_measures_the_nearest_return() -> None:
    """Ranges by brute force: the shortest distance to posts of 5 m within the beam."""
    rng = np.random.default_rng(3)
    true, flight, half_beam = relief(0), fly((0.0, 90.0), rng), math.radians(15.0)
    level = np.tile([0.0, 0.0, -1.0], (len(flight.t), 1))
    track = SensorTrack(flight.t, flight.origins, level)
    at = np.concatenate([np.arange(begin + 2.0, begin + 98.0, 0.5) for begin in (0.0, 130.0)])
    grid = np.arange(-130.0, 131.0, 5.0)
    offsets = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    ranges = np.empty(len(at))
    for i, (east, north, up) in enumerate(track.at(at)[0]):
        drop = up - true.up(east + offsets[:, 0], north + offsets[:, 1])
        distance = np.hypot(np.hypot(*offsets.T), drop)
        ranges[i] = distance[drop >= math.cos(half_beam) * distance].min()
    measured = RangeSamples.of_track(at, ranges, track, half_beam)
    result = judge("radar", measured, {"map": displaced(true, (25.0, -10.0), None)}).maps[0]
    assert result.full.values[[EAST, NORTH]] == pytest.approx([25.0, -10.0], abs=2.0)
    assert result.full.values[LAG] == pytest.approx(0.0, abs=0.05)
    assert result.full.spread_m < 0.8
    narrow = judge("laser", replace(measured, half_beam=0.0), {"map": displaced(true, (25.0, -10.0), None)}).maps[0]
    assert narrow.full.spread_m > 2.0 * result.full.spread_m


def test_maps_are_compared_over_common_ground() -> None:
    rng = np.random.default_rng(4)
    true = relief(1)
    measured = samples(true, CROSSING, 0.0, rng)
    good, shifted = displaced(true, (0.0, 0.0), rng), displaced(true, (20.0, 0.0), rng)
    holes = good.finest.heights.copy()
    holes[:, : POSTS // 3] = np.nan
    result = judge("laser", measured, {"shifted": shifted, "good": good, "holes": at_middle(holes)})
    assert {result.maps[0].name, result.maps[1].name} == {"good", "holes"}
    assert result.maps[2].name == "shifted"
    by_pair = {frozenset((each.first, each.second)): each for each in result.differences}
    assert by_pair[frozenset(("good", "shifted"))].better == "good"
    assert by_pair[frozenset(("holes", "shifted"))].better == "holes"
    assert by_pair[frozenset(("holes", "good"))].better is None
    covered = {each.name: each.covered for each in result.maps}
    assert covered["good"] == 1.0
    assert 0.3 < covered["holes"] < 0.95
    assert by_pair[frozenset(("holes", "shifted"))].samples == pytest.approx(covered["holes"] * len(measured), rel=0.05)
    with pytest.raises(ConfigError, match="nowhere: no elevation is known below the measured ranges of 'laser'"):
        judge("laser", measured, {"nowhere": at_middle(np.full((POSTS, POSTS), np.nan))})


def fit_of(residuals: Array) -> MapFit:
    one = np.ones(len(residuals))
    return MapFit((0, 3), np.array([0.5, 0.0, 0.0, 0.0]), np.eye(4), residuals, one, one)


def test_a_difference_is_that_of_the_squares() -> None:
    rng, blocks = np.random.default_rng(5), [np.arange(400) // 10]
    one, other = rng.standard_normal(400), 2.0 * rng.standard_normal(400)
    other[::50] = np.nan
    result = compare(blocks, ("a", fit_of(one)), ("b", fit_of(other)), rng)
    known = np.isfinite(other)
    assert result.square_m2 == pytest.approx(float((other[known] ** 2 - one[known] ** 2).mean()))
    assert 2.0 < result.low < result.square_m2 < result.high < 4.5
    assert (result.better, result.samples) == ("a", 392)
    assert compare(blocks, ("b", fit_of(other)), ("a", fit_of(one)), rng).better == "a"
    assert compare(blocks, ("a", fit_of(one)), ("c", fit_of(-one)), rng).better is None
    few = compare([np.arange(400) // 50], ("a", fit_of(one)), ("b", fit_of(other)), rng)
    assert (few.better, few.high) == (None, math.inf)


def test_headings_count_by_their_information() -> None:
    def share(headings_deg: list[float], weights: list[float]) -> float:
        angle = np.radians(headings_deg)
        return sector_share(60.0 * np.column_stack((np.sin(angle), np.cos(angle))), np.array(weights))

    assert share([350.0, 10.0, 25.0], [1.0, 1.0, 1.0]) == 1.0
    assert share([0.1, 90.1], [1.0, 3.0]) == 0.75
    assert share([0.1, 90.1], [1.0, 19.0]) == 0.95
    assert share([10.1, 190.1], [1.0, 1.0]) == 0.5


def test_blocks_are_500_m_and_5_s_long_and_end_at_gaps() -> None:
    t = np.arange(0.0, 40.0, 0.5)
    fast = SensorTrack(t, np.column_stack((250.0 * t, 0.0 * t, 0.0 * t)), np.tile([0.0, 0.0, -1.0], (len(t), 1)))
    assert np.flatnonzero(np.diff(block_numbers(t, fast))).tolist() == [9, 19, 29, 39, 49, 59, 69]
    slow = replace(fast, origins=fast.origins / 5.0)  # 50 m/s
    assert np.flatnonzero(np.diff(block_numbers(t, slow))).tolist() == [19, 39, 59]
    assert block_numbers(np.array([0.0, 1.0, 7.0]), slow).tolist() == [0, 0, 1]


def test_ranges_need_a_track_without_gaps_around_them() -> None:
    t = np.delete(np.arange(0.0, 30.0, 0.1), np.arange(100, 120))  # none from 10 to 12 s
    track = SensorTrack(t, np.column_stack((50.0 * t, 0.0 * t, 0.0 * t)), np.tile([0.0, 0.0, -1.0], (len(t), 1)))
    times = np.array([0.5, 2.0, 8.5, 9.5, 11.0, 12.5, 13.5, 28.0, 29.5])
    assert times[track.covers(times)].tolist() == [2.0, 8.5, 13.5, 28.0]


def test_rows_of_land_cover(tmp_path: Path) -> None:
    """West of the middle is class 10, east of it 80; no class beyond the raster."""
    raster = np.array([[10, 80]], dtype=np.uint8)
    path = write_tif(tmp_path / "cover.tif", raster, "EPSG:4326", from_origin(11.0, 48.0, 0.5, 1.0))
    lat, lon = np.radians([47.5, 47.5, 47.5]), np.radians([11.2, 11.7, 12.1])
    assert land_cover_at(path, lat, lon).tolist() == [10, 80, 0]
    classes = np.repeat(np.array([10, 80], dtype=np.uint8), 50)
    residuals = np.concatenate((np.linspace(14.0, 16.0, 50), np.linspace(-1.0, 1.0, 49), [np.nan]))
    fit = fit_of(residuals)
    rows = cover_rows(MapResult("map", flat(), 0.99, fit, fit, fit, ()), classes)
    assert [(row.land_cover, row.samples) for row in rows] == [(10, 50), (80, 49)]
    assert [row.bias_m for row in rows] == pytest.approx([15.5, 0.5])
    assert rows[0].spread_m == pytest.approx(1.4826 * 0.5, rel=0.05)


def flat() -> Terrain:
    return Terrain.from_array(np.zeros((5, 5)), CELL_M, east0=-HALF_M, north0=-HALF_M)


def test_level_ground_gives_no_shift() -> None:
    rng = np.random.default_rng(6)
    level = at_middle(0.001 * rng.standard_normal((POSTS, POSTS)))
    result = fit_terrain("level", samples(level, CROSSING, 0.0, rng), level, rng)
    assert any(each.startswith(("the ground is too flat", "no solution within")) for each in result.refusals)
    assert result.as_given.values[0] == pytest.approx(BIAS_M, abs=0.1)
