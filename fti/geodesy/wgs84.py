"""The WGS84 ellipsoid: constants, geodetic and earth-centred coordinates, radii of curvature.

Source: NIMA TR 8350.2, third edition (defining constants); Bowring 1976 and 1985 for the inverse.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Semi-major axis [m] and flattening: the two defining constants of the shape.
SEMI_MAJOR = 6378137.0
FLATTENING = 1.0 / 298.257223563
SEMI_MINOR = SEMI_MAJOR * (1.0 - FLATTENING)
#: First and second eccentricity, squared.
ECC_SQ = FLATTENING * (2.0 - FLATTENING)
ECC2_SQ = ECC_SQ / (1.0 - ECC_SQ)
#: Angular rate of the Earth [rad/s].
EARTH_RATE = 7.292115e-5

#: Steps of the iteration for the latitude.
BOWRING_STEPS = 3


def radii(lat: ArrayLike) -> tuple[Array, Array]:
    """Radii of curvature of the meridian and of the prime vertical [m].

        r_meridian = a (1 - e^2) / (1 - e^2 sin^2 lat)^(3/2)      r_normal = a / sqrt(1 - e^2 sin^2 lat)

    lat     : float or ndarray [rad]
    Returns : (r_meridian, r_normal), each with the shape of ``lat``
    """
    root = np.sqrt(1.0 - ECC_SQ * np.sin(lat) ** 2)
    return np.asarray(SEMI_MAJOR * (1.0 - ECC_SQ) / root**3), np.asarray(SEMI_MAJOR / root)


def ecef_from_geodetic(lat: ArrayLike, lon: ArrayLike, alt: ArrayLike) -> Array:
    """Earth-centred, earth-fixed position.

    lat, lon : float or ndarray [rad]; alt : height above the ellipsoid [m]; shapes broadcast
    Returns  : ndarray, shape (..., 3) [m], e frame
    """
    lat, lon, alt = np.broadcast_arrays(*(np.asarray(value, dtype=np.float64) for value in (lat, lon, alt)))
    _, r_normal = radii(lat)
    level = (r_normal + alt) * np.cos(lat)
    z = (r_normal * (1.0 - ECC_SQ) + alt) * np.sin(lat)
    return np.stack((level * np.cos(lon), level * np.sin(lon), z), axis=-1)


def geodetic_from_ecef(xyz: ArrayLike) -> tuple[Array, Array, Array]:
    """Geodetic position: the inverse of ``ecef_from_geodetic``.

    Bowring's iteration on the reduced latitude, in sines and cosines, so that the poles need no special case; three
    steps are exact to rounding (about 1e-9 m) between 1000 km below and 50 000 km above the ellipsoid.  The height is
    p cos lat + z sin lat - a sqrt(1 - e^2 sin^2 lat), without a division.

    xyz     : ndarray, shape (..., 3) [m], e frame
    Returns : lat, lon [rad], alt above the ellipsoid [m], each of shape (...)
    Source  : Bowring 1976 (latitude), 1985 (height).  Checked against pyproj in tests/geodesy/test_wgs84.py.
    """
    x, y, z = np.moveaxis(np.asarray(xyz, dtype=np.float64), -1, 0)
    p = np.hypot(x, y)
    up, across = z, (1.0 - FLATTENING) * p  # tangent of the reduced latitude, as a fraction
    for _ in range(BOWRING_STEPS):
        norm = np.hypot(up, across)
        sin_lat = z + ECC2_SQ * SEMI_MINOR * (up / norm) ** 3
        cos_lat = p - ECC_SQ * SEMI_MAJOR * (across / norm) ** 3
        up, across = (1.0 - FLATTENING) * sin_lat, cos_lat
    norm = np.hypot(sin_lat, cos_lat)
    sin_lat, cos_lat = sin_lat / norm, cos_lat / norm
    alt = p * cos_lat + z * sin_lat - SEMI_MAJOR * np.sqrt(1.0 - ECC_SQ * sin_lat**2)
    return np.arctan2(sin_lat, cos_lat), np.arctan2(y, x), alt
