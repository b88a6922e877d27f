"""The apparent surface of a radar: planes in closed form, and rays over rough ground."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.terrain_matching.nearest_surface import RadarTrack, nearest_surface
from fti.nav.terrain_matching.window import TerrainWindow
from fti.ranging.nearest import NearestReturn
from fti.ranging.sensor import Poses
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

CELL_M, SIZE, HALF_BEAM, UP_M = 8.0, 121, math.radians(20.0), 300.0
MIDDLE_M = CELL_M * (SIZE // 2)


def window(heights: np.ndarray) -> TerrainWindow:
    return TerrainWindow(np.ascontiguousarray(heights), CELL_M, 0.0, 0.0)


def beams(up_m: float = UP_M, roll: float = 0.0) -> RadarTrack:
    """Above the middle, to the north."""
    east = np.full(3, MIDDLE_M)
    origins = np.column_stack((east, MIDDLE_M + np.array([-20.0, 0.0, 20.0]), np.full(3, up_m)))
    axis = (MAT_ENU_NED @ mat_from_rpy(roll, 0.0, 0.0))[:, 2]
    return RadarTrack(origins, np.tile(axis, (3, 1)), HALF_BEAM)


def middle(surface: TerrainWindow) -> float:
    return float(surface.heights[SIZE // 2, SIZE // 2])


@pytest.mark.parametrize("slope_deg", [0.0, 8.0, 15.0])
def test_over_a_plane_the_nearest_point_lies_along_its_normal(slope_deg: float) -> None:
    slope = math.tan(math.radians(slope_deg))
    heights = slope * (CELL_M * np.arange(SIZE) - MIDDLE_M) * np.ones((SIZE, 1))
    nearest = UP_M * math.cos(math.radians(slope_deg))
    assert UP_M - middle(nearest_surface(window(heights), beams(), 60.0)) == pytest.approx(nearest, abs=0.06)


def test_beyond_the_beam_the_nearest_point_lies_on_its_edge() -> None:
    # a plane of 35 deg, a beam to 20 deg: the distance along a ray 20 deg off the vertical, towards the slope
    slope = math.tan(math.radians(35.0))
    heights = slope * (CELL_M * np.arange(SIZE) - MIDDLE_M) * np.ones((SIZE, 1))
    along_edge = UP_M / (math.cos(HALF_BEAM) + slope * math.sin(HALF_BEAM))
    found = UP_M - middle(nearest_surface(window(heights), beams(), 60.0))
    assert along_edge - 0.01 <= found <= along_edge + CELL_M * slope  # the edge lies between posts


@pytest.mark.parametrize("roll_deg", [0.0, 12.0, 35.0])
def test_rough_ground_as_rays_see_it(roll_deg: float) -> None:
    heights = fractal_relief((SIZE, SIZE), CELL_M, np.random.default_rng(3), sd=15.0, max_size_m=800.0, min_size_m=60.0)
    terrain, roll = Terrain.from_array(heights, CELL_M), math.radians(roll_deg)
    surface = nearest_surface(window(heights), beams(roll=roll), 60.0)
    rows, columns = np.nonzero(np.isfinite(surface.heights))
    origins = np.column_stack((CELL_M * columns, CELL_M * rows, np.full(len(rows), UP_M)))
    mats = np.tile(MAT_ENU_NED @ mat_from_rpy(roll, 0.0, 0.0), (len(rows), 1, 1))
    rays = NearestReturn(beam_width=2.0 * HALF_BEAM, rings=16, max_range=2000.0)
    expected = rays.measure(terrain, Poses.stationary(origins, mats)).slant_range
    error = UP_M - surface.heights[rows, columns] - expected
    assert len(rows) > 100
    # the edge of a tilted beam meets the ground between posts
    assert np.sqrt(np.mean(error**2)) < (0.3 if roll_deg < 30.0 else 1.2)


@pytest.mark.parametrize(("hole", "is_known"), [(5, False), (20, True)])
def test_a_beam_over_a_hole_and_nodes_beyond_the_corridor_are_unknown(hole: int, is_known: bool) -> None:
    heights = np.zeros((SIZE, SIZE))
    heights[SIZE // 2, SIZE // 2 + hole] = np.nan  # 40 m and 160 m from the middle; the beam ends at 109 m
    surface = nearest_surface(window(heights), beams(), 60.0)
    assert np.isfinite(middle(surface)) == is_known
    assert np.isnan(surface.heights[0]).all()
