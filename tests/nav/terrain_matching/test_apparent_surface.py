"""The apparent surface: the ground itself for a vertical pencil; the slant range of a banked one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.arrays import Array
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.terrain_matching.apparent_surface import RangeTrack, apparent_surface
from fti.nav.terrain_matching.fix import match
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import TerrainWindow
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.sensor import Poses, RangingSensor
from fti.terrain.terrain import Terrain
from tests.nav.terrain_matching.grounds import CELL_M, hills

SAMPLES, UP_M = 80, 250.0


def poses(roll: Array, error: tuple[float, float] = (0.0, 0.0)) -> Poses:
    """To the north-east at 53 m/s.  error : true minus navigated position [m]"""
    t = 0.2 * np.arange(SAMPLES)
    origins = np.column_stack((650.0 + 40.0 * t + error[0], 700.0 + 35.0 * t + error[1], np.full(SAMPLES, UP_M)))
    heading = np.full(SAMPLES, math.atan2(40.0, 35.0))
    return Poses.stationary(origins, MAT_ENU_NED @ mat_from_rpy(roll, np.zeros(SAMPLES), heading))


def test_a_vertical_laser_sees_the_ground() -> None:
    ground = hills()
    window = apparent_surface(Laser(), ground, poses(np.zeros(SAMPLES)), CELL_M, 40.0)
    rows, columns = window.heights.shape
    east, north = window.east0 + CELL_M * np.arange(columns), window.north0 + CELL_M * np.arange(rows)
    seen = np.isfinite(window.heights)
    assert seen.any() and not seen.all()
    assert window.heights[seen] == pytest.approx(ground.up(*np.meshgrid(east, north))[seen], abs=1e-6)


def test_over_a_plane_a_banked_laser_sees_its_slant_range() -> None:
    """h / cos(roll), from 250 m above a plane at 0 m."""
    plane, roll = Terrain.from_array(np.zeros((400, 400)), CELL_M), math.radians(20.0)
    window = apparent_surface(Laser(), plane, poses(np.full(SAMPLES, roll)), CELL_M, 40.0)
    assert np.nanmin(window.heights) == pytest.approx(UP_M - UP_M / math.cos(roll), abs=1e-6)
    assert np.nanmax(window.heights) == pytest.approx(UP_M - UP_M / math.cos(roll), abs=1e-6)


def test_nodes_that_no_shift_reaches_are_unknown() -> None:
    where, margin = poses(np.zeros(SAMPLES)), 30.0
    window = apparent_surface(Laser(), hills(), where, CELL_M, margin)
    row, column = np.nonzero(np.isfinite(window.heights))
    nodes = np.column_stack((window.east0 + CELL_M * column, window.north0 + CELL_M * row))
    apart = np.linalg.norm(nodes[:, None] - where.origins_l[:, :2], axis=-1).min(axis=1)
    assert apart.max() <= math.sqrt(2.0) * (margin + CELL_M)
    assert len(nodes) < 0.4 * window.heights.size
    for corner in ((-margin, -margin), (-margin, margin), (margin, -margin), (margin, margin)):
        column, row = (np.floor(place).astype(int) for place in window.places(*(where.origins_l[:, :2] + corner).T))
        assert all(np.isfinite(window.heights[row + i, column + j]).all() for i in (0, 1) for j in (0, 1))


def test_a_radar_sees_from_each_node_what_it_measures_there() -> None:
    """With the attitude and the velocity of the nearest sample."""
    radar, ground = RadarAltimeter(order=12), hills()
    roll = math.radians(30.0) * np.sin(np.arange(SAMPLES) / 12.0)
    where = Poses(poses(roll).origins_l, poses(roll).mats_ls, np.full((SAMPLES, 3), 40.0))
    window = apparent_surface(radar, ground, where, CELL_M, 20.0)
    row, column = (some[::17] for some in np.nonzero(np.isfinite(window.heights)))
    nodes = np.column_stack((window.east0 + CELL_M * column, window.north0 + CELL_M * row, np.full(len(row), UP_M)))
    nearest = np.linalg.norm(nodes[:, None] - where.origins_l, axis=-1).argmin(axis=1)
    measured = radar.measure(ground, Poses(nodes, where.mats_ls[nearest], where.vels_l[nearest])).slant_range
    np.testing.assert_allclose(window.heights[row, column], UP_M - measured, atol=1e-9)


def test_a_refined_window_is_the_same_surface() -> None:
    """Also beside unknown posts, where the cell is known."""
    rng = np.random.default_rng(1)
    heights = rng.standard_normal((7, 9))
    heights[3:, 5] = np.nan
    coarse = TerrainWindow(heights, 6.0, -10.0, 20.0)
    fine = coarse.refine(6)
    assert (fine.cell_m, fine.east0, fine.north0, fine.heights.shape) == (1.0, -10.0, 20.0, (37, 49))
    east, north = rng.uniform(-10.0, 37.9, 2000), rng.uniform(20.0, 55.9, 2000)

    def look_up(window: TerrainWindow) -> Array:
        column, row = window.places(east, north)
        i, j = np.asarray(row, np.intp), np.asarray(column, np.intp)
        u, v, z = column - j, row - i, window.heights
        return (
            z[i, j] * (1 - u) * (1 - v) + z[i, j + 1] * u * (1 - v) + (z[i + 1, j] * (1 - u) + z[i + 1, j + 1] * u) * v
        )

    assert 200 < np.count_nonzero(np.isnan(look_up(coarse))) < 1000
    np.testing.assert_allclose(look_up(fine), look_up(coarse), atol=1e-12)


@pytest.mark.parametrize("sensor", [Laser(), NearestReturn(math.radians(20.0))], ids=["laser", "nearest return"])
def test_a_banked_altimeter_finds_its_position(sensor: RangingSensor) -> None:
    """Roll of 12 deg moves the footprint by 50 m; without noise the fix is right within 2 m, a tenth of the error."""
    ground, error = hills(), (14.0, -11.0)
    roll = math.radians(12.0) * np.sin(np.arange(SAMPLES) / 12.0)
    true, navigated = poses(roll, error), poses(roll)
    ranges = sensor.measure(ground, true).slant_range
    track = RangeTrack(np.linspace(0.0, 15.8, SAMPLES), navigated, ranges, np.full(SAMPLES, 1.0), 5.0)
    window = apparent_surface(sensor, ground, navigated, CELL_M, 45.0)
    fix = match(window, track.profile, Lattice(8))
    assert fix.shift == pytest.approx(error, abs=2.0)
