"""Geodetic and earth-centred coordinates and radii of curvature of arrays: ``fti.geodesy.formulas``, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.geodesy import formulas
from fti.kernel import flatten, kernel

_radii_of, _ecef_of, _geodetic_of = formulas.radii, formulas.ecef_from_geodetic, formulas.geodetic_from_ecef


def radii(lat: ArrayLike) -> tuple[Array, Array]:
    """Radii of curvature of the meridian and of the prime vertical [m], each with the shape of ``lat`` [rad]."""
    shape, (flat,) = flatten(lat)
    r_meridian, r_normal = _all_radii(flat)
    return r_meridian.reshape(shape), r_normal.reshape(shape)


def metres_per_radian(lat: ArrayLike, alt: ArrayLike) -> tuple[Array, Array]:
    """Metres north per radian of latitude, and east per radian of longitude; lat [rad], alt [m] of any shapes."""
    (r_meridian, r_normal), up = radii(lat), np.asarray(alt, dtype=np.float64)
    return r_meridian + up, (r_normal + up) * np.cos(lat)


def displace(lat: Array, lon: Array, alt: Array, by_n: Array) -> tuple[Array, Array, Array]:
    """lat, lon [rad] and alt [m] of points moved north, east, down (..., 3) [m], which is short against the radii."""
    per_lat, per_lon = metres_per_radian(lat, alt)
    return lat + by_n[..., 0] / per_lat, lon + by_n[..., 1] / per_lon, alt - by_n[..., 2]


def ecef_from_geodetic(lat: ArrayLike, lon: ArrayLike, alt: ArrayLike) -> Array:
    """Earth-centred, earth-fixed position.

    lat, lon : float or ndarray [rad]; alt : height above the ellipsoid [m]; shapes broadcast
    Returns  : ndarray, shape (..., 3) [m], e frame
    """
    shape, places = flatten(lat, lon, alt)
    return _all_ecef(*places).reshape(*shape, 3)


def geodetic_from_ecef(xyz: ArrayLike) -> tuple[Array, Array, Array]:
    """Geodetic position: the inverse of ``ecef_from_geodetic``.

    xyz     : ndarray, shape (..., 3) [m], e frame
    Returns : lat, lon [rad], alt above the ellipsoid [m], each of shape (...)
    """
    shape, (flat,) = flatten(xyz)
    lat, lon, alt = _all_geodetic(flat.reshape(-1, 3))
    return lat.reshape(shape[:-1]), lon.reshape(shape[:-1]), alt.reshape(shape[:-1])


@kernel
def _all_radii(lat: Array) -> tuple[Array, Array]:
    r_meridian, r_normal = np.empty(len(lat)), np.empty(len(lat))
    for i in range(len(lat)):
        r_meridian[i], r_normal[i] = _radii_of(lat[i])
    return r_meridian, r_normal


@kernel
def _all_ecef(lat: Array, lon: Array, alt: Array) -> Array:
    xyz = np.empty((len(lat), 3))
    for i in range(len(lat)):
        xyz[i] = _ecef_of(lat[i], lon[i], alt[i])
    return xyz


@kernel
def _all_geodetic(xyz: Array) -> tuple[Array, Array, Array]:
    lat, lon, alt = np.empty(len(xyz)), np.empty(len(xyz)), np.empty(len(xyz))
    for i in range(len(xyz)):
        lat[i], lon[i], alt[i] = _geodetic_of(xyz[i, 0], xyz[i, 1], xyz[i, 2])
    return lat, lon, alt
