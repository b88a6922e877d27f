"""Errors against the truth.  Lengths of a degree: Snyder, Map Projections (USGS Professional Paper 1395), page 24 f."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fti.hil.tables.limits import ScoreLimits
from fti.post.score.outputs.errors import Comparison, QuantityError
from fti.post.score.series import TopicSeries
from fti.post.score.truth_table import TruthTable
from tests.post.score.outputs.synthetic_messages import messages, truth

T = [1.0, 2.0, 3.0]
#: Length of a degree of latitude and of longitude at 45 degrees north on WGS84 [m].
LAT_DEGREE_M, LON_DEGREE_M = 111_131.745, 78_846.806
LEVEL: dict[str, Any] = {"roll": 0.0, "pitch": 0.0, "heading": 0.0, "alt": 0.0, "alt_msl": 0.0}


def errors(
    series: TopicSeries, table: TruthTable, arm_b: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> dict[str, QuantityError]:
    return {one.name: one for one in Comparison(series, table, ScoreLimits(), arm_b).errors()}


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg", "distance_m"),
    [(45.0 + 1 / LAT_DEGREE_M, 10.0, 1.0), (45.0, 10.0 + 25 / LON_DEGREE_M, 25.0), (45.0, 10.0, 0.0)],
)
def test_a_horizontal_error_is_a_distance_over_ground(lat_deg: float, lon_deg: float, distance_m: float) -> None:
    table = truth(4.0, lat=math.radians(45.0), lon=math.radians(10.0), **LEVEL)
    series = messages("/nav/nav_solution", T, lat=math.radians(lat_deg), lon=math.radians(lon_deg), alt=30.0)
    results = errors(series, table)
    np.testing.assert_allclose(results["horizontal"].error, distance_m, atol=2e-3)
    np.testing.assert_allclose(results["altitude"].error, 30.0)


def test_the_error_counts_at_the_time_of_validity() -> None:
    """An altitude that was true a second before is no error of 5 m, though the aircraft sinks at 5 m/s."""
    table = truth(4.0, **{**LEVEL, "alt": (100.0, 80.0)}, lat=0.0, lon=0.0)
    late = messages("/nav/nav_solution", [2.0], alt=95.0, lat=0.0, lon=0.0)
    late.rows[0]["t_valid_ns"] -= 1_000_000_000
    np.testing.assert_allclose(errors(late, table)["altitude"].error, 0.0, atol=1e-9)
    at_once = messages("/nav/nav_solution", [2.0], alt=95.0, lat=0.0, lon=0.0)
    np.testing.assert_allclose(errors(at_once, table)["altitude"].error, 5.0)


def test_angles_are_compared_around_the_circle() -> None:
    table = truth(4.0, **{**LEVEL, "heading": math.radians(359.0)}, lat=0.0, lon=0.0)
    series = messages("/nav/nav_solution", T, heading=math.radians(2.0))
    np.testing.assert_allclose(errors(series, table)["heading"].error, 3.0, atol=1e-9)


def test_an_antenna_is_compared_where_it_is() -> None:
    """Ten metres ahead of P and two above it, on a heading of east: ten metres east, two up."""
    table = truth(4.0, **{**LEVEL, "heading": math.radians(90.0)}, lat=math.radians(45.0), lon=math.radians(10.0))
    lon = math.radians(10.0 + 10.0 / LON_DEGREE_M)
    series = messages("/gnss/position", T, lat=math.radians(45.0), lon=lon, alt=2.0, alt_msl=2.0)
    results = errors(series, table, (10.0, 0.0, -2.0))
    for name in ("horizontal", "altitude", "altitude above sea"):
        np.testing.assert_allclose(results[name].error, 0.0, atol=2e-3)
    np.testing.assert_allclose(errors(series, table)["horizontal"].error, 10.0, atol=2e-3)


def test_an_altimeter_is_compared_along_its_beam_and_straight_below() -> None:
    table = truth(4.0, range_laser=100.0, least_range_laser=99.0, most_range_laser=105.0, height_agl=97.0)
    series = messages(
        "/nav/height_above_ground/laser", T, raw=103.0, nearest_sd=0.4, height_agl=96.0, sd=2.0, predicted=99.0
    )
    results = errors(series, table)
    np.testing.assert_allclose(results["measured range"].error, 3.0)
    np.testing.assert_allclose(results["measured range"].sd, math.hypot(0.4, 3.0))  # half of what lies within 3 m
    np.testing.assert_allclose(results["height below"].error, -1.0)
    np.testing.assert_allclose(results["predicted range"].error, -1.0)


def test_what_the_truth_does_not_have_is_not_compared() -> None:
    table = truth(4.0, height_agl=97.0)
    results = errors(messages("/nav/height_above_ground/laser", T, raw=103.0), table)
    assert np.isnan(results["measured range"].error).all()
    assert not errors(messages("/air_data/temperature", T, static=280.0), table)


def test_a_time_beyond_all_times_is_none() -> None:
    series = messages("/nav/nav_solution", T, alt=90.0)
    series.rows[1]["t_valid_ns"] = 10**30
    assert series.valid_ns.tolist() == series.log_ns.tolist()
