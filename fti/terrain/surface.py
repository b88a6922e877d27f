"""Look-ups on a stack of layers: compiled kernels, float64, any number of layers with one compiled form.

A cell with the posts h (south-west), h + A (south-east), h + B (north-west) and h + A + B + k (north-east) has

    up = h + A u + B v + k u v,      d up / d east = (A + k v) / cell,      d up / d north = (B + k u) / cell

with u, v in [0, 1] counted from the south-west post.  The printed form of the weights (eq. 2.51) exchanges latitude
and longitude in its denominators, which are zero then.

Source: Spiegel 2018, section 2.2.2, eq. 2.50-2.51 and 4.6-4.8, as corrected in docs/errata.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from fti.terrain.layer import Layer

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
Kernel = TypeVar("Kernel", bound=Callable[..., Any])

#: A place so many cells outside a layer is on its edge: what rounding does to a point that was computed to lie there.
_ON_EDGE = 1e-9


def kernel(function: Kernel) -> Kernel:
    """Compile on the first call, keep the code on disk, release the interpreter lock; no reordering of sums."""
    return cast(Kernel, numba.njit(nogil=True, cache=True, error_model="numpy")(function))


class Posts(NamedTuple):
    """The layers for the kernels, finest first; k layers.

    heights         : (n,) [m]  the posts of all layers, row by row, one layer after another
    starts          : (k,)      where a layer begins in ``heights``
    rows, columns   : (k,)      posts of each layer
    cell, east0, north0 : (k,) [m]
    """

    heights: Array
    starts: Whole
    rows: Whole
    columns: Whole
    cell: Array
    east0: Array
    north0: Array


def gather(layers: Sequence[Layer]) -> Posts:
    """The layers for the kernels; one layer is not copied."""
    flat = [layer.heights.ravel() for layer in layers]
    shapes = np.array([layer.heights.shape for layer in layers], dtype=np.int64)
    starts = np.concatenate(([0], np.cumsum(shapes.prod(axis=1))[:-1])).astype(np.int64)
    corners = np.array([(layer.cell_m, layer.east0, layer.north0) for layer in layers])
    heights = flat[0] if len(flat) == 1 else np.concatenate(flat)
    rows, columns = np.ascontiguousarray(shapes.T)
    return Posts(heights, starts, rows, columns, *np.ascontiguousarray(corners.T))


@kernel
def locate(p: Posts, east: float, north: float, first: int) -> tuple[int, int, float, float]:
    """The first layer from ``first`` on that a place lies in, its cell's south-west post and u, v; -1 in none."""
    for k in range(first, len(p.starts)):
        x, y = (east - p.east0[k]) / p.cell[k], (north - p.north0[k]) / p.cell[k]
        width, height = p.columns[k] - 1, p.rows[k] - 1
        if -_ON_EDGE <= x <= width + _ON_EDGE and -_ON_EDGE <= y <= height + _ON_EDGE:
            column, row = min(max(int(x), 0), width - 1), min(max(int(y), 0), height - 1)
            u, v = min(max(x - column, 0.0), 1.0), min(max(y - row, 0.0), 1.0)
            return k, p.starts[k] + row * p.columns[k] + column, u, v
    return -1, 0, math.nan, math.nan


@kernel
def surface(p: Posts, east: float, north: float, first: int) -> tuple[float, float, float]:
    """``up`` [m] and its derivatives to east and north at a place, of the layers from ``first`` on; NaN in none."""
    k, at, u, v = locate(p, east, north, first)
    if k < 0:
        return math.nan, math.nan, math.nan
    base, north_west = p.heights[at], p.heights[at + p.columns[k]]
    rise_east, rise_north = p.heights[at + 1] - base, north_west - base
    twist = p.heights[at + p.columns[k] + 1] - north_west - rise_east
    up = base + u * rise_east + v * (rise_north + u * twist)
    return up, (rise_east + v * twist) / p.cell[k], (rise_north + u * twist) / p.cell[k]


@kernel
def look_up(p: Posts, east: Array, north: Array, first: int) -> Array:
    """``up`` [m] at places (n,) [m], of the layers from ``first`` on; NaN outside of all and in holes."""
    ups = np.empty(len(east))
    for i in range(len(east)):
        ups[i], _, _ = surface(p, east[i], north[i], first)
    return ups


@kernel
def slopes(p: Posts, east: Array, north: Array) -> tuple[Array, Array]:
    """d up / d east and d up / d north at places (n,) [m]; NaN outside of all layers and in holes."""
    to_east, to_north = np.empty(len(east)), np.empty(len(east))
    for i in range(len(east)):
        _, to_east[i], to_north[i] = surface(p, east[i], north[i], 0)
    return to_east, to_north


@kernel
def nearest_posts(p: Posts, east: Array, north: Array) -> tuple[Whole, Whole]:
    """The layer of each place (n,) and its nearest post, counted within the layer; -1 outside of all layers."""
    layers, posts = np.empty(len(east), np.int64), np.empty(len(east), np.int64)
    for i in range(len(east)):
        k, at, u, v = locate(p, east[i], north[i], 0)
        layers[i] = k
        posts[i] = -1 if k < 0 else at - p.starts[k] + int(u >= 0.5) + p.columns[k] * int(v >= 0.5)
    return layers, posts
