"""One layer of a terrain: posts on a regular grid of the local frame, bilinear in between, with holes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Codes


@dataclass(frozen=True, eq=False)
class Layer:
    """Posts over a rectangle of the east, north plane of a local frame l.

    heights       : ndarray, shape (rows, columns), float64 [m]  ``up`` of the posts; row 0 south, column 0 west;
                    NaN where unknown: a cell that touches such a post is a hole
    cell_m        : distance between posts, both ways [m]
    east0, north0 : the post [0, 0] in the frame [m]
    origin        : ndarray, shape (rows, columns), uint8  number of the source of each post; None: all from source 0
    Raises ValueError for fewer than 2 x 2 posts, an infinite post, a cell that is not positive, a corner that is not
    finite, or source numbers of another shape.
    """

    heights: Array
    cell_m: float
    east0: float
    north0: float
    origin: Codes | None = None

    def __post_init__(self) -> None:
        posts = np.ascontiguousarray(self.heights, dtype=np.float64)
        if posts.ndim != 2 or min(posts.shape) < 2:
            raise ValueError(f"heights have the shape {posts.shape}, must be at least 2 x 2 posts")
        if np.isinf(posts).any():
            raise ValueError(f"heights: {np.count_nonzero(np.isinf(posts))} posts are infinite; must be finite or NaN")
        if not (self.cell_m > 0.0 and np.isfinite(self.cell_m)):
            raise ValueError(f"cell_m is {self.cell_m}, must be positive")
        if not np.isfinite([self.east0, self.north0]).all():
            raise ValueError(f"east0 is {self.east0}, north0 {self.north0}: must be finite")
        if self.origin is not None and self.origin.shape != posts.shape:
            raise ValueError(f"origin has the shape {self.origin.shape}, must be that of heights, {posts.shape}")
        object.__setattr__(self, "heights", posts)

    @property
    def east1(self) -> float:
        """East of the last column [m]."""
        return float(self.east0 + self.cell_m * (self.heights.shape[1] - 1))

    @property
    def north1(self) -> float:
        """North of the last row [m]."""
        return float(self.north0 + self.cell_m * (self.heights.shape[0] - 1))

    @property
    def east(self) -> Array:
        """East of the columns, shape (columns,) [m]."""
        return np.asarray(self.east0 + self.cell_m * np.arange(self.heights.shape[1]))

    @property
    def north(self) -> Array:
        """North of the rows, shape (rows,) [m]."""
        return np.asarray(self.north0 + self.cell_m * np.arange(self.heights.shape[0]))
