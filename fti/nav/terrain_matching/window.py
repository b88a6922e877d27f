"""The posts of a terrain around a profile, on one grid."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.nav.terrain_matching.profile import Profile
from fti.terrain.terrain import Terrain


@dataclass(frozen=True, eq=False)
class TerrainWindow:
    """A rectangle of posts.

    heights       : ndarray, shape (rows, columns) [m]  row 0 south, column 0 west; NaN where unknown
    cell_m        : distance between posts [m]
    east0, north0 : the post [0, 0] [m]
    """

    heights: Array
    cell_m: float
    east0: float
    north0: float

    def places(self, east: Array, north: Array) -> tuple[Array, Array]:
        """Columns and rows of positions [m], with fractions."""
        return (east - self.east0) / self.cell_m, (north - self.north0) / self.cell_m

    def refine(self, parts: int) -> TerrainWindow:
        """The same bilinear surface with each cell divided into so many parts, both ways: for a finer lattice."""
        heights = _divide(_divide(self.heights, parts).T, parts).T
        return TerrainWindow(np.ascontiguousarray(heights), self.cell_m / parts, self.east0, self.north0)


def _divide(heights: Array, parts: int) -> Array:
    """Rows with as many parts between two of them."""
    rows = np.empty((parts * (len(heights) - 1) + 1, heights.shape[1]))
    rows[::parts] = heights  # not interpolated: the next row may be unknown
    for part in range(1, parts):
        rows[part::parts] = heights[:-1] + part / parts * (heights[1:] - heights[:-1])
    return rows


def finest_window(terrain: Terrain) -> TerrainWindow:
    """All posts of the finest layer."""
    layer = terrain.finest
    return TerrainWindow(layer.heights, layer.cell_m, layer.east0, layer.north0)


def cut_window(terrain: Terrain, profile: Profile, margin_m: float) -> TerrainWindow:
    """The posts around a profile.

    Of the finest layer if it contains the whole rectangle: then the window is a view of its posts.  Otherwise the
    surface of all layers at the places that posts of the finest layer have, or would have; NaN outside of the terrain.
    margin_m : beyond the outermost samples, each way [m]
    """
    layer = terrain.finest
    low_column, high_column = _span(profile.east, layer.east0, layer.cell_m, margin_m)
    low_row, high_row = _span(profile.north, layer.north0, layer.cell_m, margin_m)
    corner = (layer.east0 + low_column * layer.cell_m, layer.north0 + low_row * layer.cell_m)
    rows, columns = layer.heights.shape
    if min(low_row, low_column) >= 0 and high_row < rows and high_column < columns:
        heights = layer.heights[low_row : high_row + 1, low_column : high_column + 1]
        return TerrainWindow(heights, layer.cell_m, *corner)
    return _sample(terrain, corner, layer.cell_m, (high_row - low_row + 1, high_column - low_column + 1))


def resample_window(terrain: Terrain, profile: Profile, margin_m: float, cell_m: float) -> TerrainWindow:
    """The surface around a profile on posts of another distance [m]; NaN outside of the terrain."""
    low_column, high_column = _span(profile.east, 0.0, cell_m, margin_m)
    low_row, high_row = _span(profile.north, 0.0, cell_m, margin_m)
    shape = (high_row - low_row + 1, high_column - low_column + 1)
    return _sample(terrain, (low_column * cell_m, low_row * cell_m), cell_m, shape)


def _sample(terrain: Terrain, corner: tuple[float, float], cell_m: float, shape: tuple[int, int]) -> TerrainWindow:
    east, north = (first + cell_m * np.arange(n) for first, n in zip(corner, reversed(shape), strict=True))
    return TerrainWindow(terrain.up(*np.meshgrid(east, north)), cell_m, *corner)


def _span(places: Array, first: float, cell_m: float, margin_m: float) -> tuple[int, int]:
    """Numbers of the first and last post of a row or column."""
    return (
        math.floor((places.min() - margin_m - first) / cell_m),
        math.ceil((places.max() + margin_m - first) / cell_m) + 1,
    )
