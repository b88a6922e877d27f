"""Look-ups on a stack of layers: compiled kernels, float64, any number of layers with one compiled form.

A cell with the posts h (south-west), h + A (south-east), h + B (north-west) and h + A + B + k (north-east) has

    up = h + A u + B v + k u v,      d up / d east = (A + k v) / cell,      d up / d north = (B + k u) / cell

with u, v in [0, 1] from the south-west post.  The printed form of the weights (eq. 2.51) exchanges latitude and
longitude in its denominators, which makes them zero.

Source: Spiegel 2018, section 2.2.2, eq. 2.50-2.51 and 4.6-4.8, as corrected in docs/errata.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array, Ints
from fti.geodesy.formulas import bilinear
from fti.kernel import kernel
from fti.terrain.layer import Layer

Records = NDArray[np.void]

#: A point within this distance outside a layer is on its edge [cells]: rounding errors of computed points.
ON_EDGE = 1e-11

#: A layer for the kernels: index of its first post, rows, columns, distance of posts, position of the first post [m].
LAYER = np.dtype(
    [
        ("start", np.int64),
        ("rows", np.int64),
        ("columns", np.int64),
        ("cell", np.float64),
        ("east0", np.float64),
        ("north0", np.float64),
    ],
    align=True,
)


class Posts(NamedTuple):
    """The surface for the kernels.

    heights : (n,) [m]  the posts of all layers, row by row, one layer after another
    layers  : (k,)      records of ``LAYER``, finest first
    """

    heights: Array
    layers: Records


def gather(layers: Sequence[Layer]) -> Posts:
    """The layers for the kernels; one layer alone is not copied."""
    flat = [layer.heights.ravel() for layer in layers]
    records = np.zeros(len(layers), dtype=LAYER)
    start = 0
    for record, layer in zip(records, layers, strict=True):
        record["start"], (record["rows"], record["columns"]) = start, layer.heights.shape
        record["cell"], record["east0"], record["north0"] = layer.cell_m, layer.east0, layer.north0
        start += layer.heights.size
    return Posts(flat[0] if len(flat) == 1 else np.concatenate(flat), records)


@kernel
def locate(layers: Records, east: float, north: float) -> tuple[int, int, float, float]:
    """The first layer that contains a point, the south-west post of the cell, and u, v; -1 for none."""
    number, at, u, v, k = -1, 0, math.nan, math.nan, 0
    while number < 0 and k < len(layers):
        layer = layers[k]
        x, y = (east - layer.east0) / layer.cell, (north - layer.north0) / layer.cell
        width, height = layer.columns - 1, layer.rows - 1
        if -ON_EDGE <= x <= width + ON_EDGE and -ON_EDGE <= y <= height + ON_EDGE:
            column, row = min(max(int(x), 0), width - 1), min(max(int(y), 0), height - 1)
            number, at = k, layer.start + row * layer.columns + column
            u, v = min(max(x - column, 0.0), 1.0), min(max(y - row, 0.0), 1.0)
        k += 1
    return number, at, u, v


@kernel
def surface(p: Posts, east: float, north: float) -> tuple[float, float, float]:
    """``up`` [m] and its derivatives to east and north at a point; NaN outside of all layers and in a hole."""
    heights, layers = p.heights, p.layers
    up, to_east, to_north = math.nan, math.nan, math.nan
    k, at, u, v = locate(layers, east, north)
    if k >= 0:
        over = at + layers[k].columns
        up, to_east, to_north = bilinear((heights[at], heights[at + 1], heights[over], heights[over + 1]), u, v)
        to_east, to_north = to_east / layers[k].cell, to_north / layers[k].cell
    return up, to_east, to_north


@kernel
def look_up(p: Posts, east: Array, north: Array) -> Array:
    """``up`` [m] at points (n,) [m]; NaN outside of all layers and in holes."""
    heights, layers = p.heights, p.layers  # once: a call with the argument p counts references and takes longer
    ups = np.full(len(east), np.nan)
    for i in range(len(east)):
        k, at, u, v = locate(layers, east[i], north[i])
        if k >= 0:
            over = at + layers[k].columns
            ups[i], _, _ = bilinear((heights[at], heights[at + 1], heights[over], heights[over + 1]), u, v)
    return ups


@kernel
def slopes(p: Posts, east: Array, north: Array) -> tuple[Array, Array]:
    """d up / d east and d up / d north at points (n,) [m]; NaN outside of all layers and in holes."""
    to_east, to_north = np.empty(len(east)), np.empty(len(east))
    for i in range(len(east)):
        _, to_east[i], to_north[i] = surface(p, east[i], north[i])
    return to_east, to_north


@kernel
def nearest_posts(p: Posts, east: Array, north: Array) -> tuple[Ints, Ints]:
    """The layer of each point (n,) and its nearest post, counted within the layer; -1 outside of all layers."""
    layers = p.layers
    numbers, posts = np.full(len(east), -1, np.int64), np.full(len(east), -1, np.int64)
    for i in range(len(east)):
        k, at, u, v = locate(layers, east[i], north[i])
        if k >= 0:
            numbers[i] = k
            posts[i] = at - layers[k].start + int(u >= 0.5) + layers[k].columns * int(v >= 0.5)
    return numbers, posts
