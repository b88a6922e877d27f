"""Rays of points at their own times: against the interpolation between epochs that is exact over longer intervals."""

from __future__ import annotations

import numpy as np

from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.exposure import EPOCH_S, epoch_times, point_rays
from fti.ranging.interpolation import interpolate_poses
from fti.ranging.sensor import Poses


def turning(times: np.ndarray) -> Poses:
    """170 m/s along a curve of 1 g, with 0.5 rad/s of roll and a little pitch and yaw."""
    rpy = 0.1 + 0.5 * times, 0.05 * np.sin(2.0 * times), 0.3 * times
    position = np.stack((170.0 * times, 0.5 * 9.81 * times**2, 300.0 + 2.0 * times), axis=-1)
    velocity = np.stack((np.full_like(times, 170.0), 9.81 * times, np.full_like(times, 2.0)), axis=-1)
    return Poses(position, mat_from_rpy(*rpy), velocity)


def test_rays_are_those_of_the_pose_at_the_time_of_each_point() -> None:
    """5 um and 0.1 urad, as the errors of the line and of the small angle say."""
    rng = np.random.default_rng(3)
    at = np.sort(rng.uniform(1.0, 1.3, 2000))
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    times = epoch_times(at[0], at[-1])
    origins, rays = point_rays(times, turning(times), at, directions)
    poses = interpolate_poses(times, turning(times), at)
    np.testing.assert_allclose(origins, poses.origins_l, atol=5e-6)
    np.testing.assert_allclose(rays, np.einsum("nij,nj->ni", poses.mats_ls, directions), atol=2e-7)


def test_epochs_surround_all_points() -> None:
    for end in (2.0, 2.0001, 2.002, 2.01):
        times = epoch_times(2.0, end)
        assert len(times) >= 2 and times[0] == 2.0 and times[-1] >= end - 1e-12
        np.testing.assert_allclose(np.diff(times), EPOCH_S)
