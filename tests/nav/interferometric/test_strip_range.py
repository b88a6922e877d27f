"""Predicted slant ranges against closed forms over planes, and against the search with rays of the sensor model."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.arrays import Array
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.interferometric.strip_range import Strip, strip_ranges
from fti.nav.terrain_matching.window import TerrainWindow
from fti.ranging.interferometric import InterferometricAltimeter
from fti.ranging.sensor import Poses
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

CELL, HALF = 50.0, 5000.0
SENSOR = InterferometricAltimeter()


def window_of(heights: Array) -> TerrainWindow:
    return TerrainWindow(heights, CELL, -HALF, -HALF)


def plane(slope_east: float = 0.0, slope_north: float = 0.0) -> TerrainWindow:
    axis = np.arange(-HALF, HALF + CELL, CELL)
    return window_of(slope_east * axis + slope_north * axis[:, None])


def attitude(roll: float = 0.0, pitch: float = 0.0, crab: float = 0.0, climb: float = 0.0) -> tuple[Array, Array]:
    """mat_ls and velocity of a flight to the north; angles in degrees."""
    mat = MAT_ENU_NED @ mat_from_rpy(math.radians(roll), math.radians(pitch), math.radians(crab))
    return mat, 40.0 * np.array([0.0, math.cos(math.radians(climb)), math.sin(math.radians(climb))])


def strip(mat: Array, velocity: Array) -> Strip:
    return Strip(velocity, mat[:, 1].copy(), 0.5 * SENSOR.swath_width, 0.5 * SENSOR.field_of_view)


ABOVE = np.array([[20.0, -30.0, 2000.0]])


def test_over_level_ground_it_is_the_height_and_in_a_climb_that_at_the_edge() -> None:
    assert strip_ranges(plane(), ABOVE, strip(*attitude())) == pytest.approx([2000.0], abs=1e-6)
    climbing = strip_ranges(plane(), ABOVE, strip(*attitude(climb=6.5)))
    assert climbing == pytest.approx([2000.0 / math.cos(math.radians(4.0))], rel=1e-6)
    banked = strip_ranges(plane(), ABOVE, strip(*attitude(roll=40.0)))
    assert banked == pytest.approx([2000.0 / math.cos(math.radians(10.0))], abs=3.0)  # steps of 15 m across


def test_over_a_slope_across_it_is_the_perpendicular() -> None:
    above = 2000.0 - 0.2 * 20.0
    assert strip_ranges(plane(slope_east=0.2), ABOVE, strip(*attitude())) == pytest.approx(
        [above / math.hypot(1.0, 0.2)], abs=0.02
    )


def test_over_a_slope_along_it_is_the_edge_of_the_strip() -> None:
    """Slope s, edge gamma: R (cos gamma + s sin gamma) = height above the ground straight below."""
    gamma, above = 0.5 * SENSOR.swath_width, 2000.0 + 0.2 * 30.0
    expected = above / (math.cos(gamma) + 0.2 * math.sin(gamma))
    assert strip_ranges(plane(slope_north=0.2), ABOVE, strip(*attitude())) == pytest.approx([expected], abs=1e-3)


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0, 0.0), (12.0, 3.0, -9.0, 4.0)])
def test_over_hills_it_is_the_range_of_the_sensor_model(angles: tuple[float, float, float, float]) -> None:
    shape = (int(2 * HALF / CELL) + 1,) * 2
    relief = fractal_relief(shape, CELL, np.random.default_rng(3), sd=50.0, max_size_m=3000.0, min_size_m=500.0)
    mat, velocity = attitude(*angles)
    positions = np.column_stack((np.random.default_rng(4).uniform(-2000.0, 2000.0, (50, 2)), np.full(50, 2200.0)))
    poses = Poses(positions, np.tile(mat, (50, 1, 1)), np.tile(velocity, (50, 1)))
    exact = SENSOR.measure(Terrain.from_array(relief, CELL, east0=-HALF, north0=-HALF), poses).slant_range
    longer = strip_ranges(window_of(relief), positions, strip(mat, velocity)) - exact
    assert longer.min() > -0.2  # what the search with rays leaves
    assert longer.mean() < 0.3
    assert longer.max() < 3.0


def test_unknown_ground_within_reach_is_an_unknown_range() -> None:
    window = plane()
    window.heights[100, 100] = np.nan  # the post below
    assert np.isnan(strip_ranges(window, ABOVE, strip(*attitude()))).all()
    edge = np.array([[HALF - 10.0, 0.0, 2000.0], [HALF + 10.0, 0.0, 2000.0]])
    assert np.isnan(strip_ranges(plane(), edge, strip(*attitude()))).tolist() == [False, True]


def test_the_range_does_not_depend_on_the_positions_before() -> None:
    """Ground 150 m high on the right and unknown ground behind it: the nearest point jumps, and may be out of reach."""
    axis = np.arange(-HALF, HALF + CELL, CELL)
    window = window_of(np.where(axis > 400.0, 150.0, 0.0) + 20.0 * np.sin(axis[:, None] / 200.0))
    window.heights[:, axis > 500.0] = np.nan
    positions = np.column_stack((np.linspace(-1500.0, 450.0, 60), np.linspace(-900.0, 900.0, 60), np.full(60, 2000.0)))
    seen = strip(*attitude(roll=5.0, crab=30.0))
    alone = [float(strip_ranges(window, position[None], seen)[0]) for position in positions]
    assert np.isnan(alone).any() and np.isfinite(alone).any()
    for order in (slice(None), slice(None, None, -1), np.random.default_rng(1).permutation(60)):
        assert strip_ranges(window, positions[order], seen).tolist() == pytest.approx(
            np.array(alone)[order], nan_ok=True, abs=0.0
        )


def test_above_unknown_ground_and_below_the_highest_ground() -> None:
    """All posts unknown, or one row of posts: no range.

    A hill that is higher than the aircraft, 3 km away: the ground below is nearest.
    """
    window = plane()
    window.heights[:] = np.nan
    assert np.isnan(strip_ranges(window, ABOVE, strip(*attitude()))).all()
    row = TerrainWindow(np.zeros((1, 200)), CELL, -HALF, -HALF)
    assert np.isnan(strip_ranges(row, ABOVE, strip(*attitude()))).all()
    hill = plane()
    hill.heights[:, -20:] = 3000.0
    assert strip_ranges(hill, ABOVE, strip(*attitude())) == pytest.approx([2000.0], abs=1e-6)


def test_positions_that_are_unknown_or_below_the_ground() -> None:
    unknown = np.vstack((ABOVE, [[np.nan, 0.0, 2000.0]], [[0.0, 0.0, np.nan]], ABOVE))
    assert np.isnan(strip_ranges(plane(), unknown, strip(*attitude()))).tolist() == [False, True, True, False]
    assert strip_ranges(plane(), np.empty((0, 3)), strip(*attitude())).shape == (0,)
    deep = np.array([[20.0, -30.0, -500.0]])
    assert strip_ranges(plane(), deep, strip(*attitude())) == pytest.approx([500.0], abs=1e-6)


def test_without_a_horizontal_velocity_there_is_no_strip() -> None:
    with pytest.raises(ValueError, match="horizontal part"):
        Strip(np.array([0.0, 0.0, 5.0]), np.array([1.0, 0.0, 0.0]), 0.04, 0.5)
