"""The Earth of the simulated flights: WGS 84, its normal gravity, rotation and transport rate.

Source: Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd edition (2013),
equations 2.105, 2.106 (radii), 2.122 (Earth rate), 2.134, 2.139, 2.140 (gravity), 5.44 (transport rate).
North, east, down throughout; angles [rad], lengths [m].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SEMI_MAJOR_M = 6_378_137.0
FLATTENING = 1.0 / 298.257223563
SEMI_MINOR_M = SEMI_MAJOR_M * (1.0 - FLATTENING)
ECCENTRICITY2 = FLATTENING * (2.0 - FLATTENING)
GM_M3_S2 = 3.986004418e14
EARTH_RATE_RAD_S = 7.292115e-5
STANDARD_GRAVITY = 9.80665


def radii(lat: Array) -> tuple[Array, Array]:
    """Radii of curvature of the meridian and of the prime vertical [m]."""
    root = np.sqrt(1.0 - ECCENTRICITY2 * np.sin(lat) ** 2)
    return SEMI_MAJOR_M * (1.0 - ECCENTRICITY2) / root**3, SEMI_MAJOR_M / root


def gravity_n(lat: Array, alt: Array) -> Array:
    """Normal gravity with the centrifugal part, north, east, down (n, 3) [m/s^2]."""
    sin2 = np.sin(lat) ** 2
    surface = 9.7803253359 * (1.0 + 0.001931853 * sin2) / np.sqrt(1.0 - ECCENTRICITY2 * sin2)
    m = EARTH_RATE_RAD_S**2 * SEMI_MAJOR_M**2 * SEMI_MINOR_M / GM_M3_S2
    linear = 2.0 / SEMI_MAJOR_M * (1.0 + FLATTENING * (1.0 - 2.0 * sin2) + m)
    down = surface * (1.0 - linear * alt + 3.0 / SEMI_MAJOR_M**2 * alt**2)
    return np.stack((-8.08e-9 * alt * np.sin(2.0 * lat), np.zeros_like(lat), down), axis=-1)


def earth_rate_n(lat: Array) -> Array:
    """Rotation of the Earth (n, 3) [rad/s]."""
    return EARTH_RATE_RAD_S * np.stack((np.cos(lat), np.zeros_like(lat), -np.sin(lat)), axis=-1)


def transport_rate_n(lat: Array, alt: Array, vel_n: Array) -> Array:
    """Rotation of the local frame against the Earth at a velocity (n, 3) [rad/s]."""
    meridian, normal = radii(lat)
    north, east = vel_n[..., 0], vel_n[..., 1]
    over = east / (normal + alt)
    return np.stack((over, -north / (meridian + alt), -over * np.tan(lat)), axis=-1)


def displace(lat: Array, lon: Array, alt: Array, by_n: Array) -> tuple[Array, Array, Array]:
    """Latitude, longitude and height of points moved north, east, down (n, 3) [m]."""
    meridian, normal = radii(lat)
    return (
        lat + by_n[..., 0] / (meridian + alt),
        lon + by_n[..., 1] / ((normal + alt) * np.cos(lat)),
        alt - by_n[..., 2],
    )
