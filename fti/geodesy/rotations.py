"""Rotation matrices between body, navigation and earth frames, of arrays: ``fti.geodesy.formulas``, compiled.

A matrix is named by two frames: ``mat_nb`` transforms b to n.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.geodesy import formulas
from fti.geodesy.formulas import Rows
from fti.kernel import flatten, kernel

_mat_nb, _mat_en, _rpy_of = formulas.mat_nb, formulas.mat_en, formulas.rpy_from_mat


def mat_from_rpy(roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike) -> Array:
    """Attitude matrix mat_nb: body (forward, right, down) to navigation (north, east, down).

        mat_nb = Rz(heading) Ry(pitch) Rx(roll)

    roll right wing down, pitch nose up, heading clockwise from north : float or ndarray [rad]
    Returns : ndarray, shape (..., 3, 3).  With (roll, pitch, yaw) of a mounting it is mat_bs.
    """
    shape, angles = flatten(roll, pitch, heading)
    return _all_mat_nb(*angles).reshape(*shape, 3, 3)


def rpy_from_mat(mat_nb: ArrayLike) -> tuple[Array, Array, Array]:
    """Roll, pitch, heading of an attitude matrix: the inverse of ``mat_from_rpy``.

    mat_nb  : ndarray, shape (..., 3, 3)
    Returns : roll in (-pi, pi], pitch in [-pi/2, pi/2], heading in [0, 2 pi) [rad].  At a pitch of +-90 deg roll and
              heading rotate about one axis and only their sum or difference is defined.
    """
    shape, (flat,) = flatten(mat_nb)
    roll, pitch, heading = _all_rpy(flat.reshape(-1, 3, 3))
    return roll.reshape(shape[:-2]), pitch.reshape(shape[:-2]), heading.reshape(shape[:-2])


def mat_en(lat: ArrayLike, lon: ArrayLike) -> Array:
    """Navigation frame (north, east, down at lat, lon [rad]) to the earth frame: shape (..., 3, 3).

    The columns are the unit vectors north, east and down at the point.
    """
    shape, places = flatten(lat, lon)
    return _all_mat_en(*places).reshape(*shape, 3, 3)


def rotate(mat: ArrayLike, vec: ArrayLike) -> Array:
    """Products of matrices, shape (..., 3, 3), and vectors, shape (..., 3); leading shapes broadcast."""
    return np.asarray((np.asarray(mat, np.float64) @ np.asarray(vec, np.float64)[..., None])[..., 0])


@kernel
def rows_of(mat: Array) -> Rows:
    """A matrix (3, 3) for the formulas."""
    return (
        (mat[0, 0], mat[0, 1], mat[0, 2]),
        (mat[1, 0], mat[1, 1], mat[1, 2]),
        (mat[2, 0], mat[2, 1], mat[2, 2]),
    )


@kernel
def _all_mat_nb(roll: Array, pitch: Array, heading: Array) -> Array:
    mats = np.empty((len(roll), 3, 3))
    for i in range(len(roll)):
        mats[i, 0], mats[i, 1], mats[i, 2] = _mat_nb(roll[i], pitch[i], heading[i])
    return mats


@kernel
def _all_mat_en(lat: Array, lon: Array) -> Array:
    mats = np.empty((len(lat), 3, 3))
    for i in range(len(lat)):
        mats[i, 0], mats[i, 1], mats[i, 2] = _mat_en(lat[i], lon[i])
    return mats


@kernel
def _all_rpy(mats: Array) -> tuple[Array, Array, Array]:
    roll, pitch, heading = np.empty(len(mats)), np.empty(len(mats)), np.empty(len(mats))
    for i in range(len(mats)):
        roll[i], pitch[i], heading[i] = _rpy_of(rows_of(mats[i]))
    return roll, pitch, heading
