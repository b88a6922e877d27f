"""Rotation matrices between body, navigation and earth frames.  A matrix is named by two frames: ``mat_nb`` transforms
b to n."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def _matrix(*rows: tuple[ArrayLike, ArrayLike, ArrayLike]) -> Array:
    """Three rows of three scalars or arrays, broadcast, as an array of shape (..., 3, 3)."""
    entries = np.broadcast_arrays(*(np.asarray(entry, dtype=np.float64) for row in rows for entry in row))
    return np.stack(entries, axis=-1).reshape(*entries[0].shape, 3, 3)


def mat_from_rpy(roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike) -> Array:
    """Attitude matrix mat_nb: body (forward, right, down) to navigation (north, east, down).

        mat_nb = Rz(heading) Ry(pitch) Rx(roll)

    roll right wing down, pitch nose up, heading clockwise from north : float or ndarray [rad]
    Returns : ndarray, shape (..., 3, 3).  With (roll, pitch, yaw) of a mounting it is mat_bs.
    Source  : Titterton and Weston 2004, section 3.6 (direction cosines from Euler angles, order 3-2-1).
    """
    sr, cr, sp, cp, sh, ch = (f(angle) for angle in (roll, pitch, heading) for f in (np.sin, np.cos))
    return _matrix(
        (cp * ch, sr * sp * ch - cr * sh, cr * sp * ch + sr * sh),
        (cp * sh, sr * sp * sh + cr * ch, cr * sp * sh - sr * ch),
        (-sp, sr * cp, cr * cp),
    )


def down_row(roll: float, pitch: float) -> tuple[float, float, float]:
    """(0 0 1) mat_nb: gives the downward component of a body vector.  roll, pitch : [rad]."""
    cp = math.cos(pitch)
    return (-math.sin(pitch), math.sin(roll) * cp, math.cos(roll) * cp)


def rpy_from_mat(mat_nb: ArrayLike) -> tuple[Array, Array, Array]:
    """Roll, pitch, heading of an attitude matrix: the inverse of ``mat_from_rpy``.

    mat_nb  : ndarray, shape (..., 3, 3)
    Returns : roll in (-pi, pi], pitch in [-pi/2, pi/2], heading in [0, 2 pi) [rad].  At a pitch of +-90 deg roll and
              heading rotate about one axis and only their sum or difference is defined.
    """
    mat = np.asarray(mat_nb, dtype=np.float64)
    roll = np.arctan2(mat[..., 2, 1], mat[..., 2, 2])
    pitch = np.arctan2(-mat[..., 2, 0], np.hypot(mat[..., 2, 1], mat[..., 2, 2]))
    heading = np.arctan2(mat[..., 1, 0], mat[..., 0, 0]) % (2.0 * np.pi)
    return roll, pitch, np.where(heading >= 2.0 * np.pi, 0.0, heading)


def mat_en(lat: ArrayLike, lon: ArrayLike) -> Array:
    """Navigation frame (north, east, down at lat, lon [rad]) to the earth frame: shape (..., 3, 3).

    The columns are the unit vectors north, east and down at the point.  Checked against differences of position.
    """
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    return _matrix(
        (-sin_lat * cos_lon, -sin_lon, -cos_lat * cos_lon),
        (-sin_lat * sin_lon, cos_lon, -cos_lat * sin_lon),
        (cos_lat, 0.0, -sin_lat),
    )
