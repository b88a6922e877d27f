"""Resampling error: the surface of the files against that of the layer, at a sample of points.

Blocks of a few cells, spread over the layer, are resampled like the layer (``Resampler``); at points between their
posts the surface of the file is evaluated in the same way, and that of the layer is bilinear.  The RMS is over these
points.  Both surfaces are bilinear, so their maximum distance is at posts of one of them: the posts of the files in the
block are compared, too, for the maximum error.

The sample depends only on the layer's rectangle, so that opening a terrain, ``fti terrain info`` and ``fti check`` give
the same numbers.  It reads at most 256 small windows, for files of any size.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.geodesy.geoid import Geoid
from fti.geodesy.local import LocalFrame
from fti.terrain.file_info import NO_SOURCE
from fti.terrain.files.layout import LayerPlan
from fti.terrain.files.resample import Extent, Resampler, bilinear, needed_posts
from fti.terrain.files.tangent import PostBlock
from fti.terrain.resampling import ResamplingError

#: Compared blocks of a layer, and points in all of them together.
_BLOCKS, _PLACES = 256, 12_000
#: Minimum and maximum points along each side of a block, and posts of a file.
_MIN_ALONG, _MAX_ALONG = 7, 40
#: Maximum cells along each side of a block.
_MAX_CELLS = 16
#: Spacings of a file that a block with larger cells spans.
_SPACINGS = 64.0
#: The additive recurrence that fills a square evenly: powers of 1 / 1.3247..., the real root of x^3 = x + 1
#: (Roberts 2018, The unreasonable effectiveness of quasirandom sequences).
_PLASTIC = 1.32471795724474602596


@dataclass(frozen=True)
class _Cells:
    """Posts of a layer: east of the columns, north of the rows [m], and their ``up`` (rows, columns) [m]."""

    east: Array
    north: Array
    ups: Array

    def up(self, east: Array, north: Array) -> Array:
        """``up`` of the layer at points [m]; NaN outside the block, and in a cell that touches a hole."""
        cell = self.east[1] - self.east[0]
        row, column = (north - self.north[0]) / cell, (east - self.east[0]) / cell
        rows, columns = self.ups.shape
        inside = (row >= 0.0) & (row <= rows - 1) & (column >= 0.0) & (column <= columns - 1)
        return np.where(inside, bilinear(self.ups, np.where(inside, row, 0.0), np.where(inside, column, 0.0)), np.nan)


def measure_resampling(plan: LayerPlan, frame: LocalFrame, geoids: Mapping[str, Geoid | None]) -> ResamplingError:
    """The error of one planned layer.  geoids : by vertical datum, None for the ellipsoid"""
    resamplers = [Resampler(frame, mosaic, geoids[mosaic.vertical]) for mosaic in plan.mosaics]
    chosen = _choose_blocks(plan)
    along = int(np.clip(math.ceil(math.sqrt(_PLACES / len(chosen))), _MIN_ALONG, _MAX_ALONG))
    at_places, at_posts = [np.zeros(0)], [np.zeros(0)]
    for number, (rows, columns) in enumerate(chosen):
        east, north = plan.places[0][columns], plan.places[1][rows]
        block = _Cells(east, north, _fill(resamplers, east, north))
        at_places.append(_compare_places(block, resamplers, along, number))
        at_posts.append(_compare_posts(block, resamplers, along))
    spread, posts = (_known(np.concatenate(parts)) for parts in (at_places, at_posts))
    if not spread.size:
        return ResamplingError()
    everything = np.abs(np.concatenate((spread, posts)))
    return ResamplingError(math.sqrt(np.mean(spread**2)), float(everything.max()), everything.size)


def _known(errors: Array) -> Array:
    return errors[np.isfinite(errors)]


def _choose_blocks(plan: LayerPlan) -> list[tuple[slice, slice]]:
    """Rows and columns of the blocks: all if there are few, otherwise an evenly spread sample."""
    spacing = min(min(mosaic.first.source.spacing_m) for mosaic in plan.mosaics)
    cells = int(np.clip(_SPACINGS * spacing / plan.cell_m, 1, _MAX_CELLS))
    down, across = (max(1, (posts - 1) // cells) for posts in plan.shape)
    if down * across <= _BLOCKS:
        chosen = list(itertools.product(range(down), range(across)))
    else:
        steps = np.arange(1, _BLOCKS + 1)
        at = zip(_recurrence(steps, 1) * down, _recurrence(steps, 2) * across, strict=True)
        chosen = sorted({(int(row), int(column)) for row, column in at})
    return [(_extent(row, cells), _extent(column, cells)) for row, column in chosen]


def _extent(number: int, cells: int) -> slice:
    return slice(number * cells, (number + 1) * cells + 1)


def _recurrence(steps: NDArray[np.int_], axis: int) -> Array:
    """Numbers from 0 to 1 of one axis, 1 or 2."""
    return np.asarray(steps / _PLASTIC**axis % 1.0)


def _fill(resamplers: Sequence[Resampler], east: Array, north: Array) -> Array:
    """``up`` of the files' surface at east of columns, north of rows [m], shape (rows, columns); the first counts."""
    shape = len(north), len(east)
    ups, origin = np.full(shape, np.nan), np.full(shape, NO_SOURCE, dtype=np.uint8)
    for resampler in resamplers:
        resampler.fill((east, north), (ups, origin), lambda _: None)
    return ups


def _compare_places(block: _Cells, resamplers: Sequence[Resampler], along: int, number: int) -> Array:
    """Layer minus files [m] on a lattice of points in a block, different in each block."""
    steps = np.arange(along)
    shifts = (_recurrence(np.array([number]), axis) for axis in (1, 2))
    east, north = (
        side[0] + (side[-1] - side[0]) * (steps + shift) / along
        for side, shift in zip((block.east, block.north), shifts, strict=True)
    )
    return (block.up(*np.meshgrid(east, north)) - _fill(resamplers, east, north)).ravel()


def _compare_posts(block: _Cells, resamplers: Sequence[Resampler], along: int) -> Array:
    """Layer minus files [m] at posts of the first file in a block; NaN outside the block."""
    for resampler in resamplers:
        places = PostBlock(resampler.frame, resampler.mosaic, block.east, block.north)
        if places.holds() and (extents := needed_posts(resampler.mosaic, places)) is not None:
            east, north, up = _posts(resampler, extents, along)
            return block.up(east, north) - up
    return np.zeros(0)


def _posts(resampler: Resampler, extents: tuple[Extent, Extent], along: int) -> tuple[Array, Array, Array]:
    """East, north, up [m] of posts of a file, from the first to before the second row and column."""
    window = resampler.mosaic.read(*extents)
    rows, columns = (np.arange(0, size, -(-size // along)) for size in window.heights.shape)
    row, column = (index.ravel() for index in np.meshgrid(rows, columns, indexing="ij"))
    lat, lon = resampler.mosaic.first.places(window.row + row, window.column + column)
    alt = window.heights[row, column]
    if resampler.geoid is not None:
        alt = alt + resampler.geoid.undulation(lat, lon)
    east, north, up = resampler.frame.to_local(lat, lon, alt).T
    return east, north, up
