"""Rays of points that are measured one after the other while the sensor moves: each from the pose of its own time.

Between epochs h apart the position moves on a straight line and the attitude turns by the small angle

    x_l(t) = x_k + v_k (t - t_k),      ray_l(t) = mat_k (d_s + w_k x d_s (t - t_k) / h)         t_k the nearest epoch

with the rotation vector w_k from one epoch to the next.  Errors at h = 2 ms: |x''| h^2 / 8, 5 um at 1 g; |w|^2 / 8, 0.1
urad at 0.5 rad/s.  ``fti.ranging.interpolation`` is exact over longer intervals and ten times slower for each point.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.ranging.sensor import Poses

#: Time between epochs [s].
EPOCH_S = 2e-3


def epoch_times(begin: float, end: float) -> Array:
    """Times of epochs [s], at least two, around all times from begin to end [s]."""
    count = max(math.ceil((end - begin) / EPOCH_S), 1) + 1
    return np.asarray(begin + EPOCH_S * np.arange(count), np.float64)


def point_rays(times: Array, epochs: Poses, at: ArrayLike, directions_s: ArrayLike) -> tuple[Array, Array]:
    """Origins [m] and unit vectors of rays in the frame of the terrain, shapes (n, 3).

    times        : of the epochs, shape (k,) [s], equally spaced, as ``epoch_times`` gives them
    at           : of the points, shape (n,) [s]
    directions_s : unit vectors in the sensor frame, shape (n, 3)
    """
    vectors_s = np.asarray(directions_s, np.float64)
    share = (np.asarray(at, np.float64) - times[0]) / EPOCH_S
    nearest = np.clip(np.rint(share).astype(np.intp), 0, len(times) - 1)
    share -= nearest
    mats = epochs.mats_ls
    turns = _small_turns(np.swapaxes(mats[:-1], -1, -2) @ mats[1:])
    turns = np.concatenate((turns, turns[-1:]))
    turned_s = vectors_s + np.cross(share[:, None] * turns[nearest], vectors_s)
    origins = epochs.origins_l[nearest] + (share * EPOCH_S)[:, None] * epochs.vels_l[nearest]
    return origins, np.einsum("nij,nj->ni", mats[nearest], turned_s)


def _small_turns(mats: Array) -> Array:
    """Rotation vectors (n, 3) [rad] of rotation matrices (n, 3, 3) by small angles."""
    return 0.5 * np.stack(
        (mats[:, 2, 1] - mats[:, 1, 2], mats[:, 0, 2] - mats[:, 2, 0], mats[:, 1, 0] - mats[:, 0, 1]), axis=-1
    )
