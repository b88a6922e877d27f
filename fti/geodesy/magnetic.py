"""The Earth's magnetic field: the World Magnetic Model 2025 to its full degree of 12.

    X' = - sum (a/r)^(n+2) (g cos m lon + h sin m lon) dP/dphi        north, in the plane of the sphere
    Y' =   sum (a/r)^(n+2) m (g sin m lon - h cos m lon) P / cos phi   east
    Z' = - sum (n+1) (a/r)^(n+2) (g cos m lon + h sin m lon) P         down

with the geocentric latitude phi, the Schmidt semi-normalised functions P of sin phi, degree n and order m, g and h of
the year; X' and Z' are then rotated by phi - lat into the plane of the ellipsoid.  The field of the crust is not
included: some 140 nT in a component, 0.4 deg of declination in central Europe (the report's error model).

Source: Chulliat et al., The US/UK World Magnetic Model for 2025-2030, eq. 4-17; coefficients: wmm2025.txt.
Checked against: the test values that NOAA publishes with the model.
"""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.geodesy.wgs84 import ecef_from_geodetic

Legendre = dict[tuple[int, int], Array]

EPOCH, LAST_YEAR = 2025.0, 2030.0
RADIUS = 6371.2e3
NANO_TESLA = 1e-9
COEFFICIENTS = Path(__file__).with_name("wmm2025.txt")


def magnetic_field_n(lat: ArrayLike, lon: ArrayLike, alt: ArrayLike, year: float) -> Array:
    """Magnetic flux density, north, east, down [T], shape (n, 3).

    lat, lon [rad] and alt above the ellipsoid [m], shape (n,); not at a pole, where east is undefined
    year : decimal.  Raises ValueError outside 2025 to 2030.
    """
    if not EPOCH <= year <= LAST_YEAR:
        raise ValueError(f"year = {year}: must be {EPOCH:.0f} to {LAST_YEAR:.0f}, the validity of the magnetic model")
    lat, lon, alt = np.broadcast_arrays(*(np.atleast_1d(np.asarray(x, dtype=np.float64)) for x in (lat, lon, alt)))
    x, y, z = ecef_from_geodetic(lat, lon, alt).T
    phi, r = np.arctan2(z, np.hypot(x, y)), np.sqrt(x**2 + y**2 + z**2)
    north, east, down = _spherical(phi, lon, RADIUS / r, year - EPOCH)
    tilt = phi - lat
    return NANO_TESLA * np.stack(
        [north * np.cos(tilt) - down * np.sin(tilt), east, north * np.sin(tilt) + down * np.cos(tilt)], axis=1
    )


def _spherical(phi: Array, lon: Array, nearness: Array, years: float) -> tuple[Array, Array, Array]:
    """North, east, down in the frame of the sphere [nT].  nearness : radius of the model over the distance."""
    functions = _legendre(phi, 13)
    north, east, down = np.zeros_like(phi), np.zeros_like(phi), np.zeros_like(phi)
    for n, m, g0, h0, g_rate, h_rate in _coefficients():
        g, h = g0 + g_rate * years, h0 + h_rate * years
        cos, sin, p, share = np.cos(m * lon), np.sin(m * lon), functions[n, m], nearness ** (n + 2)
        slope = (n + 1) * np.tan(phi) * p - np.sqrt((n + 1) ** 2 - m**2) / np.cos(phi) * functions[n + 1, m]
        north -= share * (g * cos + h * sin) * slope
        east += share * m * (g * sin - h * cos) * p / np.cos(phi)
        down -= share * (n + 1) * (g * cos + h * sin) * p
    return north, east, down


def _legendre(phi: Array, degree: int) -> Legendre:
    """Schmidt semi-normalised functions of sin phi by degree and order, to ``degree``."""
    sin, cos = np.sin(phi), np.cos(phi)
    functions = {(0, 0): np.ones_like(phi)}
    for n in range(1, degree + 1):
        functions[n, n] = cos * functions[n - 1, n - 1] * (np.sqrt((2 * n - 1) / (2 * n)) if n > 1 else 1.0)
        for m in range(n):
            before = functions[n - 2, m] * np.sqrt((n - 1) ** 2 - m**2) if m < n - 1 else 0.0
            functions[n, m] = ((2 * n - 1) * sin * functions[n - 1, m] - before) / np.sqrt(n**2 - m**2)
    return functions


@functools.cache
def _coefficients() -> list[tuple[int, int, float, float, float, float]]:
    """Degree, order, g, h [nT] and their rates [nT/year]."""
    rows = np.loadtxt(COEFFICIENTS)
    return [(int(n), int(m), g, h, g_rate, h_rate) for n, m, g, h, g_rate, h_rate in rows.tolist()]
