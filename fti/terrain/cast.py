"""Rays on a bilinear surface: compiled kernels, float64, exact to rounding, without the interpreter lock.

Traversal: a quadtree of cell maxima (maximum mipmap).  A node whose maximum lies under the ray is skipped whole;
otherwise its child at the ray's entry is looked at, down to one cell.  Cells are counted in integers, so that a ray
along an edge or through a post cannot get lost between two cells.

Intersection: with u, v in [0, 1] inside a cell the surface is  h + A u + B v + k u v  (eq. 2.52).  With the entry
point of the ray at (u0, v0) and tau counted from there, the height of the ray above the surface is the quadratic

    f(tau) = f0 + b tau + a tau^2,     a = -k vx vy,     b = dz - vx (A + k v0) - vy (B + k u0)

and the hit is its smallest positive root inside the cell.  This replaces the two auxiliary planes of eq. 2.53-2.62,
which fail for the vertical ray (2.54) and the plane cell (2.60).  f0 > 0 at the entry; so the root is written as
2 f0 / (-b + sqrt(b^2 - 4 a f0)) for b < 0, which needs no case for a = 0 and loses no digits.

Sources: Spiegel 2018, section 2.2.3, as corrected in docs/errata.md; Tevs, Ihrke, Seidel 2008 (maximum mipmaps).
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kernel = TypeVar("Kernel", bound=Callable[..., Any])

#: A root may lie this far behind the exit of its cell, relative to the range: rounding at a shared edge.
_EDGE = 1e-12
_MISS = -1.0
#: Moves of the search for the nearest return, per halving of its step; more would be a walk along a level ridge.
_MOVES = 4


def _kernel(function: Kernel) -> Kernel:
    """Compile on the first call, keep the code on disk, release the interpreter lock; no reordering of sums."""
    return cast(Kernel, numba.njit(nogil=True, cache=True, error_model="numpy")(function))


class Pyramid(NamedTuple):
    """A surface for the kernels.

    heights         : (rows, columns) [m], row 0 south
    maxima          : maximum of each node, levels one after another, each row by row
    offsets, widths : where a level begins in ``maxima``, and its nodes per row
    cell, east0, north0 [m]
    """

    heights: Array
    maxima: Array
    offsets: NDArray[np.int64]
    widths: NDArray[np.int64]
    cell: float
    east0: float
    north0: float


def build_pyramid(heights: Array, cell: float, east0: float, north0: float) -> Pyramid:
    """The quadtree of cell maxima; level 0 is one node per cell, the last level one node in all."""
    west, east = heights[:, :-1], heights[:, 1:]
    pairs = np.maximum(west, east)
    levels = [np.maximum(pairs[:-1], pairs[1:])]
    while levels[-1].size > 1:
        below = levels[-1]
        padding = ((0, below.shape[0] % 2), (0, below.shape[1] % 2))
        even = np.pad(below, padding, constant_values=-np.inf)
        levels.append(even.reshape(even.shape[0] // 2, 2, even.shape[1] // 2, 2).max(axis=(1, 3)))
    sizes = [level.size for level in levels]
    offsets = np.concatenate(([0], np.cumsum(sizes)[:-1])).astype(np.int64)
    widths = np.array([level.shape[1] for level in levels], dtype=np.int64)
    return Pyramid(heights, np.concatenate([level.ravel() for level in levels]), offsets, widths, cell, east0, north0)


@_kernel
def _hit_cell(
    heights: Array, ix: int, iy: int, x0: float, y0: float, oz: float, vx: float, vy: float, dz: float, t: float
) -> tuple[float, float]:
    """Height of the ray above the cell's surface at its entry t, and the way from there to the hit (or _MISS)."""
    u = min(max(x0 + vx * t - ix, 0.0), 1.0)
    v = min(max(y0 + vy * t - iy, 0.0), 1.0)
    base = heights[iy, ix]
    rise_x = heights[iy, ix + 1] - base
    rise_y = heights[iy + 1, ix] - base
    twist = heights[iy + 1, ix + 1] - heights[iy + 1, ix] - rise_x
    f0 = (oz + dz * t - base) - (rise_x * u + v * (rise_y + twist * u))
    a = -twist * vx * vy
    b = dz - vx * (rise_x + twist * v) - vy * (rise_y + twist * u)
    disc = b * b - 4.0 * a * f0
    if f0 <= 0.0 or disc < 0.0:
        return f0, _MISS
    if b < 0.0:
        return f0, 2.0 * f0 / (-b + math.sqrt(disc))
    if a < 0.0:
        return f0, -(b + math.sqrt(disc)) / (2.0 * a)
    return f0, _MISS


@_kernel
def _clip(begin: float, end: float, at: float, speed: float, size: int) -> tuple[float, float]:
    """The part of [begin, end] in which at + speed t lies in [0, size]; empty (end < begin) when there is none."""
    if speed == 0.0:
        return (begin, end) if 0.0 <= at <= size else (begin, -1.0)
    first, last = (0.0 - at) / speed, (size - at) / speed
    return max(begin, min(first, last)), min(end, max(first, last))


@_kernel
def _exit(at: float, speed: float, node: int, level: int, size: int) -> float:
    """Ray parameter at which at + speed t leaves a node (or the grid's edge, whichever is first)."""
    if speed > 0.0:
        return (min((node + 1) << level, size) - at) / speed
    if speed < 0.0:
        return ((node << level) - at) / speed
    return math.inf


@_kernel
def _cast_ray(p: Pyramid, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, max_range: float) -> float:
    """Range to the surface along the unit vector (dx, dy, dz), NaN when there is no hit."""
    ny, nx = p.heights.shape[0] - 1, p.heights.shape[1] - 1
    x0, y0 = (ox - p.east0) / p.cell, (oy - p.north0) / p.cell
    vx, vy = dx / p.cell, dy / p.cell
    if math.isnan(x0 + y0 + oz + vx + vy + dz + max_range):
        return math.nan
    begin, end = _clip(0.0, max_range, x0, vx, nx)
    begin, end = _clip(begin, end, y0, vy, ny)
    if end < begin:
        return math.nan
    t = begin
    ix = min(max(int(np.floor(x0 + vx * t)), 0), nx - 1)
    iy = min(max(int(np.floor(y0 + vy * t)), 0), ny - 1)
    top = len(p.offsets) - 1
    level = top
    while True:
        jx, jy = ix >> level, iy >> level
        exit_x, exit_y = _exit(x0, vx, jx, level, nx), _exit(y0, vy, jy, level, ny)
        t_out = max(min(exit_x, exit_y, end), t)
        highest = p.maxima[p.offsets[level] + jy * p.widths[level] + jx]
        if oz + min(dz * t, dz * t_out) <= highest:
            if level > 0:
                level -= 1
                continue
            f0, way = _hit_cell(p.heights, ix, iy, x0, y0, oz, vx, vy, dz, t)
            if f0 <= 0.0:  # at the origin, by rounding on an edge, or under the surface at the side of the coverage
                return math.nan if t == begin and begin > 0.0 else t
            if 0.0 <= way <= t_out - t + _EDGE * (1.0 + t_out):
                return min(t + way, max_range)
        if t_out >= end:
            return math.nan
        t = t_out
        if exit_x <= exit_y:
            ix = (jx + 1) << level if vx > 0.0 else (jx << level) - 1
            iy = min(max(int(np.floor(y0 + vy * t)), jy << level), min((jy + 1) << level, ny) - 1)
        else:
            iy = (jy + 1) << level if vy > 0.0 else (jy << level) - 1
            ix = min(max(int(np.floor(x0 + vx * t)), jx << level), min((jx + 1) << level, nx) - 1)
        if level < top and (ix >> (level + 1) != jx >> 1 or iy >> (level + 1) != jy >> 1):
            level += 1


@_kernel
def cast_rays(p: Pyramid, origins: Array, directions: Array, max_range: float) -> Array:
    """Ranges (n,) [m] of rays from origins (n, 3) [m] along unit vectors (n, 3); NaN where nothing is hit."""
    ranges = np.empty(len(origins))
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        ranges[i] = _cast_ray(p, o[0], o[1], o[2], d[0], d[1], d[2], max_range)
    return ranges


@_kernel
def _cast_angle(p: Pyramid, o: Array, mat: Array, ax: float, ay: float, max_range: float) -> float:
    """Range along the direction whose angle from the sensor's +z is |(ax, ay)|, towards (ax, ay)."""
    off = math.hypot(ax, ay)
    scale = math.sin(off) / off if off > 0.0 else 1.0
    sx, sy, sz = ax * scale, ay * scale, math.cos(off)
    dx = mat[0, 0] * sx + mat[0, 1] * sy + mat[0, 2] * sz
    dy = mat[1, 0] * sx + mat[1, 1] * sy + mat[1, 2] * sz
    dz = mat[2, 0] * sx + mat[2, 1] * sy + mat[2, 2] * sz
    return _cast_ray(p, o[0], o[1], o[2], dx, dy, dz, max_range)


@_kernel
def cast_bundle_min(
    p: Pyramid, origins: Array, mats_ls: Array, angles: Array, half_width: float, steps: int, max_range: float
) -> tuple[Array, Array]:
    """The nearest return of a bundle of rays for many poses: range (n,) [m] and angles (n, 2) [rad]; NaN without one.

    Each ray is cast only as far as the nearest return so far.  Then six rays around the nearest one are tried, at half
    the spacing of the bundle and inside its half width; the search moves while one is nearer, and otherwise halves
    the spacing, ``steps`` times in all.

    origins : (n, 3) [m] east, north, up; mats_ls : (n, 3, 3) sensor to local frame; half_width [rad]
    angles  : (k, 2) [rad] angle from the boresight times the direction across it: the centre first, then a
              neighbour of the centre, whose distance is the spacing of the bundle
    """
    ranges, places = np.full(len(origins), np.nan), np.full((len(origins), 2), np.nan)
    for i in range(len(origins)):
        o, mat = origins[i], mats_ls[i]
        nearest, at_x, at_y = math.inf, 0.0, 0.0
        for k in range(len(angles)):
            r = _cast_angle(p, o, mat, angles[k, 0], angles[k, 1], min(nearest, max_range))
            if r < nearest:
                nearest, at_x, at_y = r, angles[k, 0], angles[k, 1]
        step = 0.5 * math.hypot(angles[1, 0], angles[1, 1]) if len(angles) > 1 else 0.0
        halved = 0 if nearest < math.inf else steps
        for _ in range(_MOVES * steps):
            if halved == steps:
                break
            centre_x, centre_y = at_x, at_y
            for k in range(6):
                ax = centre_x + step * math.cos(k * math.pi / 3.0)
                ay = centre_y + step * math.sin(k * math.pi / 3.0)
                if math.hypot(ax, ay) <= half_width:
                    r = _cast_angle(p, o, mat, ax, ay, nearest)
                    if r < nearest:
                        nearest, at_x, at_y = r, ax, ay
            if at_x == centre_x and at_y == centre_y:
                step *= 0.5
                halved += 1
        if nearest < math.inf:
            ranges[i], places[i, 0], places[i, 1] = nearest, at_x, at_y
    return ranges, places


def warm_up() -> None:
    """Compile the kernels or load them from the cache (seconds on the first start), before time matters."""
    flat = build_pyramid(np.zeros((3, 3)), 1.0, -1.0, -1.0)
    origin = np.array([[0.0, 0.0, 5.0]])
    cast_rays(flat, origin, np.array([[0.0, 0.0, -1.0]]), 10.0)
    cast_bundle_min(flat, origin, np.diag([1.0, -1.0, -1.0])[None], np.zeros((1, 2)), 0.1, 1, 10.0)
