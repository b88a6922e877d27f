"""Rays on a bilinear surface: compiled kernels, float64, exact to rounding, without the interpreter lock.

Traversal: a tree of bounds for each layer (``pyramid``, ``ray_walk``).  The first event in any layer is the result.

Intersection: with u, v in [0, 1] inside a cell the surface is  h + A u + B v + k u v  (eq. 2.52).  With the ray at
(u0, v0) somewhere in the cell and tau counted from there, its height above the surface is the quadratic

    f(tau) = f0 + b tau + a tau^2,     a = -k vx vy,     b = dz - vx (A + k v0) - vy (B + k u0)

and the hit is its smallest positive root inside the cell.  This replaces the two auxiliary planes of eq. 2.53-2.62,
which fail for the vertical ray (2.54) and the plane cell (2.60).  f0 > 0 at the entry, so the root is written as
2 f0 / (-b + sqrt(b^2 - 4 a f0)) for b < 0, which needs no special case for a = 0 and loses no digits.

Many rays take their steps in turn: while the processor waits for the memory of one, it works on the others.  Each ray
takes the steps that it would take alone.

Sources: Spiegel 2018, section 2.2.3, as corrected in docs/errata.md; Tevs, Ihrke, Seidel 2008 (maximum mipmaps).
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fti.arrays import Array, Codes
from fti.kernel import inlined_kernel, kernel
from fti.terrain.memory import array_at
from fti.terrain.pyramid import Pyramid, PyramidAddresses, layers_at
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.ray_state import LEFT, RAY, begin_ray, enter_next_layer, outcome_at_origin, ray_room
from fti.terrain.ray_walk import prefetch_next, step
from fti.terrain.surface import locate

#: Rays that take their steps in turn: while 15 others do, memory is loaded for one.
_TURNS = 16
_NO_RAY = -1

_HIT, _NOTHING, _OUTSIDE = int(RayOutcome.HIT), int(RayOutcome.NOTHING), int(RayOutcome.OUTSIDE)


@inlined_kernel
def _final_outcome(ray: Any, q: PyramidAddresses) -> int:
    """Outcome after the last layer: without an event NOTHING for a ray that ends over the coverage, or OUTSIDE."""
    what: int = ray.outcome
    if what == _NOTHING:
        east = ray.ox + ray.dx * ray.at if ray.dx != 0.0 else ray.ox
        north = ray.oy + ray.dy * ray.at if ray.dy != 0.0 else ray.oy
        what = _NOTHING if locate(layers_at(q), east, north)[0] >= 0 else _OUTSIDE
    return what


@kernel
def first_event(
    q: PyramidAddresses, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, max_range: float
) -> tuple[float, int]:
    """How far along a ray something happens to it, and what (``RayOutcome``); the arguments are those of
    ``cast_one``."""
    ray = array_at(ray_room(), (1,), RAY)[0]
    begin_ray(ray, outcome_at_origin(q, ox, oy, oz), ox, oy, oz, dx, dy, dz, max_range)
    while enter_next_layer(ray, q):
        while ray.level >= 0:
            step(ray, q)
    return ray.at, _final_outcome(ray, q)


@kernel
def cast_one(
    p: Pyramid, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, max_range: float
) -> tuple[float, int]:
    """Range [m] of one ray, NaN unless it hits, and its ``RayOutcome``; for other compiled kernels.

    ox, oy, oz : origin: east, north, up [m]; dx, dy, dz : unit vector; max_range [m], may be infinite
    """
    at, outcome = first_event(p.addresses, ox, oy, oz, dx, dy, dz, max_range)
    return at if outcome == _HIT else math.nan, outcome


@kernel
def cast_rays(
    p: Pyramid,
    origins: Array,
    directions: Array,
    max_range: float,
    begin: int,
    end: int,
    ranges: Array,
    outcomes: Codes,
) -> int:
    """Fill ranges [m] and outcomes (n,) of the rays begin to end; returns the number of directions without length.

    origins    : (n, 3) or (1, 3) for all [m]
    directions : (n, 3) or (1, 3) for all, of any length
    """
    pointless, q = 0, p.addresses
    rays: Any = np.zeros(_TURNS, RAY)
    i, busy = begin, True
    ox, oy, oz, outcome = math.nan, math.nan, math.nan, _NOTHING
    for ray in rays:
        ray.number, ray.level = _NO_RAY, LEFT
    while busy:
        busy = False
        for j in range(_TURNS):
            ray = rays[j]
            if ray.level >= 0:
                step(ray, q)
            elif enter_next_layer(ray, q):
                prefetch_next(ray, q)
            else:
                if ray.number != _NO_RAY:
                    what = _final_outcome(ray, q)
                    ranges[ray.number], outcomes[ray.number] = ray.at if what == _HIT else math.nan, what
                    ray.number = _NO_RAY
                if i < end:
                    o, d = min(i, len(origins) - 1), min(i, len(directions) - 1)
                    if origins[o, 0] != ox or origins[o, 1] != oy or origins[o, 2] != oz:
                        ox, oy, oz = origins[o, 0], origins[o, 1], origins[o, 2]
                        outcome = outcome_at_origin(q, ox, oy, oz)
                    dx, dy, dz = directions[d, 0], directions[d, 1], directions[d, 2]
                    norm = math.sqrt(dx * dx + dy * dy + dz * dz)
                    pointless += norm == 0.0
                    begin_ray(ray, outcome, ox, oy, oz, dx / norm, dy / norm, dz / norm, max_range)
                    ray.number = i
                    i += 1
            busy |= ray.number != _NO_RAY
    return pointless
