"""The local frame l: east, north, up in the tangent plane at one point."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.geodesy import formulas
from fti.geodesy.formulas import Vector
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef

#: East, north, up from north, east, down; its own inverse.
MAT_ENU_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@dataclass(frozen=True)
class LocalFrame:
    """A Cartesian east, north, up frame at lat0, lon0 [rad], alt0 [m] above the ellipsoid.

        x_l = mat_le (x_e - x_e0)

    It is a rigid rotation of the earth frame, so distances and rays are preserved.  ``up`` is not a height: a point at
    distance d with the height alt has about up = alt - alt0 - d^2 / 2R (the exact value is computed).
    """

    lat0: float
    lon0: float
    alt0: float
    origin_e: Array = field(init=False, repr=False, compare=False)
    mat_le: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "origin_e", ecef_from_geodetic(self.lat0, self.lon0, self.alt0))
        object.__setattr__(self, "mat_le", MAT_ENU_NED @ mat_en(self.lat0, self.lon0).T)

    def to_local(self, lat: ArrayLike, lon: ArrayLike, alt: ArrayLike) -> Array:
        """East, north, up [m], shape (..., 3), of geodetic positions (lat, lon [rad], alt above the ellipsoid [m])."""
        return np.asarray((ecef_from_geodetic(lat, lon, alt) - self.origin_e) @ self.mat_le.T)

    def point_to_local(self, lat: float, lon: float, alt: float) -> Vector:
        """``to_local`` of one point."""
        x, y, z = formulas.ecef_from_geodetic(lat, lon, alt)
        x0, y0, z0 = self.origin_e.tolist()
        return formulas.rotate(self.mat_le.tolist(), (x - x0, y - y0, z - z0))

    def to_geodetic(self, enu: ArrayLike) -> tuple[Array, Array, Array]:
        """lat, lon [rad] and alt above the ellipsoid [m] of east, north, up positions of shape (..., 3) [m]."""
        return geodetic_from_ecef(np.asarray(enu, dtype=np.float64) @ self.mat_le + self.origin_e)

    def mat_ln(self, lat: ArrayLike, lon: ArrayLike) -> Array:
        """North, east, down at lat, lon [rad] to this frame, shape (..., 3, 3).

        At the origin it only reorders the axes; elsewhere it includes the rotation of the vertical by the Earth's
        curvature (0.9 mrad at 6 km).
        """
        return np.asarray(self.mat_le @ mat_en(lat, lon))
