"""Maxima of the surface over a tree of nodes, with which a ray skips the ground far below it.

Each layer has a tree of its own.  A node of level 0 is one cell, a node of the next level 4 x 4 nodes of the one
below.  Those sixteen are stored together: 64 bytes, one cache line.  Maxima are single precision, rounded up, so that a
skip is never wrong; the surface itself stays double precision.

A hole (a cell that touches an unknown post) has the maximum +inf: every ray above it descends to it.  Cells covered by
a finer layer have -inf: no ray does.

Source: Tevs, Ihrke, Seidel 2008 (maximum mipmaps); the width of 4 and the layout are own choices.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from fti.arrays import Array
from fti.kernel import kernel
from fti.terrain.surface import LAYER, Posts, Records, locate

Maxima = NDArray[np.float32]

_LINE_BYTES = 64

#: A level of a layer's tree: index of its first maximum, and number of groups of 4 x 4 in a row.
LEVEL = np.dtype([("start", np.int64), ("wide", np.int64)], align=True)
#: A layer's tree: index of its first level, number of its last one, and the highest maximum [m].
TREE = np.dtype([("first", np.int64), ("top", np.int64), ("highest", np.float64)], align=True)


class PyramidAddresses(NamedTuple):
    """Addresses of the arrays of a ``Pyramid``, number of layers, and their highest maximum [m].

    Plain numbers: a kernel with array arguments counts references to them with locked operations at every call, a tenth
    of the time of a cast.  Therefore the inner kernels take this and access the arrays by ``heights_at`` and the like.
    It is valid while the ``Pyramid`` exists.
    """

    heights: int
    layers: int
    maxima: int
    levels: int
    trees: int
    n_layers: int
    summit: float


class Pyramid(NamedTuple):
    """A surface for the ray caster.

    heights, layers : as in ``surface.Posts``
    maxima          : (n,) [m]  of all nodes, level by level, groups of 16 row by row, each group row by row
    levels, trees   : records of ``LEVEL`` and ``TREE``
    addresses       : of these in memory
    """

    heights: Array
    layers: Records
    maxima: Maxima
    levels: Records
    trees: Records
    addresses: PyramidAddresses

    def __reduce__(self) -> tuple[object, ...]:
        """Rebuild a copy, because its addresses differ."""
        return build_pyramid, (Posts(self.heights, self.layers),)


def build_pyramid(posts: Posts) -> Pyramid:
    """The trees of all layers."""
    plans = [_plan(int(layer["rows"]), int(layer["columns"])) for layer in posts.layers]
    groups = np.array([group for plan in plans for group in plan], dtype=np.int64)
    levels, trees = np.zeros(len(groups), dtype=LEVEL), np.zeros(len(plans), dtype=TREE)
    sizes = 16 * groups.prod(axis=1)
    levels["start"], levels["wide"] = sizes.cumsum() - sizes, groups[:, 1]
    lengths = np.array([len(plan) for plan in plans])
    trees["first"], trees["top"] = lengths.cumsum() - lengths, lengths - 1
    maxima = _aligned(int(sizes.sum()))
    for k in range(len(plans)):
        _fill(posts.heights, posts.layers, k, maxima, levels, trees)
    arrays = (posts.heights, posts.layers, maxima, levels, trees)
    pointers, summit = (int(array.ctypes.data) for array in arrays), float(trees["highest"].max())
    addresses = PyramidAddresses(*pointers, len(plans), summit)  # type: ignore[call-arg]
    return Pyramid(*arrays, addresses)


def _plan(rows: int, columns: int) -> list[tuple[int, int]]:
    """Groups of each level, north and east, from the cells up to one group."""
    high, wide = rows - 1, columns - 1
    plan: list[tuple[int, int]] = []
    while not plan or high * wide > 1:
        high, wide = -(-high // 4), -(-wide // 4)
        plan.append((high, wide))
    return plan


def _aligned(count: int) -> Maxima:
    """An array of maxima, all -inf, aligned to a cache line."""
    room = np.full(count + _LINE_BYTES // 4, -np.inf, dtype=np.float32)
    skip = -room.ctypes.data % _LINE_BYTES // 4
    return room[skip : skip + count]


def _as_pointer(_typing: Any, _address: Any) -> Any:
    """Code generation of ``_pointer(address)``."""

    def generate(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return numba.types.voidptr(numba.types.intp), generate


_pointer: Any = intrinsic(_as_pointer)
_array: Any = numba.carray  # type: ignore[attr-defined]


@kernel
def doubles_at(address: int) -> Array:
    """The array of doubles at an address; its length is a dummy."""
    return _array(_pointer(address), (1,), np.float64)  # type: ignore[no-any-return]


@kernel
def heights_at(q: PyramidAddresses) -> Array:
    """``Pyramid.heights``; the length of this array and the next one is a dummy."""
    return doubles_at(q.heights)


@kernel
def maxima_at(q: PyramidAddresses) -> Maxima:
    """``Pyramid.maxima``."""
    return _array(_pointer(q.maxima), (1,), np.float32)  # type: ignore[no-any-return]


@kernel
def levels_at(q: PyramidAddresses) -> Records:
    """``Pyramid.levels``."""
    return _array(_pointer(q.levels), (1,), LEVEL)  # type: ignore[no-any-return]


@kernel
def layers_at(q: PyramidAddresses) -> Records:
    """``Pyramid.layers``."""
    return _array(_pointer(q.layers), (q.n_layers,), LAYER)  # type: ignore[no-any-return]


@kernel
def trees_at(q: PyramidAddresses) -> Records:
    """``Pyramid.trees``."""
    return _array(_pointer(q.trees), (q.n_layers,), TREE)  # type: ignore[no-any-return]


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
def _fill(heights: Array, layers: Records, k: int, maxima: Maxima, levels: Records, trees: Records) -> None:
    """The maxima of one layer's tree, cells first; nodes outside the layer keep -inf."""
    level = levels[trees[k].first]
    _fill_cells(heights, layers, k, maxima[level.start :], level.wide)
    high, wide = layers[k].rows - 1, layers[k].columns - 1
    for number in range(trees[k].first + 1, trees[k].first + trees[k].top + 1):
        below, level = levels[number - 1], levels[number]
        high, wide = (high + 3) >> 2, (wide + 3) >> 2
        for row in range(high):
            for column in range(wide):
                begin = below.start + ((row * below.wide + column) << 4)
                highest = maxima[begin]
                for i in range(begin + 1, begin + 16):
                    highest = max(highest, maxima[i])
                maxima[level.start + slot(column, row, level.wide)] = highest
    last = levels[trees[k].first + trees[k].top].start
    trees[k].highest = maxima[last : last + 16].max()
