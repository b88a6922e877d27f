"""Elevation on a regular grid of latitude and longitude, the usual form of elevation models."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array

JACKSBORO = Path(__file__).parent / "data" / "jacksboro_fault_dem.npz"


def cubic_weights(fraction: Array) -> tuple[Array, Array, Array, Array]:
    """Weights of the four posts around a fraction in [0, 1] of the middle interval.

    Cubic convolution with a = -1/2: passes through the posts and reproduces polynomials up to the second degree.
    Source: Keys 1981 (cubic convolution).
    """
    t, s = fraction, 1.0 - fraction
    return -0.5 * t * s * s, s + 0.5 * t * s * (2.0 * s - t), t + 0.5 * t * s * (2.0 * t - s), -0.5 * s * t * t


@dataclass(frozen=True, eq=False)
class ElevationGrid:
    """Posts at equal steps of latitude and longitude; row 0 is north, column 0 is west.

    heights             : ndarray, shape (rows, columns) [m]
    lat_north, lon_west : the post [0, 0] [rad]
    step                : between posts, both ways [rad]
    """

    heights: Array
    lat_north: float
    lon_west: float
    step: float

    def height(self, lat: ArrayLike, lon: ArrayLike) -> Array:
        """Height [m] at lat, lon [rad], cubic between the posts; NaN where one of the 16 posts around is missing."""
        row = (self.lat_north - np.asarray(lat, dtype=np.float64)) / self.step
        column = (np.asarray(lon, dtype=np.float64) - self.lon_west) / self.step
        rows, columns = self.heights.shape
        inside = (row >= 1) & (row <= rows - 2) & (column >= 1) & (column <= columns - 2)
        i = np.where(inside, np.minimum(row, rows - 3), 1).astype(np.intp)
        j = np.where(inside, np.minimum(column, columns - 3), 1).astype(np.intp)
        row_weights, column_weights = cubic_weights(row - i), cubic_weights(column - j)
        total = np.zeros(np.broadcast_shapes(i.shape, j.shape))
        for di, wi in enumerate(row_weights, start=-1):
            for dj, wj in enumerate(column_weights, start=-1):
                total += wi * wj * self.heights[i + di, j + dj]
        return np.where(inside, total, np.nan)


def load_jacksboro() -> ElevationGrid:
    """The real elevation in the package, 3 arc seconds; see ``data/JACKSBORO.md``.

    The bounds in the file are outer edges (403 x 3" = xmax - xmin) and ymin, ymax are swapped; the vertical datum
    is not stated and assumed to be the ellipsoid.
    """
    with np.load(JACKSBORO) as file:
        step = float(file["dx"])
        north, west = max(float(file["ymin"]), float(file["ymax"])), float(file["xmin"])
        heights = file["elevation"].astype(np.float64)
    return ElevationGrid(
        heights, float(np.radians(north - step / 2)), float(np.radians(west + step / 2)), float(np.radians(step))
    )
