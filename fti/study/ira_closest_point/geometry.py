"""Points that are constructed with vectors, and the point that each form finds for them."""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy, rotate
from fti.nav.interferometric.closest_point import MAX_OFF_BELLY, closest_points, effective_look_angle
from fti.ranging.sensor import Poses

#: Largest roll, pitch, crab and climb [rad]; ranges [m]; speed [m/s].
ENVELOPE, RANGES_M, SPEED_MPS = np.radians([60.0, 15.0, 20.0, 10.0]), (100.0, 6000.0), 83.0


def largest_error(count: int, seed: int) -> float:
    """Of the proposed form, over at least so many points inside of its domain [m]; infinite if one is refused."""
    rng, left, worst = np.random.default_rng([seed, 26]), count, 0.0
    while left > 0:
        poses = _poses(count, rng)
        points, look = _points(poses, rng)
        cos_off = (points * poses.mats_ls[:, :, 2]).sum(axis=1) / np.linalg.norm(points, axis=1)
        is_inside = (cos_off > np.cos(MAX_OFF_BELLY)) & (points[:, 2] < 0.0)
        found = closest_points(np.linalg.norm(points, axis=1), look, poses)
        if not found.is_known[is_inside].all():
            return np.inf
        worst = max(worst, float(np.abs(found.relative - points)[is_inside].max()))
        left -= int(np.count_nonzero(is_inside))
    return worst


def conventional_shift(height: float, look: float, crab: float) -> float:
    """Distance of the conventional point from the proposed one, over level ground [m].  Angles [rad]"""
    mats = MAT_ENU_NED @ mat_from_rpy(0.0, 0.0, crab)
    poses = Poses(np.zeros((1, 3)), mats[None], np.array([[0.0, SPEED_MPS, 0.0]]))
    angle, _ = effective_look_angle(np.array([look]), poses)
    return float(height * (np.tan(angle[0]) - np.tan(look)))


def _poses(count: int, rng: np.random.Generator) -> Poses:
    roll, pitch, crab, climb = ENVELOPE[:, None] * rng.uniform(-1.0, 1.0, (4, count))
    track = rng.uniform(0.0, 2.0 * np.pi, count)
    ahead = np.stack((np.cos(climb) * np.sin(track), np.cos(climb) * np.cos(track), np.sin(climb)), axis=-1)
    mats = MAT_ENU_NED @ mat_from_rpy(roll, pitch, track + crab)
    return Poses(np.zeros((count, 3)), mats, SPEED_MPS * ahead)


def _points(poses: Poses, rng: np.random.Generator) -> tuple[Array, Array]:
    """Points at random angles in the plane perpendicular to the velocity [m], and the angle that antennas measure."""
    one = np.cross(poses.vels_l, rng.standard_normal(poses.vels_l.shape))
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    other = np.cross(one, poses.vels_l) / SPEED_MPS
    turn = rng.uniform(0.0, 2.0 * np.pi, (len(poses), 1))
    direction = np.cos(turn) * one + np.sin(turn) * other
    antennas = rotate(poses.mats_ls, np.array([0.0, 1.0, 0.0]))
    ranges = rng.uniform(*RANGES_M, (len(poses), 1))
    return ranges * direction, np.arcsin((direction * antennas).sum(axis=1))
