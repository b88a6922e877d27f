"""Gravity and rotation of the simulated Earth, north, east, down; the product uses another form of gravity.

Source: Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd edition (2013),
equations 2.122 (Earth rate), 2.134, 2.139, 2.140 (gravity).
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import EARTH_RATE, ECC_SQ, FLATTENING, SEMI_MAJOR, SEMI_MINOR

GM_M3_S2 = 3.986004418e14


def gravity_n(lat: Array, alt: Array) -> Array:
    """Normal gravity with the centrifugal part, north, east, down (n, 3) [m/s^2]."""
    sin2 = np.sin(lat) ** 2
    surface = 9.7803253359 * (1.0 + 0.001931853 * sin2) / np.sqrt(1.0 - ECC_SQ * sin2)
    m = EARTH_RATE**2 * SEMI_MAJOR**2 * SEMI_MINOR / GM_M3_S2
    linear = 2.0 / SEMI_MAJOR * (1.0 + FLATTENING * (1.0 - 2.0 * sin2) + m)
    down = surface * (1.0 - linear * alt + 3.0 / SEMI_MAJOR**2 * alt**2)
    return np.stack((-8.08e-9 * alt * np.sin(2.0 * lat), np.zeros_like(lat), down), axis=-1)


def earth_rate_n(lat: Array) -> Array:
    """Rotation of the Earth (n, 3) [rad/s]."""
    return EARTH_RATE * np.stack((np.cos(lat), np.zeros_like(lat), -np.sin(lat)), axis=-1)
