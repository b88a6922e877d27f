"""A terrain surface: posts on a regular grid of a local frame, bilinear in between.

The posts' heights are ``up`` coordinates of the tangent frame l, not heights above the ellipsoid, so the curvature of
the Earth is in the surface and a ray is a straight line.  A point at distance d from the frame's origin with the
ellipsoidal height alt has

    up = alt - alt0 - d^2 / (2 (R + alt0)) + O(d^4 / R^3),       5.6 m lower at 8.5 km

and the code uses the exact transformation (``LocalFrame``).

Source: Spiegel 2018, section 2.2.2, eq. 2.50-2.51 (bilinear tile; the printed denominators of 2.51 are corrected).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.geodesy.local import LocalFrame
from fti.terrain import cast as casting
from fti.terrain.outcome import Outcome

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: The place above a latitude and longitude moves with its height by d h / R; each step divides the error by > 1000.
_HEIGHT_STEPS = 4


@dataclass(frozen=True, eq=False)
class Terrain:
    """A bilinear surface over the east, north plane of a local frame.

    heights       : ndarray, shape (rows, columns), float64 [m]  ``up`` of the posts; row 0 south, column 0 west
    cell_m        : distance between posts, both ways [m]
    east0, north0 : the post [0, 0] in the frame [m]
    frame         : the local frame l
    """

    heights: Array
    cell_m: float
    east0: float
    north0: float
    frame: LocalFrame

    @classmethod
    def from_array(
        cls,
        heights: ArrayLike,
        cell_m: float,
        *,
        lat0: float,
        lon0: float,
        alt0: float = 0.0,
        east0: float = 0.0,
        north0: float = 0.0,
    ) -> Terrain:
        """A terrain from posts [m, ``up`` of the frame at lat0, lon0 [rad], alt0 [m]]; row 0 south, column 0 west.

        Raises ValueError for fewer than 2 x 2 posts, a post that is not finite or a cell that is not positive.
        """
        posts = np.ascontiguousarray(heights, dtype=np.float64)
        if posts.ndim != 2 or min(posts.shape) < 2:
            raise ValueError(f"a terrain needs at least 2 x 2 posts, not {posts.shape}")
        if not np.isfinite(posts).all():
            raise ValueError(f"{np.count_nonzero(~np.isfinite(posts))} posts are not finite")
        if not cell_m > 0.0:
            raise ValueError(f"cell_m is {cell_m}, must be positive")
        return cls(posts, float(cell_m), float(east0), float(north0), LocalFrame(lat0, lon0, alt0))

    @functools.cached_property
    def pyramid(self) -> casting.Pyramid:
        """The surface as the ray caster reads it: posts, origin, cell and the quadtree of cell maxima."""
        return casting.build_pyramid(self.heights, self.cell_m, self.east0, self.north0)

    def _cell(self, east: ArrayLike, north: ArrayLike) -> tuple[Indices, Indices, Array, Array]:
        """Row, column and the fractions east and north inside that cell; fractions are NaN outside the coverage."""
        x = (np.asarray(east, dtype=np.float64) - self.east0) / self.cell_m
        y = (np.asarray(north, dtype=np.float64) - self.north0) / self.cell_m
        rows, columns = self.heights.shape
        inside = (x >= 0) & (x <= columns - 1) & (y >= 0) & (y <= rows - 1)
        column = np.where(inside, np.minimum(x, columns - 2), 0).astype(np.intp)
        row = np.where(inside, np.minimum(y, rows - 2), 0).astype(np.intp)
        return row, column, np.where(inside, x - column, np.nan), np.where(inside, y - row, np.nan)

    def _corners(self, row: Indices, column: Indices) -> tuple[Array, Array, Array, Array]:
        """South-west post, rise to the east, rise to the north, and the twist of each cell [m]."""
        south_west, south_east = self.heights[row, column], self.heights[row, column + 1]
        north_west, north_east = self.heights[row + 1, column], self.heights[row + 1, column + 1]
        twist = north_east - north_west - south_east + south_west
        return south_west, south_east - south_west, north_west - south_west, twist

    def up(self, east: ArrayLike, north: ArrayLike) -> Array:
        """``up`` [m] of the surface at east, north [m]; NaN outside the coverage."""
        row, column, u, v = self._cell(east, north)
        base, rise_east, rise_north, twist = self._corners(row, column)
        return np.asarray(base + u * rise_east + v * (rise_north + u * twist))

    def gradient(self, east: ArrayLike, north: ArrayLike) -> tuple[Array, Array]:
        """d up / d east and d up / d north at east, north [m]; one-sided on a cell's edge, NaN outside."""
        row, column, u, v = self._cell(east, north)
        _, rise_east, rise_north, twist = self._corners(row, column)
        return np.asarray((rise_east + v * twist) / self.cell_m), np.asarray((rise_north + u * twist) / self.cell_m)

    def normal(self, east: ArrayLike, north: ArrayLike) -> Array:
        """Unit vector away from the ground, shape (..., 3), east, north, up; NaN outside."""
        slope_east, slope_north = self.gradient(east, north)
        normal = np.stack((-slope_east, -slope_north, np.ones_like(slope_east)), axis=-1)
        return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))

    def height(self, lat: ArrayLike, lon: ArrayLike) -> Array:
        """Height of the surface above the ellipsoid [m] at lat, lon [rad]; NaN outside the coverage.

        The surface is met on the ellipsoid's normal through lat, lon, found by fixed-point steps that contract
        with slope x distance / R.
        """
        alt = np.full(np.broadcast_shapes(np.shape(lat), np.shape(lon)), self.frame.alt0)
        for _ in range(_HEIGHT_STEPS):
            enu = self.frame.to_local(lat, lon, alt)
            alt = alt + self.up(enu[..., 0], enu[..., 1]) - enu[..., 2]
        return alt

    def cast(self, origin: ArrayLike, directions: ArrayLike, max_range: float) -> Array:
        """Distance along rays to the surface [m]; NaN where nothing is hit within ``max_range`` [m].

        origin     : ndarray, shape (3,) or (n, 3)  [m]  east, north, up
        directions : ndarray, shape (n, 3) or (3,)       of any length but zero; the result is in metres
        Returns    : ndarray, shape (n,), or () for one origin and one direction.  0 where the origin is on or under
                     the surface; NaN for a ray that enters the coverage from its side below the surface.
        Raises ValueError for a direction without length or a max_range that is not positive.
        """
        origins, rays = np.broadcast_arrays(np.asarray(origin, np.float64), np.asarray(directions, np.float64))
        norm = np.linalg.norm(rays, axis=-1, keepdims=True)
        if (norm == 0.0).any():
            raise ValueError("a direction has no length")
        if not max_range > 0.0:
            raise ValueError(f"max_range is {max_range}, must be positive")
        flat = np.ascontiguousarray(origins.reshape(-1, 3)), np.ascontiguousarray((rays / norm).reshape(-1, 3))
        return casting.cast_rays(self.pyramid, *flat, float(max_range)).reshape(origins.shape[:-1])

    def trace(self, origin: ArrayLike, directions: ArrayLike, max_range: float) -> tuple[Array, NDArray[np.uint8]]:
        """Ranges as ``cast`` gives them, and what became of each ray: numbers of ``Outcome``, same shape."""
        ranges = self.cast(origin, directions, max_range)
        return ranges, np.where(np.isfinite(ranges), Outcome.HIT, Outcome.NOTHING).astype(np.uint8)
