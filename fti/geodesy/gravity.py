"""Normal gravity, and the transport rate: rotation of the navigation frame due to motion.

Source: NIMA TR 8350.2, third edition, 4.1 (Somigliana's formula); Titterton and Weston 2004, section 3.5 (transport
rate).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.geodesy.wgs84 import ECC_SQ, radii

Array = NDArray[np.float64]

#: Normal gravity at the equator [m/s^2], Somigliana's constant, free-air gradient [1/s^2].
GRAVITY_EQUATOR, SOMIGLIANA, FREE_AIR = 9.7803253359, 0.00193185265241, 3.086e-6


def normal_gravity(lat: ArrayLike, alt: ArrayLike) -> Array:
    """Normal gravity [m/s^2], positive, down along the ellipsoid's normal.

        g = g_equator (1 + k sin^2 lat) / sqrt(1 - e^2 sin^2 lat) - 3.086e-6 / s^2  alt

    lat [rad], alt above the ellipsoid [m] : float or ndarray; shapes broadcast.
    """
    sin_sq = np.sin(lat) ** 2
    return np.asarray(somigliana(sin_sq) - FREE_AIR * np.asarray(alt, dtype=np.float64))


def somigliana(sin_sq_lat: Array) -> Array:
    """Normal gravity on the ellipsoid [m/s^2] by the squared sine of the latitude."""
    return GRAVITY_EQUATOR * (1.0 + SOMIGLIANA * sin_sq_lat) / np.sqrt(1.0 - ECC_SQ * sin_sq_lat)


def transport_rate(lat: Array, alt: Array, vel_n: Array) -> Array:
    """omega_en_n [rad/s], shape (n, 3): rotation rate of n against e at a velocity vel_n [m/s], shape (n, 3).

    lat [rad], alt [m] : shape (n,).  The down component grows without bound towards the poles, where n is
                         discontinuous.
    """
    r_meridian, r_normal = radii(lat)
    north, east = vel_n[:, 0] / (r_meridian + alt), vel_n[:, 1] / (r_normal + alt)
    return np.stack((east, -north, -east * np.tan(lat)), axis=1)
