"""Normal gravity, and the transport rate: rotation of the navigation frame due to motion.

Source: ``fti.geodesy.formulas``; Titterton and Weston 2004, section 3.5 (transport rate).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.geodesy import formulas
from fti.geodesy.wgs84 import radii
from fti.kernel import flatten, kernel

_gravity_of = formulas.normal_gravity


def normal_gravity(lat: ArrayLike, alt: ArrayLike) -> Array:
    """Normal gravity [m/s^2], positive, down along the ellipsoid's normal.

    lat [rad], alt above the ellipsoid [m] : float or ndarray; shapes broadcast.
    """
    shape, places = flatten(lat, alt)
    return _all_gravity(*places).reshape(shape)


@kernel
def _all_gravity(lat: Array, alt: Array) -> Array:
    gravity = np.empty(len(lat))
    for i in range(len(lat)):
        gravity[i] = _gravity_of(math.sin(lat[i]), alt[i])
    return gravity


def transport_rate(lat: Array, alt: Array, vel_n: Array) -> Array:
    """omega_en_n [rad/s], shape (n, 3): rotation rate of n against e at a velocity vel_n [m/s], shape (n, 3).

    lat [rad], alt [m] : shape (n,).  The down component grows without bound towards the poles, where n is
                         discontinuous.
    """
    r_meridian, r_normal = radii(lat)
    north, east = vel_n[:, 0] / (r_meridian + alt), vel_n[:, 1] / (r_normal + alt)
    return np.stack((east, -north, -east * np.tan(lat)), axis=1)
