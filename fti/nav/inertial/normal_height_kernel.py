"""Ellipsoid normal through a point, and height along it, compiled."""

from __future__ import annotations

import numpy as np

from fti.geodesy.wgs84 import ECC2_SQ, ECC_SQ, FLATTENING, SEMI_MAJOR, SEMI_MINOR
from fti.terrain.kernel import kernel


@kernel
def normal_at(across: float, z: float, steps: int) -> tuple[float, float, float]:
    """Sine and cosine of the latitude, and the height above the ellipsoid [m].

    across : distance from the axis of the Earth [m]; z : e frame [m]; steps : of Bowring's iteration
    Source : as ``fti.geodesy.wgs84.geodetic_from_ecef``, which is the same for arrays
    """
    up, radial = z, (1.0 - FLATTENING) * across
    sin_lat, cos_lat = 0.0, 1.0
    for _ in range(steps):
        norm = np.hypot(up, radial)
        sin_lat = z + ECC2_SQ * SEMI_MINOR * (up / norm) ** 3
        cos_lat = across - ECC_SQ * SEMI_MAJOR * (radial / norm) ** 3
        up, radial = (1.0 - FLATTENING) * sin_lat, cos_lat
    norm = np.hypot(sin_lat, cos_lat)
    sin_lat, cos_lat = sin_lat / norm, cos_lat / norm
    return sin_lat, cos_lat, across * cos_lat + z * sin_lat - SEMI_MAJOR * np.sqrt(1.0 - ECC_SQ * sin_lat**2)
