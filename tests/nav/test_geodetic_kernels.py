"""Compiled geodesy of one point against that of arrays, including poles, date line and heights."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.nav.filter import geodetic_kernels

LATS = (-np.pi / 2, -1.2, -1e-9, 0.0, 0.7, 1.5707, np.pi / 2)
LONS = (-np.pi, -0.3, 0.0, 2.5, np.pi)
PLACES = list(itertools.product(LATS, LONS, (-400.0, 0.0, 12_000.0)))


@pytest.mark.parametrize(("lat", "lon", "alt"), PLACES)
def test_it_agrees_with_geodesy_of_arrays(lat: float, lon: float, alt: float) -> None:
    """To a nanometre, and 1e-15 of a turn."""
    here_e = ecef_from_geodetic(lat, lon, alt)
    result, of_arrays = geodetic_kernels.geodetic(here_e), geodetic_from_ecef(here_e)
    np.testing.assert_allclose(result[:2], of_arrays[:2], rtol=0.0, atol=1e-15)
    assert result[2] == pytest.approx(float(of_arrays[2]), abs=2e-9)
    np.testing.assert_allclose(geodetic_kernels.axes(lat, lon), mat_en(lat, lon), rtol=0.0, atol=1e-15)
