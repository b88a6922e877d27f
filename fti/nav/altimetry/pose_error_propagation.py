"""Compiled kernels: range and height errors caused by pose errors over sampled ground, trial by trial.

    pencil     d(xi) - d(0) = -(v_D + h(M') - h(M)) / cos(theta),                        v = dP + psi x w
               h(xi) - h(0) = (h(P) - h(N))' - (h(P) - h(N)) + v_D + h(M') - h(M)
    nearest    d(xi) - d(0) = -u . (dP + psi x l)
               h(xi) - h(0) = (h(P) - h(N))' - (h(P) - h(N)) + cos(theta) u . (dP + psi x l)

xi = (dP, psi) is an error of the pose, w the vector from P to M, l the lever arm.  M' is the point where the moved ray
meets the ground, found by fixed-point steps; M of a nearest return stays fixed.  See
``variance.sampled_height_variance`` and ``variance.sampled_range_variance``.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import cross
from fti.kernel import kernel
from fti.terrain.pyramid import Pyramid, PyramidAddresses, heights_at, layers_at
from fti.terrain.surface import Posts, surface

#: Fixed-point steps of a footprint: each contracts with slope x tan(look angle), 0.33 at 30 deg each.
_FOOTPRINT_STEPS = 4
_NADIR_STEPS = 3


def _trials() -> Array:
    drawn = np.random.default_rng(64).standard_normal((32, 6))
    pairs = np.concatenate((drawn, -drawn))
    return np.asarray(pairs @ np.linalg.cholesky(np.linalg.inv(pairs.T @ pairs / len(pairs))))


#: 64 errors of a pose (64, 6), Gaussian and in pairs of opposite sign, whose covariance is 1 exactly.
TRIALS = _trials()


@kernel
def _up(q: PyramidAddresses, at: Array, mat_ln: Array, north: float, east: float, down: float) -> float:
    """The surface [m] at a point of the frame plus a displacement in north, east, down."""
    to_east = at[0] + mat_ln[0, 0] * north + mat_ln[0, 1] * east + mat_ln[0, 2] * down
    to_north = at[1] + mat_ln[1, 0] * north + mat_ln[1, 1] * east + mat_ln[1, 2] * down
    up, _, _ = surface(Posts(heights_at(q), layers_at(q)), to_east, to_north)
    return up


@kernel
def height_over_nadir(q: PyramidAddresses, at: Array, mat_ln: Array, north: float, east: float, down: float) -> float:
    """h(P) - h(N) [m] of a P moved by that displacement."""
    height = 0.0
    moved = at[2] + mat_ln[2, 0] * north + mat_ln[2, 1] * east + mat_ln[2, 2] * down
    for _ in range(_NADIR_STEPS):
        height = (moved - _up(q, at, mat_ln, north, east, down + height)) / -mat_ln[2, 2]
    return height


@kernel
def mean_square_errors(
    p: Pyramid, at: Array, mat_ln: Array, lever: Array, u: Array, slant_range: float, trials: Array, nearest: bool
) -> tuple[float, float]:
    """E[(h(xi) - h(0))^2] and E[(d(xi) - d(0))^2] [m^2] over the trials over known ground; NaN for less than half.

    The largest errors leave known ground first: the spread of the few that remain would be too small.

    at     : P (3,) in the terrain's frame [m];  mat_ln : (3, 3);  lever, u : (3,), north, east, down
    trials : (k, 6) errors of the pose [m, rad]
    """
    q = p.addresses  # a call with the argument p counts references and takes longer
    way = slant_range * u + lever
    point = at + mat_ln @ way
    height = height_over_nadir(q, at, mat_ln, 0.0, 0.0, 0.0)
    ground = _up(q, point, mat_ln, 0.0, 0.0, 0.0)
    total, count, of_range, met = 0.0, 0, 0.0, 0
    for k in range(len(trials)):
        x, psi = trials[k, :3], trials[k, 3:]
        change = height_over_nadir(q, at, mat_ln, x[0], x[1], x[2]) - height
        arm = lever if nearest else way
        turn_n, turn_e, turn_d = cross((psi[0], psi[1], psi[2]), (arm[0], arm[1], arm[2]))
        v = x + np.array([turn_n, turn_e, turn_d])
        if nearest:
            nearer = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
            change += u[2] * nearer
        else:
            risen = 0.0
            for _ in range(_FOOTPRINT_STEPS):
                back = (v[2] + risen) / u[2]
                risen = _up(q, point, mat_ln, v[0] - back * u[0], v[1] - back * u[1], 0.0) - ground
            change += v[2] + risen
            nearer = (v[2] + risen) / u[2]
        if math.isfinite(change):
            total += change * change
            count += 1
        if math.isfinite(nearer):
            of_range += nearer * nearer
            met += 1
    n_trials = len(trials)
    return total / count if 2 * count >= n_trials else math.nan, of_range / met if 2 * met >= n_trials else math.nan
