"""Position in a file of the posts of a block of the local frame, by fast polynomials of east, north and up.

Row and column in a file, latitude, longitude and the height above the ellipsoid need the ellipsoid, a change of datum
and a map projection.  Per block they are computed exactly at 6 x 6 x 3 nodes and interpolated by a polynomial;
``holds`` checks between the nodes that the error is below 1e-4 of a post distance and 1e-4 m (usually it is rounding),
and a block for which it is not is divided into four.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import SEMI_MAJOR
from fti.geodesy.local import LocalFrame
from fti.terrain.files.elevation_file import nearest_turn
from fti.terrain.files.mosaic import Mosaic

#: Nodes of the polynomials along east and along north.
_NODES = 6
#: Middle and half of the range of heights above the ellipsoid in which they are valid [m].
_MIDDLE, HALF = 4250.0, 5000.0
#: Maximum error of the polynomials: in post distances, and in height [m].
_OFF_POSTS, _OFF_ALT = 1e-4, 1e-4


@dataclass(frozen=True)
class BlockParabola:
    """A quantity over a block as a parabola in t = (up - middle) / half; three arrays of shape (rows, columns)."""

    c0: Array
    c1: Array
    c2: Array

    def at(self, t: Array) -> Array:
        """The value on every post, at the post's own t."""
        return np.asarray(self.c0 + t * (self.c1 + t * self.c2))

    def range(self) -> tuple[float, float]:
        """Minimum and maximum; NaN if any value is NaN."""
        ends = np.stack((self.c0, self.c0 + self.c1 + self.c2, self.c0 - self.c1 + self.c2))
        return float(ends.min()), float(ends.max())


class PostBlock:
    """Row and column in a mosaic, lat, lon (from the frame's on) [rad] and alt [m] over a block of posts.

    east, north : of the columns and rows [m], at least two each
    """

    def __init__(self, frame: LocalFrame, mosaic: Mosaic, east: Array, north: Array) -> None:
        self._frame, self._mosaic = frame, mosaic
        self._east, self._north = east, north
        distance = np.hypot((east[0] + east[-1]) / 2, (north[0] + north[-1]) / 2)
        self._middle = float(_MIDDLE - frame.alt0 - distance**2 / (2.0 * SEMI_MAJOR))
        (nodes_e, weights_e), (nodes_n, weights_n) = _basis(east), _basis(north)
        below, middle, above = (self._exact(nodes_e[None, :], nodes_n[:, None], t) for t in (-1.0, 0.0, 1.0))

        def spread(values: Array) -> Array:
            return np.asarray(weights_n @ values @ weights_e.T)

        self.row, self.column, self.lat, self.lon, self.alt = (
            BlockParabola(spread(m), spread((a - b) / 2), spread((a + b) / 2 - m))
            for b, m, a in zip(below, middle, above, strict=True)
        )

    def up(self, t: Array) -> Array:
        """``up`` [m] of the argument of the parabolas."""
        return np.asarray(self._middle + HALF * t)

    def holds(self) -> bool:
        """Whether the polynomials meet their accuracy between the nodes."""
        columns, rows = (np.arange(1, 8, 2) * (len(side) - 1) // 8 for side in (self._east, self._north))
        exact = self._exact(self._east[None, columns], self._north[rows, None], 0.5)
        half, at = np.full((), 0.5), np.ix_(rows, columns)
        pairs = zip((self.row, self.column, self.alt), (*exact[:2], exact[4]), strict=True)
        off_row, off_column, off_alt = (np.abs(parabola.at(half)[at] - true).max() for parabola, true in pairs)
        return bool(max(off_row, off_column) < _OFF_POSTS and off_alt < _OFF_ALT)

    def _exact(self, east: Array, north: Array, t: float) -> tuple[Array, ...]:
        up = self._middle + HALF * t
        lat, lon, alt = self._frame.to_geodetic(np.stack(np.broadcast_arrays(east, north, up), axis=-1))
        row, column = self._mosaic.first.indices(lat, lon)
        from_origin = nearest_turn(lon - self._frame.lon0, 2 * np.pi)
        return row, column, lat, from_origin, alt


def _basis(places: Array) -> tuple[Array, Array]:
    """Nodes over the extent of the points, and the interpolation weights (points, nodes)."""
    low, high = places[0], places[-1]
    nodes = -np.cos(np.pi * np.arange(_NODES) / (_NODES - 1))
    chebyshev = np.polynomial.chebyshev.chebvander
    scaled = (2.0 * places - low - high) / (high - low)
    weights = np.linalg.solve(chebyshev(nodes, _NODES - 1).T, chebyshev(scaled, _NODES - 1).T).T
    return (low + high + nodes * (high - low)) / 2.0, np.asarray(weights)
