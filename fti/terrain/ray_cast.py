"""Rays on a bilinear surface: compiled kernels, float64, exact to rounding, without the interpreter lock.

Traversal: a tree of maxima for each layer (``pyramid``).  A node whose maximum lies under the ray is skipped; otherwise
the ray advances to the height of that maximum and descends to the child there, down to one cell.  Cells are counted in
integers, so that a ray along an edge or through a post cannot get lost between two cells.  The first event in any layer
is the result.

Intersection: with u, v in [0, 1] inside a cell the surface is  h + A u + B v + k u v  (eq. 2.52).  With the ray at
(u0, v0) somewhere in the cell and tau counted from there, its height above the surface is the quadratic

    f(tau) = f0 + b tau + a tau^2,     a = -k vx vy,     b = dz - vx (A + k v0) - vy (B + k u0)

and the hit is its smallest positive root inside the cell.  This replaces the two auxiliary planes of eq. 2.53-2.62,
which fail for the vertical ray (2.54) and the plane cell (2.60).  f0 > 0 at the entry, so the root is written as
2 f0 / (-b + sqrt(b^2 - 4 a f0)) for b < 0, which needs no special case for a = 0 and loses no digits.

Sources: Spiegel 2018, section 2.2.3, as corrected in docs/errata.md; Tevs, Ihrke, Seidel 2008 (maximum mipmaps).
"""

# ruff: noqa: PLR0915, PLR0917 - compiled kernels are long and take their scalars by position

from __future__ import annotations

import math

from fti.arrays import Array, Codes
from fti.kernel import kernel
from fti.terrain.pyramid import (
    Pyramid,
    PyramidAddresses,
    heights_at,
    layers_at,
    levels_at,
    maxima_at,
    slot,
    trees_at,
)
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.surface import ON_EDGE, Posts, locate, surface

#: Initial level of a ray: nodes of 64 x 64 cells.  It ascends where the ground is far.
_BEGIN = 3
#: Distance from the surface within which a point is on it [m].
_TOUCH_M = 1e-9
#: Step back from the entry into a layer to find the previous layer [cells].
_BACK = 1e-3

_HIT, _NOTHING, _OUTSIDE = int(RayOutcome.HIT), int(RayOutcome.NOTHING), int(RayOutcome.OUTSIDE)
_HOLE, _BURIED, _UNKNOWN = int(RayOutcome.HOLE), int(RayOutcome.BURIED), int(RayOutcome.UNKNOWN)


@kernel
def _clip(begin: float, end: float, at: float, speed: float, size: int) -> tuple[float, float]:
    """The part of [begin, end] in which at + speed t lies in [0, size]; empty (end < begin) when there is none."""
    if speed != 0.0:
        first, last = (-ON_EDGE - at) / speed, (size + ON_EDGE - at) / speed
        begin, end = max(begin, min(first, last)), min(end, max(first, last))
    elif not -ON_EDGE <= at <= size + ON_EDGE:
        end = -1.0
    return begin, end


@kernel
def _hit_cell(
    base: float,
    rise_x: float,
    rise_y: float,
    twist: float,
    u: float,
    v: float,
    z: float,
    vx: float,
    vy: float,
    dz: float,
) -> tuple[float, float]:
    """Height of a ray at u, v, z above the surface of its cell, and the distance to the hit; infinite without one."""
    f0 = (z - base) - (rise_x * u + v * (rise_y + twist * u))
    a = -twist * vx * vy
    b = dz - vx * (rise_x + twist * v) - vy * (rise_y + twist * u)
    disc = b * b - 4.0 * a * f0
    way = math.inf
    if f0 <= 0.0:
        way = 0.0
    elif disc >= 0.0:
        if b < 0.0:
            way = 2.0 * f0 / (-b + math.sqrt(disc))
        elif a < 0.0:
            way = -(b + math.sqrt(disc)) / (2.0 * a)
    return f0, way


@kernel
def _walk(
    q: PyramidAddresses, k: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, max_range: float
) -> tuple[float, int]:
    """The first event of a ray in layer k alone: its distance, and HIT, HOLE, BURIED or NOTHING.

    BURIED: the ray enters the layer from its side, below the surface.
    """
    heights, maxima, levels = heights_at(q), maxima_at(q), levels_at(q)
    layer, tree = layers_at(q)[k], trees_at(q)[k]
    start, columns = layer.start, layer.columns
    nx, ny, first, top = columns - 1, layer.rows - 1, tree.first, tree.top
    x0, y0 = (ox - layer.east0) / layer.cell, (oy - layer.north0) / layer.cell
    vx, vy = dx / layer.cell, dy / layer.cell
    begin, end = _clip(0.0, max_range, x0, vx, nx)
    begin, end = _clip(begin, end, y0, vy, ny)
    going = begin <= end and oz + min(dz * begin, dz * end) <= tree.highest
    slowness_x = 1.0 / vx if vx != 0.0 else math.inf
    slowness_y = 1.0 / vy if vy != 0.0 else math.inf
    slowness_z = 1.0 / dz if dz != 0.0 else math.inf
    east, north = int(vx > 0.0), int(vy > 0.0)
    t, what = begin, _NOTHING
    ix, iy = min(max(int(x0 + vx * t), 0), nx - 1), min(max(int(y0 + vy * t), 0), ny - 1)
    level = min(top, _BEGIN)
    while going:
        shift = 2 * level
        jx, jy = ix >> shift, iy >> shift
        edge_x, edge_y = (jx + east) << shift, (jy + north) << shift
        exit_x = (edge_x - x0) * slowness_x if vx != 0.0 and 0 < edge_x < nx else math.inf
        exit_y = (edge_y - y0) * slowness_y if vy != 0.0 and 0 < edge_y < ny else math.inf
        last_x, last_y = min((jx + 1) << shift, nx) - 1, min((jy + 1) << shift, ny) - 1
        leave = max(min(exit_x, exit_y, end), t)
        highest = maxima[levels[first + level].start + slot(jx, jy, levels[first + level].wide)]
        over = oz + dz * (leave if dz < 0.0 else t) > highest
        if not over and level > 0:
            level -= 1
            dive = (highest - oz) * slowness_z
            if dz < 0.0 and dive > t:
                t = dive
                ix = min(max(int(x0 + vx * t), jx << shift), last_x)
                iy = min(max(int(y0 + vy * t), jy << shift), last_y)
        else:
            if not over:
                u, v = x0 + vx * t - ix, y0 + vy * t - iy
                at = start + iy * columns + ix
                base, north_west = heights[at], heights[at + columns]
                rise_x = heights[at + 1] - base
                twist = heights[at + columns + 1] - north_west - rise_x
                f0, way = _hit_cell(base, rise_x, north_west - base, twist, u, v, oz + dz * t, vx, vy, dz)
                if highest == math.inf:
                    what = _HOLE
                elif way <= leave - t:
                    what = _BURIED if f0 < -_TOUCH_M and t == begin and begin > 0.0 else _HIT
                    t += way
            going = what == _NOTHING and leave < end
            if going:
                t = leave
                if exit_x <= exit_y:
                    ix = edge_x - 1 + east
                    iy = min(max(int(y0 + vy * t), jy << shift), last_y)
                else:
                    iy = edge_y - 1 + north
                    ix = min(max(int(x0 + vx * t), jx << shift), last_x)
                if level < top and (ix >> (shift + 2) != jx >> 2 or iy >> (shift + 2) != jy >> 2):
                    level += 1
    return t, what


@kernel
def _comes_from_a_layer(q: PyramidAddresses, k: int, ox: float, oy: float, dx: float, dy: float, t: float) -> bool:
    """Whether a ray was in another layer just before it entered layer k at t."""
    back = _BACK * layers_at(q)[k].cell / math.hypot(dx, dy)
    return locate(layers_at(q), ox + dx * (t - back), oy + dy * (t - back))[0] >= 0


@kernel
def _outcome_at_origin(q: PyramidAddresses, ox: float, oy: float, oz: float) -> int:
    """HIT or BURIED where a ray begins on or below the surface, otherwise NOTHING."""
    above = oz - surface(Posts(heights_at(q), layers_at(q)), ox, oy)[0]
    what = _NOTHING
    if above < -_TOUCH_M:
        what = _BURIED
    elif above <= _TOUCH_M:
        what = _HIT
    return what


@kernel
def _miss_outcome(q: PyramidAddresses, east: float, north: float) -> int:
    """NOTHING where a ray without a hit ends over the coverage, otherwise OUTSIDE."""
    return _NOTHING if locate(layers_at(q), east, north)[0] >= 0 else _OUTSIDE


@kernel
def first_event(
    q: PyramidAddresses, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, max_range: float
) -> tuple[float, int]:
    """How far along a ray something happens to it, and what (``RayOutcome``); the arguments are those of
    ``cast_one``."""
    at, outcome = 0.0, _NOTHING
    if math.isnan(ox + oy + oz + dx + dy + dz + max_range):
        outcome = _UNKNOWN
    elif oz <= q.summit + _TOUCH_M:
        outcome = _outcome_at_origin(q, ox, oy, oz)
    if outcome == _NOTHING:
        at = max_range
        for k in range(q.n_layers):
            t, what = _walk(q, k, ox, oy, oz, dx, dy, dz, at)
            if what == _BURIED and _comes_from_a_layer(q, k, ox, oy, dx, dy, t):
                what = _HIT
            if what != _NOTHING and (outcome == _NOTHING or t < at):
                at, outcome = t, what
        if outcome == _NOTHING:
            outcome = _miss_outcome(q, ox + dx * at if dx != 0.0 else ox, oy + dy * at if dy != 0.0 else oy)
    return at, outcome


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
    for i in range(begin, end):
        o, d = origins[min(i, len(origins) - 1)], directions[min(i, len(directions) - 1)]
        norm = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        pointless += norm == 0.0
        at, what = first_event(q, o[0], o[1], o[2], d[0] / norm, d[1] / norm, d[2] / norm, max_range)
        ranges[i], outcomes[i] = at if what == _HIT else math.nan, what
    return pointless
