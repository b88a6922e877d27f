"""A file's bilinear surface on posts of the local frame: met where each post's vertical pierces it.

A post at east, north has the ``up`` whose point lies as high above the ellipsoid as the file says at that point's
latitude and longitude:

    alt(east, north, up) = height(row, column) + undulation,    row, column = where the file has (east, north, up)

solved by steps up += what is missing, which contract with slope x distance / R.

Resampling costs, along each axis: nothing on a plane but the Earth's curvature, cell^2 / 8 R (2e-5 m at 30 m); where
the ground has the curvature k [1/m], the bilinear surface through the new posts is off the one through the file's by
k cell spacing / 4 at most (cell <= spacing), and off the ground by k (cell^2 + spacing^2) / 8.  A cell larger than
the file's spacing leaves posts out; nothing is averaged.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.geoid import Geoid
from fti.geodesy.local import LocalFrame
from fti.terrain.file_info import NO_SOURCE
from fti.terrain.files.mosaic import Mosaic, PostWindow
from fti.terrain.files.tangent import HALF, PostBlock

Array = NDArray[np.float64]
Numbers = NDArray[np.uint8]
Extent = tuple[int, int]
Places = tuple[Array, Array]
Posts = tuple[Array, Numbers]

#: The solution stands when a step is smaller than this [m]; at a wall of a city model it may not come to rest.
_MAX_STEP_M, _MAX_STEPS = 1e-6, 10
#: Posts of a block along each side, at most and at least; posts of a file that are read at once.
_BLOCK, _MIN_BLOCK, _MAX_WINDOW = 256, 8, 2**24


@dataclass(frozen=True)
class Resampler:
    """Puts the heights of one mosaic on posts.  geoid : of its heights, None for the ellipsoid."""

    frame: LocalFrame
    mosaic: Mosaic
    geoid: Geoid | None

    def fill(self, places: Places, posts: Posts, done: Callable[[int], None]) -> None:
        """Fill the posts that are NaN yet.

        places : east of the columns, north of the rows [m]
        posts  : ``up`` [m] and number of the source, ndarrays of shape (rows, columns), changed in place
        done   : hears how many posts have been looked at
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
        elif holds:  # what does not hold in the smallest block, as on a pole, stays a hole
            self._put(block, self.mosaic.read(*needed), posts)

    def _put(self, block: PostBlock, window: PostWindow, posts: Posts) -> None:
        if np.isfinite(window.heights).any():
            found, numbers = _solve(block, self.mosaic, window, self.geoid, self.frame.lon0)
            new = np.isnan(posts[0]) & np.isfinite(found)
            posts[0][new], posts[1][new] = found[new], numbers[new]


def _cuts(count: int, most: int) -> list[slice]:
    """A row of posts in parts of at most so many, as equal as can be."""
    ends = np.linspace(0, count, -(-count // most) + 1).astype(int)
    return [slice(begin, end) for begin, end in itertools.pairwise(ends)]


def needed_posts(mosaic: Mosaic, block: PostBlock) -> tuple[Extent, Extent] | None:
    """Rows and columns of the mosaic below a block, from the first to before the second; None when it has none there.

    Where the mosaic's projection has no numbers for a part of the block, the whole mosaic: the block is cut up then.
    """
    extents = []
    for quantity, (first, behind) in ((block.row, mosaic.rows), (block.column, mosaic.columns)):
        low, high = quantity.range()
        if np.isnan(low):
            return mosaic.rows, mosaic.columns
        if high < first - 0.5 or low > behind - 0.5:
            return None
        begin = min(max(int(np.floor(low)) - 1, first), behind - 2)
        extents.append((begin, max(min(int(np.ceil(high)) + 2, behind), begin + 2)))
    return extents[0], extents[1]


def _solve(
    block: PostBlock, mosaic: Mosaic, window: PostWindow, geoid: Geoid | None, lon0: float
) -> tuple[Array, Numbers]:
    """``up`` of the posts of a block and the source of each; NaN and NO_SOURCE where the window has none."""
    known = np.isfinite(window.heights)
    mean = window.heights[known].mean()
    filled = np.where(known, window.heights, mean)  # a step may lead over a hole
    t, undulation = (mean - block.alt.c0) / HALF, np.zeros(())
    for step in range(_MAX_STEPS):
        row, column = block.row.at(t) - window.row, block.column.at(t) - window.column
        missing = bilinear(filled, row, column) + undulation - block.alt.at(t)
        t = t + missing / HALF
        if step == 0 and geoid is not None:  # within metres of the place: the undulation is the final one
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
    """Heights at rows and columns of a window, straight on beyond its edge; NaN in a cell that touches a hole."""
    rows, columns = heights.shape
    i, j = np.clip(row.astype(np.intp), 0, rows - 2), np.clip(column.astype(np.intp), 0, columns - 2)
    v, u = row - i, column - j
    flat, at = heights.ravel(), i * columns + j
    upper, lower = flat[at], flat[at + columns]
    upper += u * (flat[at + 1] - upper)
    lower += u * (flat[at + columns + 1] - lower)
    return np.asarray(upper + v * (lower - upper))
