"""Geodesy of single points, in plain numbers: the functions of ``fti.geodesy`` for arrays, for one point.

An array of one number takes ten times as long.  Formulas and order of operations are those of ``wgs84`` and ``local``,
so results are identical to the last bit (tests/geodesy/test_one_point.py).  Sines are those of numpy, because those of
``math`` differ.
"""

from __future__ import annotations

import math

import numpy as np

from fti.geodesy.local import LocalFrame
from fti.geodesy.wgs84 import ECC_SQ, SEMI_MAJOR


def radii(lat: float) -> tuple[float, float]:
    """``wgs84.radii``: of the meridian and of the prime vertical [m] at lat [rad]."""
    root = _root(float(np.sin(lat)))
    return SEMI_MAJOR * (1.0 - ECC_SQ) / root**3, SEMI_MAJOR / root


def ecef_from_geodetic(lat: float, lon: float, alt: float) -> tuple[float, float, float]:
    """``wgs84.ecef_from_geodetic``: e frame [m] of lat, lon [rad], alt above the ellipsoid [m]."""
    sin_lat = float(np.sin(lat))
    r_normal = SEMI_MAJOR / _root(sin_lat)
    level = (r_normal + alt) * float(np.cos(lat))
    z = (r_normal * (1.0 - ECC_SQ) + alt) * sin_lat
    return level * float(np.cos(lon)), level * float(np.sin(lon)), z


def to_local(frame: LocalFrame, lat: float, lon: float, alt: float) -> tuple[float, float, float]:
    """``LocalFrame.to_local``: east, north, up [m]."""
    east, north, up = ((np.array(ecef_from_geodetic(lat, lon, alt)) - frame.origin_e) @ frame.mat_le.T).tolist()
    return east, north, up


def _root(sin_lat: float) -> float:
    inside = 1.0 - ECC_SQ * sin_lat**2
    return math.sqrt(inside) if inside >= 0.0 else math.nan
