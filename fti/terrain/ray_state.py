"""State of a ray between two steps through a layer: a record, and how the ray enters a layer.

It is a record and not a set of local variables so that several rays can take their steps in turn (``ray_cast``).
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fti.kernel import inlined_kernel
from fti.terrain.memory import stack_room
from fti.terrain.pyramid import PyramidAddresses, heights_at, layers_at, trees_at
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.surface import ON_EDGE, Posts, locate, surface

#: Level at which a steep ray begins: nodes of 64 x 64 cells.  It ascends where the ground is far.
_BEGIN = 3
#: A ray that falls more slowly than this [m/m] begins at the top of the tree.
_STEEP = 0.35
#: Distance from the surface within which a point is on it [m].
TOUCH_M = 1e-9
#: Level of a ray that has left its layer, or has met something in it.
LEFT = -1

_HIT, _NOTHING = int(RayOutcome.HIT), int(RayOutcome.NOTHING)
_BURIED, _UNKNOWN = int(RayOutcome.BURIED), int(RayOutcome.UNKNOWN)

_DOUBLES = (
    *("ox", "oy", "oz", "dx", "dy", "dz"),  # origin [m] and unit vector: east, north, up
    *("x0", "y0", "vx", "vy"),  # origin and unit vector in cells of the layer
    *("slow_x", "slow_y"),  # 1 / vx, 1 / vy; infinite for 0
    *("begin", "end"),  # part of the ray that is in the layer [m]
    "t",  # the ray is known to be above the surface up to here [m]
    "at",  # range of the first event so far, or the maximum range [m]
    "cell",  # size of the layer's cells [m]
)
_INTEGERS = (
    "number",  # of the ray among those of a call
    "outcome",  # of the first event so far: a RayOutcome
    "layer",  # number of the layer
    *("nx", "ny"),  # cells of the layer, east and north
    *("limit_x", "limit_y"),  # the same; 0 for a ray that does not move along this axis
    *("east", "north"),  # 1 for a ray that moves east, north; 0 otherwise
    *("first", "top"),  # index of the lowest level of the layer's tree, and number of its highest
    *("start", "columns"),  # index of the layer's first post, and posts in a row
    *("ix", "iy"),  # cell of the ray at t
    "level",  # of the node that is next: 0 for a cell; or LEFT
)
#: A ray; whole lines of the cache.
RAY = np.dtype(
    [(name, np.float64) for name in _DOUBLES] + [(name, np.int64) for name in _INTEGERS] + [("unused", np.int64)],
    align=True,
)
#: Memory for a ray in the frame of the kernel that calls it.
ray_room = stack_room(RAY.itemsize)


@inlined_kernel
def outcome_at_origin(q: PyramidAddresses, ox: float, oy: float, oz: float) -> int:
    """HIT or BURIED where a ray begins on or below the surface, UNKNOWN without an origin, otherwise NOTHING."""
    what = _NOTHING
    if math.isnan(ox + oy + oz):
        what = _UNKNOWN
    elif oz <= q.summit + TOUCH_M:
        above = oz - surface(Posts(heights_at(q), layers_at(q)), ox, oy)[0]
        if above < -TOUCH_M:
            what = _BURIED
        elif above <= TOUCH_M:
            what = _HIT
    return what


@inlined_kernel
def begin_ray(
    ray: Any, outcome: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, max_range: float
) -> None:
    """Set a ray up before its first layer.  outcome : at its origin; anything but NOTHING is final."""
    ray.ox, ray.oy, ray.oz = ox, oy, oz
    ray.dx, ray.dy, ray.dz = dx, dy, dz
    ray.outcome = _UNKNOWN if math.isnan(dx + dy + dz + max_range) else outcome
    ray.at = max_range if ray.outcome == _NOTHING else 0.0
    ray.layer, ray.level = -1, LEFT


@inlined_kernel
def _clip(begin: float, end: float, at: float, speed: float, size: int) -> tuple[float, float]:
    """The part of [begin, end] in which at + speed t lies in [0, size]; empty (end < begin) when there is none."""
    if speed != 0.0:
        first, last = (-ON_EDGE - at) / speed, (size + ON_EDGE - at) / speed
        begin, end = max(begin, min(first, last)), min(end, max(first, last))
    elif not -ON_EDGE <= at <= size + ON_EDGE:
        end = -1.0
    return begin, end


@inlined_kernel
def _enter(ray: Any, q: PyramidAddresses) -> bool:
    """Set a ray up for its layer; False where it passes beside or above all of it."""
    layer, tree = layers_at(q)[ray.layer], trees_at(q)[ray.layer]
    nx, ny, oz, dz = layer.columns - 1, layer.rows - 1, ray.oz, ray.dz
    x0, y0 = (ray.ox - layer.east0) / layer.cell, (ray.oy - layer.north0) / layer.cell
    vx, vy = ray.dx / layer.cell, ray.dy / layer.cell
    begin, end = _clip(0.0, ray.at, x0, vx, nx)
    begin, end = _clip(begin, end, y0, vy, ny)
    inside = begin <= end and oz + min(dz * begin, dz * end) <= tree.highest
    if inside:
        t = max(begin, (tree.highest - oz) / dz) if dz < 0.0 else begin
        ray.x0, ray.y0, ray.vx, ray.vy = x0, y0, vx, vy
        ray.begin, ray.end, ray.t, ray.cell = begin, end, t, layer.cell
        ray.slow_x, ray.limit_x = (1.0 / vx, nx) if vx != 0.0 else (math.inf, 0)
        ray.slow_y, ray.limit_y = (1.0 / vy, ny) if vy != 0.0 else (math.inf, 0)
        ray.nx, ray.ny, ray.east, ray.north = nx, ny, int(vx > 0.0), int(vy > 0.0)
        ray.ix, ray.iy = min(max(int(x0 + vx * t), 0), nx - 1), min(max(int(y0 + vy * t), 0), ny - 1)
        ray.first, ray.top, ray.start, ray.columns = tree.first, tree.top, layer.start, layer.columns
        ray.level = min(tree.top, _BEGIN) if dz < -_STEEP else tree.top
    return inside


@inlined_kernel
def enter_next_layer(ray: Any, q: PyramidAddresses) -> bool:
    """Set a ray up for the next layer that it enters before its first event so far; False without one."""
    entered, last = False, q.n_layers - 1 if ray.outcome == _NOTHING or ray.at > 0.0 else -1
    while not entered and ray.layer < last:
        ray.layer += 1
        entered = _enter(ray, q)
    return entered


@inlined_kernel
def comes_from_a_layer(ray: Any, q: PyramidAddresses, back: float) -> bool:
    """Whether a ray was in another layer just before it entered its layer; back [cells]."""
    t = ray.begin - back * ray.cell / math.hypot(ray.dx, ray.dy)
    return locate(layers_at(q), ray.ox + ray.dx * t, ray.oy + ray.dy * t)[0] >= 0
