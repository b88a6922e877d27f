from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn, ring_angles
from fti.ranging.sensor import Poses, RangingSensor, sensor_poses
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

LAT0, LON0 = np.radians(36.63), np.radians(-84.17)
HALF = np.radians(20.0)
#: A ring step of 2.5 deg, halved five times, leaves the leading edge over a plane this much too long (relative).
LONG = (np.radians(2.5) / 32) ** 2


def plane(slope_east: float = 0.0, slope_north: float = 0.0) -> Terrain:
    posts = np.linspace(-2000.0, 2000.0, 161)
    east, north = np.meshgrid(posts, posts)
    return Terrain.from_array(
        slope_east * east + slope_north * north, 25.0, lat0=LAT0, lon0=LON0, east0=-2000.0, north0=-2000.0
    )


FLAT = plane()


def poses(height: float, roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike = 0.0) -> Poses:
    mats = MAT_ENU_NED @ mat_from_rpy(np.atleast_1d(roll), pitch, heading)
    return Poses.stationary(np.tile([3.0, 4.0, height], (len(mats), 1)), mats)


def along(sensor: RangingSensor, *path: Any, **mounting: Any) -> Array:
    return sensor.measure(FLAT, sensor_poses(FLAT.frame, path[:3], path[3:], **mounting)).slant_range


def test_laser_over_flat_ground_is_h_over_cos() -> None:
    rng = np.random.default_rng(1)
    roll, pitch, heading = rng.uniform(-0.9, 0.9, 400), rng.uniform(-0.6, 0.6, 400), rng.uniform(0, 6, 400)
    found = Laser(max_range=5000.0).measure(FLAT, poses(300.0, roll, pitch, heading)).slant_range
    expected = 300.0 / (np.cos(roll) * np.cos(pitch))
    assert np.abs(found / expected - 1).max() < 1e-9


@settings(max_examples=60)
@given(st.floats(-0.34, 0.34), st.floats(0.0, 2 * np.pi), st.floats(10.0, 600.0))
def test_leading_edge_over_flat_ground_is_the_height(off: float, towards: float, height: float) -> None:
    """As long as the vertical is inside the beam, whatever the attitude."""
    found = NearestReturn().measure(FLAT, poses(height, off * np.cos(towards), off * np.sin(towards))).slant_range[0]
    assert height * (1 - 1e-12) <= found <= height * (1 + LONG)


@pytest.mark.parametrize("bank", [0.45, -0.7, 0.9])
def test_leading_edge_outside_the_beam_is_its_nearest_edge(bank: float) -> None:
    found = NearestReturn(max_range=2000.0).measure(FLAT, poses(300.0, bank, 0.0)).slant_range[0]
    expected = 300.0 / np.cos(abs(bank) - HALF)
    assert expected * (1 - 1e-12) <= found < expected * 1.001


@pytest.mark.parametrize(("slope_east", "slope_north"), [(0.2, 0.0), (0.0, -0.3), (0.15, 0.2)])
def test_leading_edge_over_a_slope_is_the_perpendicular(slope_east: float, slope_north: float) -> None:
    ground = plane(slope_east, slope_north)
    found = NearestReturn().measure(ground, poses(400.0, 0.02, -0.03, 1.0)).slant_range[0]
    expected = (400.0 - 3.0 * slope_east - 4.0 * slope_north) / np.sqrt(1 + slope_east**2 + slope_north**2)
    assert expected * (1 - 1e-12) <= found <= expected * (1 + LONG)


def test_rays_are_counted_symmetric_and_evenly_spaced() -> None:
    angles = ring_angles(2 * HALF, 8)
    assert angles.shape == (1 + 3 * 8 * 9, 2)
    for mirror in ([-1, 1], [1, -1], [-1, -1]):
        mirrored = angles * mirror
        distance = np.linalg.norm(angles[:, None] - mirrored[None], axis=-1).min(axis=1)
        assert distance.max() < 1e-12
    assert np.linalg.norm(angles, axis=1).max() == pytest.approx(HALF)
    around = np.degrees(np.arctan2(angles[[1, 7, 19], 1], angles[[1, 7, 19], 0]))
    assert around == pytest.approx([30.0, 0.0, 10.0], abs=1e-12), "every other ring is turned by half a step"
    distance = np.linalg.norm(angles[:, None] - angles[None], axis=-1) + 9.0 * np.eye(len(angles))
    step = np.radians(2.5)
    assert 0.85 * step < distance.min() and distance.min(axis=1).max() < 1.1 * step


def test_mast_is_seen_by_the_beam_and_missed_by_the_laser() -> None:
    heights = FLAT.finest.heights.copy()
    heights[80, 82] = 120.0  # 50 m east of the origin
    ground = Terrain.from_array(heights, 25.0, lat0=LAT0, lon0=LON0, east0=-2000.0, north0=-2000.0)
    at = poses(300.0, 0.0, 0.0)
    summit = np.linalg.norm(np.array([50.0, 0.0, 120.0]) - at.origins_l[0])
    assert summit * (1 - 1e-12) <= NearestReturn().measure(ground, at).slant_range[0] < summit + 1.0
    assert Laser(max_range=500.0).measure(ground, at).slant_range[0] == pytest.approx(300.0)
    assert NearestReturn(beam_width=np.radians(8)).measure(ground, at).slant_range[0] == pytest.approx(300.0, rel=LONG)


def test_out_of_range_and_unknown_poses_are_nan() -> None:
    at = poses(800.0, [0.0, 0.0, np.pi, np.nan], 0.0)
    at.origins_l[1, 2] = 700.0
    for sensor in (NearestReturn(max_range=762.0), Laser(max_range=762.0)):
        found = sensor.measure(FLAT, at).slant_range
        assert np.isnan(found).tolist() == [True, False, True, True]
    outside = Poses.stationary(at.origins_l + np.array([5000.0, 0.0, 0.0]), at.mats_ls)
    assert np.isnan(NearestReturn(max_range=2000.0).measure(FLAT, outside).slant_range).all()


def test_lever_arm_and_mounting() -> None:
    """A sensor 2 m below and 5 m ahead of P moves with the pitching body; a mounting turns it back to the vertical."""
    pitch = 0.2
    down = along(Laser(max_range=1e3), LAT0, LON0, 100.0, 0.0, pitch, 0.0, lever_arm_b=(5.0, 0.0, 2.0))
    height = 100.0 + 5.0 * np.sin(pitch) - 2.0 * np.cos(pitch)
    assert down == pytest.approx([height / np.cos(pitch)], rel=1e-12)
    mounting = mat_from_rpy(0.0, -pitch, 0.0)
    level = along(Laser(max_range=1e3), LAT0, LON0, 100.0, 0.0, pitch, 0.0, mat_bs=mounting)
    assert level == pytest.approx([100.0], rel=1e-12)


def test_velocity_is_over_the_ground_whatever_the_attitude() -> None:
    """North 60, east 5, down 3 m/s at the origin of the frame; one for all poses, or one each."""
    one = (60.0, 5.0, 3.0)
    at = sensor_poses(FLAT.frame, (LAT0, LON0, 100.0), ([0.3, -1.0], 0.2, 2.0), vel_n=one)
    assert at.vels_l == pytest.approx(np.tile([5.0, 60.0, -3.0], (2, 1)), abs=1e-12)
    each = sensor_poses(FLAT.frame, (LAT0, LON0, 100.0), ([0.3, -1.0], 0.2, 2.0), vel_n=[one, (0.0, -7.0, 0.0)])
    assert each.vels_l[1] == pytest.approx([-7.0, 0.0, 0.0], abs=1e-12)


def test_vertical_of_the_place_not_of_the_frame() -> None:
    """1800 m from the origin the plumb line leans by 0.28 mrad against the frame's up."""
    lat, lon, alt = FLAT.frame.to_geodetic([1800.0, 0.0, 500.0])
    at = sensor_poses(FLAT.frame, (lat, lon, alt), (0.0, 0.0, 0.7))
    assert at.origins_l[0] == pytest.approx([1800.0, 0.0, 500.0], abs=1e-8)
    assert at.mats_ls[0, :, 2] == pytest.approx([-1800.0 / 6.387e6, 0.0, -1.0], abs=1e-6)


def test_path_is_vectorised() -> None:
    rng = np.random.default_rng(2)
    enu = rng.uniform([-500, -500, 100], [500, 500, 400], (50, 3))
    roll, pitch, heading = rng.uniform(-0.2, 0.2, (3, 50))
    lat, lon, alt = FLAT.frame.to_geodetic(enu)
    sensor = NearestReturn()
    together = along(sensor, lat, lon, alt, roll, pitch, heading, lever_arm_b=(1.0, 0.0, 0.5))
    one = along(sensor, lat[7], lon[7], alt[7], roll[7], pitch[7], heading[7], lever_arm_b=(1.0, 0.0, 0.5))
    assert together.shape == (50,) and one.shape == (1,) and together[7] == one[0]


def test_bad_calls_are_refused() -> None:
    at = poses(300.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="mats_ls has the shape"):
        Poses.stationary(at.origins_l, np.repeat(at.mats_ls, 2, axis=0))
    for bad in ({"beam_width": 0.0}, {"beam_width": 3.2}, {"rings": 0}, {"max_range": 0.0}):
        with pytest.raises(ValueError, match=next(iter(bad))):
            NearestReturn(**bad)
    with pytest.raises(ValueError, match="max_range"):
        Laser(max_range=-1.0)
