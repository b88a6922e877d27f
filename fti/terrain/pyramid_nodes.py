"""Nodes of the ray caster's trees: upper bounds of the surface, and how they are made.

The bound of a cell is its highest post.  That of a higher node is a plane above all its posts, by their mean slope.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.kernel import kernel
from fti.terrain.surface import Records, locate

Maxima = NDArray[np.float32]

#: Added to a plane [m]: rounding errors of the height of a ray above it.
_MARGIN_M = 1e-6

#: A node of level 1 or higher: its highest post [m], slope of its plane to east and north [m per cell], and height
#: [m] of the plane at the node's south-west corner.
NODE = np.dtype([("highest", np.float32), ("slope_x", np.float32), ("slope_y", np.float32), ("base", np.float32)])
#: A level of a layer's tree: index of its first maximum (level 0) or node, and number of groups of 4 x 4 in a row.
LEVEL = np.dtype([("start", np.int64), ("wide", np.int64)], align=True)
#: A layer's tree: index of its first level, number of its last one, and the highest maximum [m].
TREE = np.dtype([("first", np.int64), ("top", np.int64), ("highest", np.float64)], align=True)


@kernel
def _rounded_up(value: float) -> np.float32:
    """The smallest single precision value that is not below a double."""
    single = np.float32(value)
    if np.float64(single) < value:
        single = np.nextafter(single, np.float32(math.inf))
    return single


@kernel
def slot(x: int, y: int, wide: int) -> int:
    """Index of a node within its level."""
    return (((y >> 2) * wide + (x >> 2)) << 4) + ((y & 3) << 2) + (x & 3)


@kernel
def _fill_cells(heights: Array, layers: Records, k: int, nodes: Maxima, wide: int) -> None:
    """Level 0: highest of four posts, +inf for a hole, -inf where a finer layer lies."""
    start, columns, cell = layers[k].start, layers[k].columns, layers[k].cell
    for row in range(layers[k].rows - 1):
        for column in range(columns - 1):
            at = start + row * columns + column
            south_west, south_east = heights[at], heights[at + 1]
            north_west, north_east = heights[at + columns], heights[at + columns + 1]
            highest = max(south_west, south_east, north_west, north_east)
            if math.isnan(south_west + south_east + north_west + north_east):
                highest = math.inf
            nodes[slot(column, row, wide)] = _rounded_up(highest)
    for row in range(layers[k].rows - 1 if k > 0 else 0):
        north = layers[k].north0 + (row + 0.5) * cell
        for column in range(columns - 1):
            if locate(layers, layers[k].east0 + (column + 0.5) * cell, north)[0] < k:
                nodes[slot(column, row, wide)] = -math.inf


@kernel
def _fill_highest(nodes: Records, children: Maxima, below: Any, level: Any, high: int, wide: int) -> None:
    """Highest post of each node of a level, from its sixteen children; a hole in one of them is +inf."""
    for row in range(high):
        for column in range(wide):
            begin = below.start + ((row * below.wide + column) << 4)
            highest = children[begin]
            for i in range(begin + 1, begin + 16):
                highest = max(highest, children[i])
            node = nodes[level.start + slot(column, row, level.wide)]
            node.highest = node.base = highest
            node.slope_x = node.slope_y = 0.0


@kernel
def _mean_slopes(heights: Array, columns: int, at: int, wide: int, high: int) -> tuple[float, float]:
    """Least-squares slopes [m per cell] of wide x high posts from index ``at``; 0 where a post is unknown."""
    sum_x = sum_y = 0.0
    for row in range(high):
        along = 0.0
        for column in range(wide):
            z = heights[at + row * columns + column]
            along += z
            sum_x += (column - 0.5 * (wide - 1)) * z
        sum_y += (row - 0.5 * (high - 1)) * along
    slope_x, slope_y = sum_x / (high * wide * (wide**2 - 1.0)), sum_y / (wide * high * (high**2 - 1.0))
    known = math.isfinite(sum_x + sum_y)
    return (12.0 * slope_x, 12.0 * slope_y) if known else (0.0, 0.0)


@kernel
def _fill_planes(heights: Array, layer: Any, nodes: Records, level: Any, shift: int) -> None:
    """Planes over the nodes of a level, each of 2^shift x 2^shift cells."""
    for south in range(0, layer.rows - 1, 1 << shift):
        for west in range(0, layer.columns - 1, 1 << shift):
            node = nodes[level.start + slot(west >> shift, south >> shift, level.wide)]
            if abs(node.highest) < math.inf:
                wide, high = min(1 << shift, layer.columns - 1 - west) + 1, min(1 << shift, layer.rows - 1 - south) + 1
                at, base = layer.start + south * layer.columns + west, -math.inf
                node.slope_x, node.slope_y = _mean_slopes(heights, layer.columns, at, wide, high)
                slope_x, slope_y = np.float64(node.slope_x), np.float64(node.slope_y)
                for row in range(high):
                    for column in range(wide):
                        over = heights[at + row * layer.columns + column] - slope_x * column - slope_y * row
                        base = over if over > base else base
                node.base = _rounded_up(base + _MARGIN_M)


@kernel
def fill_tree(
    heights: Array, layers: Records, k: int, maxima: Maxima, nodes: Records, levels: Records, trees: Records
) -> None:
    """The bounds of one layer's tree, cells first; nodes outside the layer keep -inf."""
    first, top = trees[k].first, trees[k].top
    _fill_cells(heights, layers, k, maxima[levels[first].start :], levels[first].wide)
    high, wide = (layers[k].rows + 2) >> 2, (layers[k].columns + 2) >> 2
    if top > 0:
        _fill_highest(nodes, maxima, levels[first], levels[first + 1], high, wide)
    for number in range(first + 2, first + top + 1):
        high, wide = (high + 3) >> 2, (wide + 3) >> 2
        _fill_highest(nodes, nodes["highest"], levels[number - 1], levels[number], high, wide)
    for number in range(1, top + 1):
        _fill_planes(heights, layers[k], nodes, levels[first + number], 2 * number)
