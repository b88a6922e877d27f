"""Poses between navigation epochs, for sensors that measure thousands of times between two of them.

Position: a cubic through both positions and velocities (Hermite), or a straight line.  Attitude: the turn from one
epoch to the next about one fixed axis at a constant rate (slerp).  With epochs dt apart, at worst in the middle,

    straight line    |x''| dt^2 / 8          10 ms and 1 g: 0.12 mm           100 ms: 12 mm
    Hermite          |x''''| dt^4 / 384      10 ms and 100 m/s^4: 3 nm        100 ms: 26 um
    slerp            |w'| dt^2 / 8           10 ms and 1 rad/s^2: 13 urad     100 ms: 1.3 mrad, 0.4 m at 300 m

x'' is the acceleration, x'''' its second derivative, w' the angular acceleration.  A velocity error dv, as from the
neglected rotation of a lever arm, causes an error of at most dv dt / 4 with Hermite (opposite errors at both ends); the
straight line does not use velocities.

Sources: Spiegel 2018, section 2.1.4 (poses have to be interpolated); de Boor 1978, ch. IV (errors of the line and of
the cubic); Shoemake 1985 (slerp).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.arrays import Array
from fti.ranging.sensor import Poses

#: Maximum rotation between epochs [rad]: near half a turn its direction is ambiguous.
MAX_TURN_RAD = 3.0


def interpolate_poses(
    times: ArrayLike, epochs: Poses, at: ArrayLike, position: Literal["hermite", "line"] = "hermite"
) -> Poses:
    """Poses at ``at`` (k,) [s] from those of epochs at ``times`` (n,) [s], n >= 2.

    NaN before the first and after the last epoch, next to an epoch that is NaN, and between epochs more than
    ``MAX_TURN_RAD`` apart in attitude.  Velocities are the derivative of the cubic, or a line between the epochs'.
    Raises ValueError for times that do not ascend or do not match the epochs, and for another ``position``.
    """
    place = {"hermite": _hermite, "line": _line}.get(position)
    if place is None:
        raise ValueError(f"position is {position!r}, must be hermite or line")
    knots, when = np.asarray(times, dtype=np.float64), np.asarray(at, dtype=np.float64)
    if knots.shape != (len(epochs),) or len(knots) < 2 or not (np.diff(knots) > 0.0).all():
        raise ValueError(f"times have the shape {knots.shape}, must be ({len(epochs)},), at least 2, ascending")
    before = np.clip(np.searchsorted(knots, when, side="right") - 1, 0, len(knots) - 2)
    step = np.diff(knots)[before]
    share = (when - knots[before]) / step
    share = np.where((share >= 0.0) & (share <= 1.0), share, np.nan)
    origins, vels = place(epochs, before, share[:, None], step[:, None])
    turns = _turn(np.swapaxes(epochs.mats_ls[:-1], -1, -2) @ epochs.mats_ls[1:])
    return Poses(origins, epochs.mats_ls[before] @ _rotation(share[:, None] * turns[before]), vels)


def _line(epochs: Poses, before: NDArray[np.intp], u: Array, step: Array) -> tuple[Array, Array]:
    x0, x1 = epochs.origins_l[before], epochs.origins_l[before + 1]
    v0, v1 = epochs.vels_l[before], epochs.vels_l[before + 1]
    return x0 + u * (x1 - x0), v0 + u * (v1 - v0)


def _hermite(epochs: Poses, before: NDArray[np.intp], u: Array, step: Array) -> tuple[Array, Array]:
    """The cubic with the epochs' positions and velocities, and its derivative."""
    x0, x1 = epochs.origins_l[before], epochs.origins_l[before + 1]
    v0, v1 = epochs.vels_l[before] * step, epochs.vels_l[before + 1] * step
    way = x1 - x0
    third, second = v0 + v1 - 2.0 * way, 3.0 * way - 2.0 * v0 - v1
    return x0 + u * (v0 + u * (second + u * third)), (v0 + u * (2.0 * second + 3.0 * u * third)) / step


def _turn(mats: Array) -> Array:
    """Rotation vectors (n, 3) [rad] of rotation matrices (n, 3, 3); NaN above ``MAX_TURN_RAD``."""
    sine = 0.5 * np.stack(
        (
            mats[:, 2, 1] - mats[:, 1, 2],
            mats[:, 0, 2] - mats[:, 2, 0],
            mats[:, 1, 0] - mats[:, 0, 1],
        ),
        axis=-1,
    )
    angle = np.arctan2(np.linalg.norm(sine, axis=-1), 0.5 * (np.trace(mats, axis1=1, axis2=2) - 1.0))
    angle = np.where(angle <= MAX_TURN_RAD, angle, np.nan)
    return np.asarray(sine / np.sinc(angle / np.pi)[:, None])


def _rotation(turns: Array) -> Array:
    """Rotation matrices (k, 3, 3) of rotation vectors (k, 3) [rad]: Rodrigues' formula."""
    angle = np.linalg.norm(turns, axis=-1)[:, None, None]
    x, y, z = turns.T
    zero = np.zeros_like(x)
    cross = np.stack((zero, -z, y, z, zero, -x, -y, x, zero), axis=-1).reshape(-1, 3, 3)
    twice = turns[:, :, None] * turns[:, None, :] - angle**2 * np.eye(3)
    half = np.sinc(angle / (2.0 * np.pi))
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * half**2 * twice)
