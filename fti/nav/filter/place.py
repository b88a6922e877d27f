"""Where an estimate is, compiled: what ``fti.geodesy`` does for arrays, for one point that is asked a thousand times.

The formulas are those of ``fti.geodesy.wgs84`` and ``rotations``, and so are their sources; the way back is
``fti.geodesy.one_point``, in plain numbers.
Checked against: those, tests/nav/test_filter_place.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.wgs84 import BOWRING_STEPS, ECC2_SQ, ECC_SQ, FLATTENING, SEMI_MAJOR, SEMI_MINOR
from fti.terrain.kernel import kernel

Array = NDArray[np.float64]


@kernel
def geodetic(y: Array) -> tuple[float, float, float]:
    """lat, lon [rad], alt above the ellipsoid [m] of the position that begins a row, e frame [m]."""
    p, z = np.hypot(y[0], y[1]), y[2]
    up, across = z, (1.0 - FLATTENING) * p
    sin_lat, cos_lat = 0.0, 1.0
    for _ in range(BOWRING_STEPS):
        norm = np.hypot(up, across)
        sin_lat = z + ECC2_SQ * SEMI_MINOR * (up / norm) ** 3
        cos_lat = p - ECC_SQ * SEMI_MAJOR * (across / norm) ** 3
        up, across = (1.0 - FLATTENING) * sin_lat, cos_lat
    norm = np.hypot(sin_lat, cos_lat)
    sin_lat, cos_lat = sin_lat / norm, cos_lat / norm
    alt = p * cos_lat + z * sin_lat - SEMI_MAJOR * np.sqrt(1.0 - ECC_SQ * sin_lat**2)
    return np.arctan2(sin_lat, cos_lat), np.arctan2(y[1], y[0]), alt


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
