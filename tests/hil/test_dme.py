"""Distance-measuring equipment: line of sight, error, replies, memory and search."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.hil.environment import Environment
from fti.hil.sensors.dme import (
    MEMORY_S,
    SCAN_S,
    SEARCH_S,
    STATIONS_M,
    Interrogator,
    sight,
    track_range,
)
from fti.messages.measurements import DmeRange, Stamp
from fti.terrain.terrain import Terrain
from tests.hil.worlds import flat_terrain, path, scenario, world

Array = NDArray[np.float64]
T = np.arange(0.0, 60.0, 1.0)


def with_terrain(terrain: Terrain) -> Environment:
    return Environment(scenario(), path(), terrain, undulation=47.0)


def ranges(environment: Environment, t: Array, seed: int = 1) -> Array:
    """Indicated ranges, shape (samples, stations) [m]; NaN while unlocked."""
    unit = Interrogator(environment.state(t), environment, t, np.random.default_rng(seed))
    indicated = [[m for m in unit.measure(k, Stamp(0)) if isinstance(m, DmeRange)] for k in range(len(t))]
    assert all(m.valid == (m.slant_range is not None) for sample in indicated for m in sample)
    return np.array([[math.nan if m.slant_range is None else m.slant_range for m in sample] for sample in indicated])


def true_ranges(environment: Environment, t: Array) -> Array:
    state, way = environment.state(t), environment.path
    here = ecef_from_geodetic(state.lat, state.lon, state.alt)
    places = [(*way.to_geodetic(way.x_gpi + s, y), 500.0 + h) for s, y, h in STATIONS_M]
    return np.stack([np.linalg.norm(here - ecef_from_geodetic(*place), axis=-1) for place in places], axis=1)


def test_two_sigma_are_two_tenths_of_a_mile_at_any_distance() -> None:
    """ICAO Annex 10, volume I, 3.5.3.1.3.3.  Two samples a minute apart of 40 interrogators and 4 stations."""
    environment, t = world(duration_s=60.0), np.array([0.0, 59.0])
    errors = np.array([ranges(environment, t, seed) - true_ranges(environment, t) for seed in range(40)])
    per_station = 2.0 * np.sqrt(np.mean(errors**2, axis=(0, 1)))
    np.testing.assert_allclose(per_station, 0.2 * 1852.0, rtol=0.35)
    assert 2.0 * np.sqrt(np.mean(errors**2)) == pytest.approx(0.2 * 1852.0, rel=0.15)


def test_a_hill_in_between_hides_a_station_and_no_other() -> None:
    """A wall across the country beyond the threshold, 300 m high: the station behind it is not heard."""
    side = np.arange(-6000.0, 6020.0, 20.0)
    east, north = np.meshgrid(side, side)
    course = math.radians(250.0)
    beyond = east * math.sin(course) + north * math.cos(course)
    environment = with_terrain(
        flat_terrain(20.0).with_finest(np.where((beyond > 2000.0) & (beyond < 2200.0), 500.0, 0.0))
    )
    state = environment.state(np.array([0.0, 20.0]))
    in_sight = [sight(state, environment, station)[1].tolist() for station in STATIONS_M]
    assert in_sight[0] == [False, False]
    assert in_sight[1] == in_sight[3] == [True, True]
    assert [sight(state, world(), s)[1].tolist() for s in STATIONS_M] == [[True, True]] * 4
    assert np.isnan(ranges(environment, np.array([5.0]))[0, 0])


def test_low_over_the_runway_a_far_station_is_below_the_horizon() -> None:
    """90 m high and 71 km away: 4.12 km per root of a metre, so heard from above 62 m and not below."""
    environment = world(duration_s=80.0)
    t = np.arange(0.0, 79.0, 1.0)
    height = environment.state(t).alt - 500.0
    _, in_sight = sight(environment.state(t), environment, STATIONS_M[3])
    distance = true_ranges(environment, t)[:, 3] / 1000.0
    min_height = (distance / 4.12 - math.sqrt(90.0)) ** 2
    clear = np.abs(height - min_height) > 3.0
    np.testing.assert_array_equal(in_sight[clear], (height > min_height)[clear])
    assert in_sight[0]
    assert not in_sight[-1]


def test_it_remembers_and_then_it_is_unlocked_and_searches() -> None:
    scan_t = np.arange(0.0, 60.0, SCAN_S)
    distance = 50_000.0 - 60.0 * scan_t
    answered = (scan_t < 20.0) | ((scan_t >= 25.0) & (scan_t < 30.0)) | (scan_t >= 45.0)
    indicated = track_range(scan_t, distance, distance, answered)
    np.testing.assert_allclose(indicated[scan_t < 30.0], distance[scan_t < 30.0], atol=1e-6)  # 5 s are in memory
    silent = (scan_t > 30.0 - SCAN_S / 2 + MEMORY_S) & (scan_t < 45.0 + SEARCH_S - SCAN_S / 2)
    assert np.isnan(indicated[silent]).all()
    again = (scan_t >= 45.0 + SEARCH_S) | ((scan_t >= 30.0) & (scan_t < 30.0 + MEMORY_S - 2 * SCAN_S))
    np.testing.assert_allclose(indicated[again], distance[again], atol=1e-6)


def test_in_memory_it_goes_on_with_the_speed_that_it_had() -> None:
    scan_t = np.arange(0.0, 10.0, SCAN_S)
    distance = 50_000.0 - 60.0 * np.minimum(scan_t, 5.0)  # it stops where nobody answers any more
    indicated = track_range(scan_t, distance, distance, scan_t < 4.0)
    assert indicated[-1] == pytest.approx(50_000.0 - 60.0 * scan_t[-1], abs=1e-6)


def test_most_replies_come_and_the_others_are_bridged() -> None:
    """From second to second 15 m of the reply and what an error of 157 m with 120 s wanders, 14 m."""
    environment = world(duration_s=60.0)
    indicated = ranges(environment, T)
    assert not np.isnan(indicated).any()
    changes = np.diff(indicated - true_ranges(environment, T), axis=0)
    wandered = 157.0 * math.sqrt(1.0 - math.exp(-1.0 / 120.0))
    assert changes.std() / math.sqrt(2.0) == pytest.approx(math.hypot(15.0, wandered), rel=0.2)
