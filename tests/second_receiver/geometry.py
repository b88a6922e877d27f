"""WGS84 and rotations, from their definitions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SEMI_MAJOR_M = 6378137.0
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY_SQ = FLATTENING * (2.0 - FLATTENING)

#: Origin of every local frame of this package [rad]; its height is 0.
LAT0, LON0 = np.deg2rad(47.6), np.deg2rad(12.2)


def _axes(lat: float, lon: float) -> Array:
    """East, north and up as rows, in earth-centred coordinates: (3, 3)."""
    sp, cp, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    return np.array([[-sl, cl, 0.0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]])


def _earth_centred(lat: Array, lon: Array, alt: Array) -> Array:
    normal = SEMI_MAJOR_M / np.sqrt(1.0 - ECCENTRICITY_SQ * np.sin(lat) ** 2)
    xy = (normal + alt) * np.cos(lat)
    return np.stack((xy * np.cos(lon), xy * np.sin(lon), (normal * (1.0 - ECCENTRICITY_SQ) + alt) * np.sin(lat)), -1)


def to_geodetic(place: ArrayLike) -> tuple[Array, Array, Array]:
    """lat, lon [rad], height above the ellipsoid [m] of places east, north, up [m] (n, 3) in the frame of LAT0, LON0.

    By iteration of the latitude; a nanometre after six steps at the heights of aircraft.
    """
    origin = _earth_centred(np.array(LAT0), np.array(LON0), np.array(0.0))
    x, y, z = (np.asarray(place, dtype=np.float64) @ _axes(LAT0, LON0) + origin).T
    radius, lat = np.hypot(x, y), np.arctan2(z, np.hypot(x, y))
    alt = np.zeros_like(lat)
    for _ in range(6):
        normal = SEMI_MAJOR_M / np.sqrt(1.0 - ECCENTRICITY_SQ * np.sin(lat) ** 2)
        alt = radius / np.cos(lat) - normal
        lat = np.arctan2(z, radius * (1.0 - ECCENTRICITY_SQ * normal / (normal + alt)))
    return lat, np.arctan2(y, x), alt


def body_to_enu(roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike) -> Array:
    """(n, 3, 3): columns are the aircraft's forward, right and down axis as east, north, up.  Angles (n,) [rad]."""
    roll, pitch, heading = (np.asarray(a, dtype=np.float64) for a in (roll, pitch, heading))
    level_forward = np.stack((np.sin(heading), np.cos(heading), np.zeros_like(heading)), -1)
    level_right = np.stack((np.cos(heading), -np.sin(heading), np.zeros_like(heading)), -1)
    down = np.broadcast_to(np.array([0.0, 0.0, -1.0]), level_right.shape)
    sp, cp, sr, cr = (f[..., None] for f in (np.sin(pitch), np.cos(pitch), np.sin(roll), np.cos(roll)))
    forward = level_forward * cp - down * sp
    belly = level_forward * sp + down * cp
    return np.stack((forward, level_right * cr + belly * sr, belly * cr - level_right * sr), -1)
