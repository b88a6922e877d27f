"""Unit quaternions of a rotation: w first, Hamilton's product; ``quat_ab`` transforms b to a, as ``mat_ab`` does.

They have no singularity and can be interpolated.
Source: Titterton and Weston 2004, section 3.6.4.  Checked against rotation matrices, tests/geodesy/test_quaternions.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def mat_from_quat(quat: ArrayLike) -> Array:
    """Rotation matrix, shape (..., 3, 3), of unit quaternions, shape (..., 4)."""
    w, x, y, z = np.moveaxis(np.asarray(quat, dtype=np.float64), -1, 0)
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quat_from_mat(mat: ArrayLike) -> Array:
    """Unit quaternions, shape (n, 4), of rotation matrices, shape (n, 3, 3); either sign.

    The largest of the four components is found from the diagonal and divides the others (Shepperd 1978).
    """
    m = np.asarray(mat, dtype=np.float64)
    xx, yy, zz = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    wx, wy, wz = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    xy, xz, yz = m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0], m[:, 1, 2] + m[:, 2, 1]
    products = np.stack(  # four times the products of the components, row by row
        (
            np.stack((1.0 + xx + yy + zz, wx, wy, wz), axis=-1),
            np.stack((wx, 1.0 + xx - yy - zz, xy, xz), axis=-1),
            np.stack((wy, xy, 1.0 - xx + yy - zz, yz), axis=-1),
            np.stack((wz, xz, yz, 1.0 - xx - yy + zz), axis=-1),
        ),
        axis=-2,
    )
    largest = np.argmax(np.einsum("nii->ni", products), axis=-1)
    quat = products[np.arange(len(m)), largest]
    return np.asarray(quat / np.linalg.norm(quat, axis=-1, keepdims=True))


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
