"""Ranges of many poses are those of ``measure``, over any ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fti.arrays import Array, Rng
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.error_model import RangeError
from fti.ranging.laser import Laser
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import NARROW, WIDE
from fti.ranging.radar.beam import Backscatter
from fti.ranging.sensor import Poses, Validity
from fti.terrain.layer import Layer
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

CELL_M, POSTS = 5.0, 500
SIZE_M = CELL_M * (POSTS - 1)


def relief(rng: Rng, sd: float = 25.0) -> Array:
    return fractal_relief((POSTS, POSTS), CELL_M, rng, sd=sd, max_size_m=800.0, min_size_m=30.0)


def blocks(rng: Rng) -> Array:
    """Walls of 5 in 1, as of buildings."""
    return np.asarray(25.0 * (rng.random((50, 50)).repeat(10, 0).repeat(10, 1) > 0.6))


def grounds() -> dict[str, Terrain]:
    rng = np.random.default_rng(3)
    hills, town = relief(rng), relief(rng, 10.0) + blocks(rng)
    holes = hills.copy()
    holes[240:260, 250:270] = np.nan
    fine = Layer(hills[200:301, 200:301], CELL_M, 200 * CELL_M, 200 * CELL_M)
    coarse = Terrain.from_array(hills[::4, ::4], 4 * CELL_M).finest
    return {
        "hills": Terrain.from_array(hills, CELL_M),
        "town": Terrain.from_array(town, CELL_M),
        "holes": Terrain.from_array(holes, CELL_M),
        "high": Terrain.from_array(hills + 900.0, CELL_M),
        "plane": Terrain.from_array(np.zeros((POSTS, POSTS)), CELL_M),
        "layers": Terrain((on_the_edge_of(fine, coarse), coarse), Terrain.from_array(hills, CELL_M).frame),
    }


def on_the_edge_of(fine: Layer, coarse: Layer) -> Layer:
    """The layer with its outermost posts on the coarser surface."""
    heights, frame = fine.heights.copy(), Terrain.from_array(coarse.heights, coarse.cell_m)
    places = fine.east0 + fine.cell_m * np.arange(heights.shape[1])
    low, high = places[0], places[-1]
    heights[0], heights[-1] = frame.up(places, low), frame.up(places, high)
    heights[:, 0], heights[:, -1] = frame.up(low, places), frame.up(high, places)
    return replace(fine, heights=heights)


def draw_poses(ground: Terrain, rng: Rng, count: int) -> Poses:
    """In clusters, 20 to 500 m above the ground, banked by up to 70 deg; some of them outside, and below the ground."""
    centres = rng.uniform(-0.05 * SIZE_M, 1.05 * SIZE_M, (count // 10, 2)).repeat(10, axis=0)
    east, north = (centres + rng.uniform(-10.0, 10.0, centres.shape)).T
    below = np.nan_to_num(ground.up(east, north), nan=float(np.nanmedian(ground.finest.heights)))
    up = below + rng.uniform(-5.0, 500.0, count // 10).repeat(10)
    roll, pitch, heading = rng.uniform(-1.2, 1.2, count), rng.uniform(-0.3, 0.3, count), rng.uniform(0.0, 6.3, count)
    vels = rng.uniform(-200.0, 200.0, (count, 3))
    return Poses(np.column_stack((east, north, up)), MAT_ENU_NED @ mat_from_rpy(roll, pitch, heading), vels)


RADARS = {
    "wide": RadarAltimeter(antenna=WIDE, order=12),
    "narrow": RadarAltimeter(antenna=NARROW, order=12, ground=Backscatter(-10.0, 3.5), min_range=40.0, quantised=True),
    "weak": RadarAltimeter(antenna=WIDE, order=12, transmit_power=1e-4, error=RangeError(bias=3.0)),
}


@pytest.mark.parametrize("name", RADARS)
def test_ranges_are_those_of_the_measurement(name: str) -> None:
    """Only unknown ground beyond the edge may refuse a measurement and not the range."""
    radar, rng = RADARS[name], np.random.default_rng(7)
    for label, ground in grounds().items():
        poses = draw_poses(ground, rng, 300)
        measured, ranges = radar.measure(ground, poses), radar.predict_ranges(ground, poses)
        np.testing.assert_allclose(ranges[measured.valid], measured.slant_range[measured.valid], atol=1e-9, rtol=0.0)
        assert measured.valid.sum() > 15, label
        unknown = np.isin(measured.validity, [Validity.OUTSIDE, Validity.HOLE])
        assert np.isnan(ranges[~measured.valid & ~unknown]).all(), label


@pytest.mark.parametrize("towards", ["east", "west", "north", "south"])
def test_a_cliff_on_one_side_is_nearer_than_the_ground_below(towards: str) -> None:
    """The ground is bounded for each quadrant: a ray towards the cliff must not have the bounds of the other side."""
    rows, columns = np.indices((POSTS, POSTS)) - POSTS // 2
    beside = {"east": columns, "west": -columns, "north": rows, "south": -rows}[towards]
    ground, radar = Terrain.from_array(np.where(beside >= 4, 75.0, 0.0), CELL_M), RADARS["wide"]
    at = CELL_M * (POSTS // 2)
    origins = np.column_stack((at + np.zeros(3), at + np.zeros(3), [115.0, 125.0, 135.0]))
    poses = Poses.stationary(origins, np.broadcast_to(MAT_ENU_NED, (3, 3, 3)))
    ranges = radar.predict_ranges(ground, poses)
    assert (ranges < origins[:, 2] - 20.0).all()
    np.testing.assert_allclose(ranges, radar.measure(ground, poses).slant_range, atol=1e-9, rtol=0.0)


def test_the_order_of_the_poses_does_not_matter() -> None:
    """The search for a hit begins at that of the pose before."""
    ground, radar = grounds()["town"], RADARS["wide"]
    poses = draw_poses(ground, np.random.default_rng(8), 200)
    back = Poses(poses.origins_l[::-1], poses.mats_ls[::-1], poses.vels_l[::-1])
    np.testing.assert_allclose(
        radar.predict_ranges(ground, back)[::-1], radar.predict_ranges(ground, poses), atol=1e-9, rtol=0.0
    )


def test_unknown_ground_refuses_a_range_that_it_may_change() -> None:
    """A hole below refuses it.  One that no ray within the edge meets does not, although ``measure`` counts it."""
    heights, radar = np.zeros((POSTS, POSTS)), RADARS["wide"]
    middle = POSTS // 2
    heights[middle - 30 : middle + 30, middle + 40 :] = np.nan  # from 200 m on
    ground, at = Terrain.from_array(heights, CELL_M), CELL_M * middle
    origins = np.array([[at, at, 100.0], [at + 300.0, at, 100.0], [np.nan, at, 100.0]])
    poses = Poses.stationary(origins, np.broadcast_to(MAT_ENU_NED, (3, 3, 3)))
    beside, over, nowhere = radar.predict_ranges(ground, poses)
    assert beside == pytest.approx(radar.measure(grounds()["plane"], poses).slant_range[0], abs=1e-9)
    assert np.isnan([over, nowhere]).all()
    assert len(radar.predict_ranges(ground, Poses.stationary(origins[:0], np.empty((0, 3, 3))))) == 0


def test_other_sensors_predict_what_they_measure() -> None:
    """Without the number by which an instrument indicates that it has none."""
    ground = grounds()["plane"]
    poses = Poses.stationary([[700.0, 700.0, 80.0], [700.0, 700.0, 900.0]], np.broadcast_to(MAT_ENU_NED, (2, 3, 3)))
    laser = Laser(sentinel=130.0)
    assert laser.measure(ground, poses).slant_range[1] == 130.0
    np.testing.assert_array_equal(laser.predict_ranges(ground, poses), [80.0, np.nan])
