"""Checks that layers of a terrain fit, so that no ray passes through a gap between two of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fti.arrays import Array
from fti.terrain.layer import Layer
from fti.terrain.surface import gather, look_up

#: Maximum distance of outermost posts from the coarser surface [m]: rounding, also of single precision files.
SEAM_M = 1e-3
#: Maximum distance of an edge from the posts of the coarser layer [cells of the coarser one].
_ALIGNED = 1e-6


def check_stack(layers: Sequence[Layer]) -> None:
    """Raises ValueError where the layers are not in order, not aligned, or have a gap at a seam."""
    if not layers:
        raise ValueError("a terrain needs at least one layer")
    for number, fine in enumerate(layers):
        for coarse_number in range(number + 1, len(layers)):
            _check_pair(layers, number, coarse_number)
        if number + 1 < len(layers):
            _check_heights(number, fine, layers[number + 1 :])


def _check_pair(layers: Sequence[Layer], number: int, coarse_number: int) -> None:
    fine, coarse = layers[number], layers[coarse_number]
    if fine.cell_m > coarse.cell_m:
        raise ValueError(
            f"layer {number} has cells of {fine.cell_m} m and comes before one of {coarse.cell_m} m: finest first"
        )
    between = layers[number + 1 : coarse_number]
    if not overlap(fine, coarse) or any(_inside(fine, other) for other in between):
        return
    ratio = coarse.cell_m / fine.cell_m
    if abs(ratio - round(ratio)) > _ALIGNED:
        raise ValueError(f"{coarse.cell_m} m, the cell of layer {coarse_number}, is not a multiple of {fine.cell_m} m")
    for edge, begin, end in (
        (fine.east0, coarse.east0, coarse.east1),
        (fine.east1, coarse.east0, coarse.east1),
        (fine.north0, coarse.north0, coarse.north1),
        (fine.north1, coarse.north0, coarse.north1),
    ):
        steps = (edge - begin) / coarse.cell_m
        if begin < edge < end and abs(steps - round(steps)) > _ALIGNED:
            raise ValueError(
                f"an edge of layer {number} at {edge} m does not run along the posts of layer {coarse_number}"
            )


def _check_heights(number: int, fine: Layer, coarser: Sequence[Layer]) -> None:
    east, north = outline(fine)
    posts = np.concatenate((fine.heights[0], fine.heights[-1], fine.heights[:, 0], fine.heights[:, -1]))
    gap = np.abs(posts - look_up(gather(coarser), east, north))
    if (gap > SEAM_M).any():
        worst = int(np.nanargmax(gap))
        raise ValueError(
            f"the edge of layer {number} lies {gap[worst]:.3f} m off the coarser surface at east {east[worst]:.1f} m, "
            f"north {north[worst]:.1f} m"
        )


def outline(layer: Layer) -> tuple[Array, Array]:
    """East and north [m] of the outermost posts: south row, north row, west column, east column."""
    east, north = layer.east, layer.north
    along_east, along_north = np.ones_like(east), np.ones_like(north)
    return (
        np.concatenate((east, east, layer.east0 * along_north, layer.east1 * along_north)),
        np.concatenate((layer.north0 * along_east, layer.north1 * along_east, north, north)),
    )


def overlap(one: Layer, other: Layer) -> bool:
    """Whether two rectangles share more than an edge."""
    return (
        max(one.east0, other.east0) < min(one.east1, other.east1) - _ALIGNED
        and max(one.north0, other.north0) < min(one.north1, other.north1) - _ALIGNED
    )


def _inside(one: Layer, other: Layer) -> bool:
    """Whether the first rectangle lies in the second one."""
    return (
        other.east0 <= one.east0 + _ALIGNED
        and one.east1 <= other.east1 + _ALIGNED
        and other.north0 <= one.north0 + _ALIGNED
        and one.north1 <= other.north1 + _ALIGNED
    )
