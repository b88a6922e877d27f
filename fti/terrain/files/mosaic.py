"""Files whose posts lie on one lattice, such as tiles, read as one file.

A mosaic extends half a post distance beyond its outermost posts, extrapolated from the last two: there its pixels end
and those of the neighbour begin, so that there is no gap between tiles on different lattices.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Codes
from fti.terrain.file_info import NO_SOURCE
from fti.terrain.files.elevation_file import ElevationFile, nearest_turn

#: Maximum misalignment of two files on one lattice, over all posts [post distances].
_ALIGNED = 0.01


@dataclass(frozen=True)
class PostWindow:
    """Posts of a mosaic.

    heights : ndarray, shape (rows, columns) [m]; NaN in holes; origin : number of the source of each post
    row, column : of the first post in the mosaic
    """

    heights: Array
    origin: Codes
    row: int
    column: int


class Mosaic:
    """Elevation files on one lattice, counted from the first post of the first file.

    rows, columns : from the first to after the last post; the first file's own post [0, 0] is row 0, column 0
    """

    def __init__(self, number: int, file: ElevationFile) -> None:
        self.first = file
        self._tiles = [(number, file, 0, 0)]
        self.rows, self.columns = (0, file.rows), (0, file.columns)

    @property
    def vertical(self) -> str:
        """Vertical datum of all its files."""
        return self.first.source.vertical

    @property
    def numbers(self) -> tuple[int, ...]:
        """Codes of its files."""
        return tuple(number for number, *_ in self._tiles)

    def add_if_aligned(self, number: int, file: ElevationFile) -> bool:
        """Add a file if its posts lie on this lattice and its heights have the same datum; returns whether.

        Another transformation from WGS84 gives another lattice, which may be metres off.
        """
        if (
            file.crs != self.first.crs
            or file.operation != self.first.operation
            or file.source.vertical != self.vertical
        ):
            return False
        a, b, c, d, e, f = self.first.affine
        lattice = np.array([[a, b], [d, e]])
        to_east = file.affine[2] - c
        if file.crs.is_geographic:
            to_east = float(nearest_turn(to_east, file.turn))
        across, down = np.linalg.solve(lattice, (to_east, file.affine[5] - f))
        column, row = round(across), round(down)
        step = np.linalg.solve(lattice, np.array([[file.affine[0], file.affine[1]], [file.affine[3], file.affine[4]]]))
        drift = np.abs(step - np.eye(2)).max() * max(file.rows, file.columns)
        if max(abs(across - column), abs(down - row), drift) > _ALIGNED:
            return False
        self._tiles.append((number, file, row, column))
        self.rows = min(self.rows[0], row), max(self.rows[1], row + file.rows)
        self.columns = min(self.columns[0], column), max(self.columns[1], column + file.columns)
        return True

    def read(self, rows: tuple[int, int], columns: tuple[int, int]) -> PostWindow:
        """Posts from the first to before the second row and column; the first of overlapping files counts."""
        heights = np.full((rows[1] - rows[0], columns[1] - columns[0]), np.nan)
        origin = np.full(heights.shape, NO_SOURCE, dtype=np.uint8)
        for number, file, row, column in self._tiles:
            top, bottom = max(rows[0], row), min(rows[1], row + file.rows)
            left, right = max(columns[0], column), min(columns[1], column + file.columns)
            if top >= bottom or left >= right:
                continue
            read = file.read((top - row, bottom - row), (left - column, right - column))
            at = slice(top - rows[0], bottom - rows[0]), slice(left - columns[0], right - columns[0])
            new = np.isnan(heights[at]) & np.isfinite(read)
            heights[at][new] = read[new]
            origin[at][new] = number
        return PostWindow(heights, origin, rows[0], columns[0])


def assemble(files: Iterable[tuple[int, ElevationFile]]) -> list[Mosaic]:
    """The files as mosaics, each file in the first one that it fits; the order of files is kept."""
    mosaics: list[Mosaic] = []
    for number, file in files:
        if not any(mosaic.add_if_aligned(number, file) for mosaic in mosaics):
            mosaics.append(Mosaic(number, file))
    return mosaics
