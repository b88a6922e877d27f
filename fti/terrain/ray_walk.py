"""Steps of a ray through the tree of a layer, down to the cell that it hits: compiled kernels.

A node whose bound lies under the ray is skipped; otherwise the ray advances to where it meets the bound and descends to
the child there.  Cells are counted in integers, so that a ray along an edge or through a post cannot get lost between
two cells.

The result does not depend on the nodes that a ray visits.  In a cell it is solved from the last of these points:
where the ray enters the layer; where it enters the cell; where it falls below the highest post of the 4 x 4 cells.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fti.kernel import inlined_kernel
from fti.terrain.memory import prefetch
from fti.terrain.pyramid import PyramidAddresses, heights_at, levels_at, maxima_at, nodes_at
from fti.terrain.pyramid_nodes import NODE, slot
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.ray_state import LEFT, TOUCH_M, comes_from_a_layer

#: A ray ascends where it is higher above the bound of a node than this part of the node's width.
_CLIMB = 0.1
#: Step back from the entry into a layer to find the previous layer [cells].
_BACK = 1e-3

_NODE_BYTES = NODE.itemsize
_HIT, _NOTHING = int(RayOutcome.HIT), int(RayOutcome.NOTHING)
_HOLE, _BURIED = int(RayOutcome.HOLE), int(RayOutcome.BURIED)


@inlined_kernel
def _edge_time(edge: int, limit: int, origin: float, slow: float) -> float:
    """Where a ray crosses an edge [m]; infinite for the border of the layer, where the ray ends."""
    return (edge - origin) * slow if 0 < edge < limit else math.inf


@inlined_kernel
def _index(ray: Any, q: PyramidAddresses, level: int) -> int:
    """Index of the node of a level at the ray's cell, among the maxima or the nodes."""
    row = levels_at(q)[ray.first + level]
    return row.start + slot(ray.ix >> 2 * level, ray.iy >> 2 * level, row.wide)  # type: ignore[no-any-return]


@inlined_kernel
def prefetch_next(ray: Any, q: PyramidAddresses) -> None:
    """Begin to load what the next step reads."""
    level = ray.level
    if level > 0:
        prefetch(q.nodes + _NODE_BYTES * _index(ray, q, level))
    elif level == 0:
        prefetch(q.maxima + 4 * _index(ray, q, 0))
        south_west = q.heights + 8 * (ray.start + ray.iy * ray.columns + ray.ix)
        prefetch(south_west)
        prefetch(south_west + 8 * ray.columns)


@inlined_kernel
def _move_within(ray: Any, t: float, jx: int, jy: int, shift: int) -> None:
    """Set the time of a ray, and its cell there, which is within the node jx, jy of 2^shift x 2^shift cells."""
    ray.t = t
    ray.ix = min(max(int(ray.x0 + ray.vx * t), jx << shift), min((jx + 1) << shift, ray.nx) - 1)
    ray.iy = min(max(int(ray.y0 + ray.vy * t), jy << shift), min((jy + 1) << shift, ray.ny) - 1)


@inlined_kernel
def _pass_node(ray: Any, q: PyramidAddresses) -> None:
    """Skip the node of a ray, or descend to the child where the ray meets its bound."""
    level, t = ray.level, ray.t
    shift = 2 * level
    jx, jy = ray.ix >> shift, ray.iy >> shift
    edge_x, edge_y = (jx + ray.east) << shift, (jy + ray.north) << shift
    exit_x = _edge_time(edge_x, ray.limit_x, ray.x0, ray.slow_x)
    exit_y = _edge_time(edge_y, ray.limit_y, ray.y0, ray.slow_y)
    leave = min(exit_x, exit_y, ray.end)
    node = nodes_at(q)[_index(ray, q, level)]
    slope_x, slope_y = np.float64(node.slope_x), np.float64(node.slope_y)
    x, y = ray.x0 + ray.vx * t - (jx << shift), ray.y0 + ray.vy * t - (jy << shift)
    above = ray.oz + ray.dz * t - (np.float64(node.base) + slope_x * x + slope_y * y)
    rate = ray.dz - slope_x * ray.vx - slope_y * ray.vy
    after = above + rate * (leave - t)
    if above <= 0.0 or after <= 0.0:
        ray.level = level - 1
        if above > 0.0:
            _move_within(ray, t - above / rate, jx, jy, shift)
    elif leave >= ray.end:
        ray.level = LEFT
    else:
        _move_within(ray, leave, jx, jy, shift)
        if exit_x <= exit_y:
            ray.ix = edge_x - 1 + ray.east
        else:
            ray.iy = edge_y - 1 + ray.north
        leaves_parent = ray.ix >> (shift + 2) != jx >> 2 or ray.iy >> (shift + 2) != jy >> 2
        if leaves_parent and level < ray.top and after > _CLIMB * ray.cell * (1 << shift):
            ray.level = level + 1


@inlined_kernel
def _distance_in_cell(q: PyramidAddresses, ray: Any, t: float) -> tuple[float, float]:
    """Height [m] of a ray at t above the surface of its cell, and the distance from there to the hit [m]; infinite
    without one."""
    heights, at = heights_at(q), ray.start + ray.iy * ray.columns + ray.ix
    vx, vy = ray.vx, ray.vy
    u, v = ray.x0 + vx * t - ray.ix, ray.y0 + vy * t - ray.iy
    base, north_west = heights[at], heights[at + ray.columns]
    rise_x, rise_y = heights[at + 1] - base, north_west - base
    twist = heights[at + ray.columns + 1] - north_west - rise_x
    f0 = (ray.oz + ray.dz * t - base) - (rise_x * u + v * (rise_y + twist * u))
    a = -twist * vx * vy
    b = ray.dz - vx * (rise_x + twist * v) - vy * (rise_y + twist * u)
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


@inlined_kernel
def _note_event(ray: Any, q: PyramidAddresses, t: float, what: int) -> None:
    """End the ray in its layer; the event is the result where no other layer has an earlier one."""
    if what == _BURIED and comes_from_a_layer(ray, q, _BACK):
        what = _HIT
    if ray.outcome == _NOTHING or t < ray.at:
        ray.at, ray.outcome = t, what
    ray.level = LEFT


@inlined_kernel
def _solve_cell(ray: Any, q: PyramidAddresses, highest: float, exit_t: float) -> None:
    """Solve the cell of a ray, which may end there: HIT, HOLE, or BURIED at the border of the layer, below the
    surface."""
    entry_x = _edge_time(ray.ix + 1 - ray.east, ray.limit_x, ray.x0, ray.slow_x)
    entry_y = _edge_time(ray.iy + 1 - ray.north, ray.limit_y, ray.y0, ray.slow_y)
    t = ray.begin
    if t < entry_x < math.inf:
        t = entry_x
    if t < entry_y < math.inf:
        t = entry_y
    if ray.dz < 0.0 and ray.top > 0:
        t = max(t, (np.float64(nodes_at(q)[_index(ray, q, 1)].highest) - ray.oz) * (1.0 / ray.dz))
    f0, way = _distance_in_cell(q, ray, t)
    if highest == math.inf:
        _note_event(ray, q, t, _HOLE)
    elif way <= max(exit_t, t) - t:
        buried = f0 < -TOUCH_M and t == ray.begin and t > 0.0
        _note_event(ray, q, t + way, _BURIED if buried else _HIT)


@inlined_kernel
def _pass_cells(ray: Any, q: PyramidAddresses) -> None:
    """Follow a ray through its group of 4 x 4 cells, to its end or into the next group."""
    maxima, bx, by, t = maxima_at(q), ray.ix >> 2, ray.iy >> 2, ray.t
    while ray.level == 0:
        exit_x = _edge_time(ray.ix + ray.east, ray.limit_x, ray.x0, ray.slow_x)
        exit_y = _edge_time(ray.iy + ray.north, ray.limit_y, ray.y0, ray.slow_y)
        leave = min(exit_x, exit_y, ray.end)
        highest = np.float64(maxima[_index(ray, q, 0)])
        if ray.oz + ray.dz * (leave if ray.dz < 0.0 else t) - highest <= TOUCH_M:
            _solve_cell(ray, q, highest, leave)
        if leave >= ray.end:
            ray.level = LEFT
        elif exit_x <= exit_y:
            ray.ix += 2 * ray.east - 1
        else:
            ray.iy += 2 * ray.north - 1
        ray.t = t = leave
        if ray.level == 0 and (ray.ix >> 2 != bx or ray.iy >> 2 != by):
            ray.level = 1


@inlined_kernel
def step(ray: Any, q: PyramidAddresses) -> None:
    """The next step of a ray through its layer; its level is ``LEFT`` after the last one."""
    if ray.level > 0:
        _pass_node(ray, q)
    else:
        _pass_cells(ray, q)
    prefetch_next(ray, q)
