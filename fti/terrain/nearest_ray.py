"""The nearest return of a bundle of rays: a compiled kernel for many poses."""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array, Codes
from fti.kernel import kernel
from fti.terrain.pyramid import Pyramid, PyramidAddresses, layers_at
from fti.terrain.ray_cast import first_event
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.surface import locate

#: Maximum moves of the search per halving of its step, to limit a walk along a level ridge.
_MOVES = 4

_HIT, _OUTSIDE, _HOLE = int(RayOutcome.HIT), int(RayOutcome.OUTSIDE), int(RayOutcome.HOLE)


@kernel
def _direction(mat: Array, ax: float, ay: float) -> tuple[float, float, float]:
    """Unit vector whose angle from the sensor's +z is |(ax, ay)|, towards (ax, ay)."""
    off = math.hypot(ax, ay)
    scale = math.sin(off) / off if off > 0.0 else 1.0
    sx, sy, sz = ax * scale, ay * scale, math.cos(off)
    return (
        mat[0, 0] * sx + mat[0, 1] * sy + mat[0, 2] * sz,
        mat[1, 0] * sx + mat[1, 1] * sy + mat[1, 2] * sz,
        mat[2, 0] * sx + mat[2, 1] * sy + mat[2, 2] * sz,
    )


@kernel
def _leaves(q: PyramidAddresses, o: Array, mat: Array, angles: Array, distance: float) -> bool:
    """Whether one of the rays has left the coverage after ``distance``."""
    for k in range(len(angles)):
        dx, dy, _ = _direction(mat, angles[k, 0], angles[k, 1])
        if locate(layers_at(q), o[0] + dx * distance, o[1] + dy * distance)[0] < 0:
            return True
    return False


@kernel
def _nearest(
    q: PyramidAddresses, o: Array, mat: Array, angles: Array, half_width: float, steps: int, max_range: float
) -> tuple[float, float, float, int]:
    """Range and angles of the nearest return at one pose, and the outcome of the bundle; see ``cast_bundle_min``."""
    nearest, at_x, at_y, hole, outcome = max_range, 0.0, 0.0, math.inf, -1
    for k in range(len(angles)):
        dx, dy, dz = _direction(mat, angles[k, 0], angles[k, 1])
        r, what = first_event(q, o[0], o[1], o[2], dx, dy, dz, nearest)
        if what == _HOLE:
            hole = min(hole, r)
        if what == _HIT and (outcome != _HIT or r < nearest):
            nearest, at_x, at_y, outcome = r, angles[k, 0], angles[k, 1], _HIT
        elif outcome < 0:
            outcome = what
    step = 0.5 * math.hypot(angles[1, 0], angles[1, 1]) if len(angles) > 1 else 0.0
    halved = 0 if outcome == _HIT else steps
    for _ in range(_MOVES * steps):
        if halved == steps:
            break
        centre_x, centre_y = at_x, at_y
        for k in range(6):
            ax = centre_x + step * math.cos(k * math.pi / 3.0)
            ay = centre_y + step * math.sin(k * math.pi / 3.0)
            if math.hypot(ax, ay) <= half_width:
                dx, dy, dz = _direction(mat, ax, ay)
                r, what = first_event(q, o[0], o[1], o[2], dx, dy, dz, nearest)
                if what == _HIT and r < nearest:
                    nearest, at_x, at_y = r, ax, ay
        if at_x == centre_x and at_y == centre_y:
            step *= 0.5
            halved += 1
    if hole < nearest:
        outcome = _HOLE
    elif outcome == _HIT and _leaves(q, o, mat, angles, nearest):
        outcome = _OUTSIDE
    return nearest, at_x, at_y, outcome


@kernel
def cast_bundle_min(
    p: Pyramid, origins: Array, mats_ls: Array, angles: Array, half_width: float, steps: int, max_range: float
) -> tuple[Array, Array, Codes]:
    """The nearest return of a bundle of rays for many poses: range (n,) [m], angles (n, 2) [rad] and outcome (n,).

    Each ray is cast only as far as the nearest return so far.  Then six rays around the nearest one are cast, at half
    the spacing of the bundle and inside its half width; the search moves while one is nearer, and otherwise halves
    the spacing, ``steps`` times in all.  Range and angles are NaN without a return, and where a nearer one is possible:
    a ray passes over a hole before (HOLE), or leaves the coverage before (OUTSIDE).  Without a return the outcome is
    that of the first ray.

    origins : (n, 3) [m] east, north, up; mats_ls : (n, 3, 3) sensor to local frame; half_width [rad]
    angles  : (k, 2) [rad] angle from the boresight times the direction across it: the centre first, then a
              neighbour of the centre, whose distance is the spacing of the bundle
    """
    ranges, places = np.full(len(origins), np.nan), np.full((len(origins), 2), np.nan)
    outcomes = np.empty(len(origins), np.uint8)
    for i in range(len(origins)):
        r, ax, ay, outcomes[i] = _nearest(p.addresses, origins[i], mats_ls[i], angles, half_width, steps, max_range)
        if outcomes[i] == _HIT:
            ranges[i], places[i, 0], places[i, 1] = r, ax, ay
    return ranges, places, outcomes
