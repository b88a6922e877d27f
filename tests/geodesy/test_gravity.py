"""Normal gravity by the tables, the transport rate by what n does."""

from __future__ import annotations

import numpy as np

from fti.geodesy.gravity import normal_gravity, transport_rate
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef


def test_normal_gravity_at_equator_pole_and_45_degrees() -> None:
    """NIMA TR 8350.2, table 3.4, and the GRS80 value at 45 degrees."""
    lat = np.deg2rad([0.0, 90.0, 45.0])
    np.testing.assert_allclose(normal_gravity(lat, np.zeros(3)), [9.7803253359, 9.8321849378, 9.806199], atol=2e-6)


def test_the_transport_rate_is_the_turn_of_the_level() -> None:
    """Five places, moved for a millisecond: the matrix of n before and after."""
    lat, lon, alt = (
        np.deg2rad([-70.0, -10.0, 0.0, 45.0, 85.0]),
        np.deg2rad([0.0, 179.0, 5.0, -60.0, 90.0]),
        np.full(5, 3e3),
    )
    vel_n, h = np.array([[100.0, -50.0, 3.0]] * 5), 1e-3
    step_e = h * np.einsum("nij,nj->ni", mat_en(lat, lon), vel_n)
    here = ecef_from_geodetic(lat, lon, alt)
    before, after = (mat_en(*geodetic_from_ecef(here + sign * step_e)[:2]) for sign in (-1.0, 1.0))
    skew = np.einsum("nji,njk->nik", mat_en(lat, lon), after - before) / (2.0 * h)
    turned = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    np.testing.assert_allclose(transport_rate(lat, alt, vel_n), turned, atol=1e-10)
