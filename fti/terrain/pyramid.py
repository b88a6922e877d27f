"""Upper bounds of the surface over a tree of nodes, with which a ray skips the ground below it.

Each layer has a tree of its own.  A node of level 0 is one cell, a node of the next level 4 x 4 nodes of the one
below.  Sixteen of them are stored together.  The bound of a cell is its highest post: the maxima of sixteen cells are
64 bytes, one cache line.  The bound of a higher node is a plane over all its posts, with their mean slope: a ray over
a hillside skips more than with the maximum alone.  All are single precision, rounded up, so that a skip is never wrong;
the surface itself stays double precision.

A hole (a cell that touches an unknown post) has the bound +inf: every ray above it descends to it.  Cells covered by
a finer layer have -inf: no ray does.

Source: Tevs, Ihrke, Seidel 2008 (maximum mipmaps); planes, the width of 4 and the layout are own choices.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.kernel import kernel
from fti.terrain.memory import LINE_BYTES, array_at, doubles_at, pointer
from fti.terrain.pyramid_nodes import LEVEL, NODE, TREE, Maxima, fill_tree
from fti.terrain.surface import LAYER, Posts, Records


class PyramidAddresses(NamedTuple):
    """Addresses of the arrays of a ``Pyramid``, number of layers, and their highest maximum [m].

    Plain numbers: a kernel with array arguments counts references to them with locked operations at every call, a tenth
    of the time of a cast.  Therefore the inner kernels take this and access the arrays by ``heights_at`` and the like.
    It is valid while the ``Pyramid`` exists.
    """

    heights: int
    layers: int
    maxima: int
    nodes: int
    levels: int
    trees: int
    n_layers: int
    summit: float


class Pyramid(NamedTuple):
    """A surface for the ray caster.

    heights, layers : as in ``surface.Posts``
    maxima          : (n,) [m]  of the cells, layer by layer, groups of 16 row by row, each group row by row
    nodes           : (m,)      records of ``NODE`` above them, layer by layer and level by level, in the same groups
    levels, trees   : records of ``LEVEL`` and ``TREE``
    addresses       : of these in memory
    """

    heights: Array
    layers: Records
    maxima: Maxima
    nodes: Records
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
    lengths = np.array([len(plan) for plan in plans])
    trees["first"], trees["top"] = lengths.cumsum() - lengths, lengths - 1
    sizes, of_cells = 16 * groups.prod(axis=1), np.isin(np.arange(len(groups)), trees["first"])
    for same in (of_cells, ~of_cells):
        levels["start"][same] = sizes[same].cumsum() - sizes[same]
    levels["wide"] = groups[:, 1]
    maxima = _aligned(int(sizes[of_cells].sum()), np.dtype(np.float32))
    nodes = _aligned(int(sizes[~of_cells].sum()), NODE)
    for k, tree in enumerate(trees):
        fill_tree(posts.heights, posts.layers, k, maxima, nodes, levels, trees)
        start = levels["start"][tree["first"] + tree["top"]]
        tree["highest"] = (nodes["highest"] if tree["top"] else maxima)[start : start + 16].max()
    arrays = (posts.heights, posts.layers, maxima, nodes, levels, trees)
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


def _aligned(count: int, kind: np.dtype[Any]) -> NDArray[Any]:
    """An array of maxima or nodes, all -inf, aligned to a cache line."""
    room = np.full((count * kind.itemsize + LINE_BYTES) // 4, -np.inf, dtype=np.float32)
    skip = -room.ctypes.data % LINE_BYTES // 4
    return room[skip : skip + count * kind.itemsize // 4].view(kind)


@kernel
def heights_at(q: PyramidAddresses) -> Array:
    """``Pyramid.heights``; the length of this array and the next one is a dummy."""
    return doubles_at(q.heights)


@kernel
def maxima_at(q: PyramidAddresses) -> Maxima:
    """``Pyramid.maxima``."""
    return array_at(pointer(q.maxima), (1,), np.float32)  # type: ignore[no-any-return]


@kernel
def nodes_at(q: PyramidAddresses) -> Records:
    """``Pyramid.nodes``."""
    return array_at(pointer(q.nodes), (1,), NODE)  # type: ignore[no-any-return]


@kernel
def levels_at(q: PyramidAddresses) -> Records:
    """``Pyramid.levels``."""
    return array_at(pointer(q.levels), (1,), LEVEL)  # type: ignore[no-any-return]


@kernel
def layers_at(q: PyramidAddresses) -> Records:
    """``Pyramid.layers``."""
    return array_at(pointer(q.layers), (q.n_layers,), LAYER)  # type: ignore[no-any-return]


@kernel
def trees_at(q: PyramidAddresses) -> Records:
    """``Pyramid.trees``."""
    return array_at(pointer(q.trees), (q.n_layers,), TREE)  # type: ignore[no-any-return]
