"""Unit quaternions of a rotation: w first, Hamilton's product; ``quat_ab`` transforms b to a, as ``mat_ab`` does.

They have no singularity and can be interpolated.
Source: Titterton and Weston 2004, section 3.6.4.  Checked against rotation matrices, tests/geodesy/test_quaternions.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.geodesy import formulas
from fti.geodesy.rotations import rows_of
from fti.kernel import flatten, kernel

_mat_of, _quat_of = formulas.mat_from_quat, formulas.quat_from_mat


def mat_from_quat(quat: ArrayLike) -> Array:
    """Rotation matrix, shape (..., 3, 3), of unit quaternions, shape (..., 4)."""
    shape, (flat,) = flatten(quat)
    return _all_mats(flat.reshape(-1, 4)).reshape(*shape[:-1], 3, 3)


def quat_from_mat(mat: ArrayLike) -> Array:
    """Unit quaternions, shape (..., 4), of rotation matrices, shape (..., 3, 3); either sign."""
    shape, (flat,) = flatten(mat)
    return all_quats(flat.reshape(-1, 3, 3)).reshape(*shape[:-2], 4)


@kernel
def _all_mats(quats: Array) -> Array:
    mats = np.empty((len(quats), 3, 3))
    for i in range(len(quats)):
        mats[i, 0], mats[i, 1], mats[i, 2] = _mat_of(quats[i, 0], quats[i, 1], quats[i, 2], quats[i, 3])
    return mats


@kernel
def all_quats(mats: Array) -> Array:
    """``quat_from_mat`` of (n, 3, 3)."""
    quats = np.empty((len(mats), 4))
    for i in range(len(mats)):
        quats[i] = _quat_of(rows_of(mats[i]))
    return quats


def make_continuous(quat: ArrayLike) -> Array:
    """The same rotations, shape (n, 4), each with the sign nearer to its predecessor."""
    quats = np.asarray(quat, dtype=np.float64)
    turned = np.where(np.sum(quats[1:] * quats[:-1], axis=-1) < 0.0, -1.0, 1.0)
    return quats * np.cumprod(np.concatenate(([1.0], turned)))[:, None]


def rate_from_quat(quat_ab: ArrayLike, derivative: ArrayLike) -> Array:
    """Turn rate of b against a in b axes [rad/s], shape (n, 3), of quaternions of any length and their derivatives.

        omega_ab_b = 2 Im(q* dq/dt) / |q|^2

    A change of the length alone has no effect.
    """
    w, x, y, z = np.moveaxis(np.asarray(quat_ab, dtype=np.float64), -1, 0)
    dw, dx, dy, dz = np.moveaxis(np.asarray(derivative, dtype=np.float64), -1, 0)
    turned = np.stack(
        (
            w * dx - x * dw - y * dz + z * dy,
            w * dy - y * dw - z * dx + x * dz,
            w * dz - z * dw - x * dy + y * dx,
        ),
        axis=-1,
    )
    return np.asarray(2.0 * turned / (w * w + x * x + y * y + z * z)[..., None])
