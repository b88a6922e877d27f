"""Resamples a file's bilinear surface to posts of the local frame, at the intersection with each post's vertical.

A post at east, north has the ``up`` whose height above the ellipsoid equals that of the file at the latitude and
longitude of this point:

    alt(east, north, up) = height(row, column) + undulation,    row, column = position of (east, north, up) in the file

solved by steps of ``up`` by the difference, which contract with slope x distance / R.

Resampling errors along each axis: on a plane only the Earth's curvature, cell^2 / 8 R (2e-5 m at 30 m); on ground of
the curvature k [1/m], the bilinear surface through the new posts differs from that of the file by at most
k cell spacing / 4 (cell <= spacing), and from the ground by k (cell^2 + spacing^2) / 8.  A cell larger than the file's
spacing skips posts; nothing is averaged.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array, Codes
from fti.geodesy.geoid import Geoid
from fti.geodesy.local import LocalFrame
from fti.terrain.file_info import NO_SOURCE
from fti.terrain.files.mosaic import Mosaic, PostWindow
from fti.terrain.files.tangent import HALF, PostBlock

Extent = tuple[int, int]
Places = tuple[Array, Array]
Posts = tuple[Array, Codes]

#: Tolerance of the solution [m] and maximum steps; at a wall of a city model it may not converge.
_MAX_STEP_M, _MAX_STEPS = 1e-6, 10
#: Maximum and minimum posts of a block along each side; maximum posts of a file per read.
_BLOCK, _MIN_BLOCK, _MAX_WINDOW = 256, 8, 2**24


@dataclass(frozen=True)
class Resampler:
    """Resamples the heights of one mosaic.  geoid : of its heights, None for the ellipsoid."""

    frame: LocalFrame
    mosaic: Mosaic
    geoid: Geoid | None

    def fill(self, places: Places, posts: Posts, done: Callable[[int], None]) -> None:
        """Fill the posts that are still NaN.

        places : east of the columns, north of the rows [m]
        posts  : ``up`` [m] and number of the source, ndarrays of shape (rows, columns), changed in place
        done   : receives the number of processed posts
        """
        (east, north), (ups, origin) = places, posts
        for rows, columns in itertools.product(_cuts(len(north), _BLOCK), _cuts(len(east), _BLOCK)):
            self._fill_block((east[columns], north[rows]), (ups[rows, columns], origin[rows, columns]))
            done(ups[rows, columns].size)

    def _fill_block(self, places: Places, posts: Posts) -> None:
        (east, north), (ups, origin) = places, posts
        block = PostBlock(self.frame, self.mosaic, east, north)
        needed = needed_posts(self.mosaic, block) if np.isnan(ups).any() else None
        if needed is None:
            return
        holds = block.holds()
        large = np.prod([float(end - begin) for begin, end in needed]) > _MAX_WINDOW
        if (large or not holds) and max(ups.shape) >= 2 * _MIN_BLOCK:
            halves = (_cuts(size, -(-size // 2) if size >= 2 * _MIN_BLOCK else size) for size in ups.shape)
            for rows, columns in itertools.product(*halves):
                self._fill_block((east[columns], north[rows]), (ups[rows, columns], origin[rows, columns]))
        elif holds:  # posts of the smallest block that does not hold, as at a pole, stay holes
            self._put(block, self.mosaic.read(*needed), posts)

    def _put(self, block: PostBlock, window: PostWindow, posts: Posts) -> None:
        if np.isfinite(window.heights).any():
            heights, numbers = _solve(block, self.mosaic, window, self.geoid, self.frame.lon0)
            new = np.isnan(posts[0]) & np.isfinite(heights)
            posts[0][new], posts[1][new] = heights[new], numbers[new]


def _cuts(count: int, max_size: int) -> list[slice]:
    """A row of posts in parts of at most ``max_size``, as equal as possible."""
    ends = np.linspace(0, count, -(-count // max_size) + 1).astype(int)
    return [slice(begin, end) for begin, end in itertools.pairwise(ends)]


def needed_posts(mosaic: Mosaic, block: PostBlock) -> tuple[Extent, Extent] | None:
    """Rows and columns of the mosaic below a block, from the first to before the second; None without any.

    The whole mosaic where its projection is undefined in a part of the block: the block is divided then.
    """
    extents = []
    for quantity, (first, end) in ((block.row, mosaic.rows), (block.column, mosaic.columns)):
        low, high = quantity.range()
        if np.isnan(low):
            return mosaic.rows, mosaic.columns
        if high < first - 0.5 or low > end - 0.5:
            return None
        begin = min(max(int(np.floor(low)) - 1, first), end - 2)
        extents.append((begin, max(min(int(np.ceil(high)) + 2, end), begin + 2)))
    return extents[0], extents[1]


def _solve(
    block: PostBlock, mosaic: Mosaic, window: PostWindow, geoid: Geoid | None, lon0: float
) -> tuple[Array, Codes]:
    """``up`` of the posts of a block and the source of each; NaN and NO_SOURCE where the window has none."""
    known = np.isfinite(window.heights)
    mean = window.heights[known].mean()
    filled = np.where(known, window.heights, mean)  # a step may lead over a hole
    t, undulation = (mean - block.alt.c0) / HALF, np.zeros(())
    for step in range(_MAX_STEPS):
        row, column = block.row.at(t) - window.row, block.column.at(t) - window.column
        missing = bilinear(filled, row, column) + undulation - block.alt.at(t)
        t = t + missing / HALF
        if step == 0 and geoid is not None:  # within metres of the point: the undulation is final
            undulation = geoid.undulation(block.lat.at(t), block.lon.at(t) + lon0)
        elif np.abs(missing).max() < _MAX_STEP_M:
            break
    row, column = block.row.at(t), block.column.at(t)
    inside = _inside(row, mosaic.rows) & _inside(column, mosaic.columns)
    row, column = row - window.row, column - window.column
    there = inside & np.isfinite(undulation)
    if not known.all():
        there &= np.isfinite(bilinear(window.heights, row, column))
    nearest = tuple(
        np.clip(np.rint(index), 0, size - 1).astype(np.intp)
        for index, size in zip((row, column), window.heights.shape, strict=True)
    )
    return np.where(there, block.up(t), np.nan), np.where(there, window.origin[nearest], NO_SOURCE).astype(np.uint8)


def _inside(index: Array, extent: Extent) -> NDArray[np.bool_]:
    return (index >= extent[0] - 0.5) & (index <= extent[1] - 0.5)


def bilinear(heights: Array, row: Array, column: Array) -> Array:
    """Heights at rows and columns of a window, extrapolated beyond its edge; NaN in a cell that touches a hole."""
    rows, columns = heights.shape
    i, j = np.clip(row.astype(np.intp), 0, rows - 2), np.clip(column.astype(np.intp), 0, columns - 2)
    v, u = row - i, column - j
    flat, at = heights.ravel(), i * columns + j
    upper, lower = flat[at], flat[at + columns]
    upper += u * (flat[at + 1] - upper)
    lower += u * (flat[at + columns + 1] - lower)
    return np.asarray(upper + v * (lower - upper))
