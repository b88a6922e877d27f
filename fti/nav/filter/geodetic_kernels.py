"""Geodetic position of one point, compiled: the scalar form of ``fti.geodesy``, which works on arrays.

The formulas are those of ``fti.geodesy.wgs84`` and ``rotations``, and so are their sources.
Checked against: those, tests/nav/test_geodetic_kernels.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.wgs84 import BOWRING_STEPS, ECC_SQ, SEMI_MAJOR
from fti.nav.inertial.normal_height_kernel import normal_at
from fti.terrain.kernel import kernel

Array = NDArray[np.float64]


@kernel
def geodetic(y: Array) -> tuple[float, float, float]:
    """lat, lon [rad], alt above the ellipsoid [m] of the first three values of a row, e frame [m]."""
    sin_lat, cos_lat, alt = normal_at(np.hypot(y[0], y[1]), y[2], BOWRING_STEPS)
    return np.arctan2(sin_lat, cos_lat), np.arctan2(y[1], y[0]), alt


@kernel
def ecef(lat: float, lon: float, alt: float) -> tuple[float, float, float]:
    """The inverse: e frame [m] of lat, lon [rad], alt above the ellipsoid [m]."""
    normal = SEMI_MAJOR / np.sqrt(1.0 - ECC_SQ * np.sin(lat) ** 2)
    radial = (normal + alt) * np.cos(lat)
    return radial * np.cos(lon), radial * np.sin(lon), (normal * (1.0 - ECC_SQ) + alt) * np.sin(lat)


@kernel
def axes(lat: float, lon: float) -> Array:
    """mat_en (3, 3): north, east, down at lat, lon [rad] to e."""
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    return np.array(
        [
            [-sin_lat * cos_lon, -sin_lon, -cos_lat * cos_lon],
            [-sin_lat * sin_lon, cos_lon, -cos_lat * sin_lon],
            [cos_lat, 0.0, -sin_lat],
        ]
    )


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    lat, lon, _ = geodetic(np.array([SEMI_MAJOR, 0.0, 0.0]))
    axes(lat, lon)
