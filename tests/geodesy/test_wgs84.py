import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.geodesy.formulas import SEMI_MAJOR, SEMI_MINOR
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef, radii

LATS = st.floats(-np.pi / 2, np.pi / 2)
LONS = st.floats(-np.pi, np.pi)
ALTS = st.floats(-11_000.0, 2.0e7)


def test_agrees_with_proj_both_ways() -> None:
    """Forward to rounding.  PROJ's own inverse is a single Bowring step, good to 0.01 mm at these heights."""
    rng = np.random.default_rng(1)
    lat, lon = np.arcsin(rng.uniform(-1, 1, 2000)), rng.uniform(-np.pi, np.pi, 2000)
    alt = rng.uniform(-5000, 30_000, 2000)
    forward = pyproj.Transformer.from_crs(4979, 4978, always_xy=True)
    expected = np.stack(forward.transform(lon, lat, alt, radians=True), axis=-1)
    assert np.abs(ecef_from_geodetic(lat, lon, alt) - expected).max() < 4e-9
    x, y, z = expected.T
    lon_p, lat_p, alt_p = forward.transform(x, y, z, direction="INVERSE", radians=True)
    lat_f, lon_f, alt_f = geodetic_from_ecef(expected)
    assert np.abs(lat_f - lat_p).max() * SEMI_MAJOR < 1e-5
    assert np.abs(lon_f - lon_p).max() * SEMI_MAJOR < 5e-9
    assert np.abs(alt_f - alt_p).max() < 2e-5


@given(lat=LATS, lon=LONS, alt=ALTS)
def test_geodetic_and_back_is_the_same_place(lat: float, lon: float, alt: float) -> None:
    place = ecef_from_geodetic(lat, lon, alt)
    back = ecef_from_geodetic(*geodetic_from_ecef(place))
    assert np.linalg.norm(back - place) < 2e-15 * np.linalg.norm(place)


@given(lat=LATS, alt=ALTS)
def test_height_and_latitude_come_back(lat: float, alt: float) -> None:
    lat_b, _, alt_b = geodetic_from_ecef(ecef_from_geodetic(lat, 0.3, alt))
    assert abs(alt_b - alt) < 1e-15 * SEMI_MAJOR + 1e-15 * abs(alt) + 5e-9
    assert abs(lat_b - lat) < 1e-15


def test_poles_and_equator_have_the_axes_of_the_ellipsoid() -> None:
    assert ecef_from_geodetic(0.0, 0.0, 0.0) == pytest.approx([SEMI_MAJOR, 0, 0], abs=1e-9)
    assert ecef_from_geodetic(np.pi / 2, 0.0, 0.0)[2] == pytest.approx(SEMI_MINOR, abs=1e-9)
    lat, _, alt = geodetic_from_ecef([[0.0, 0.0, SEMI_MINOR + 5.0], [0.0, 0.0, -SEMI_MINOR - 5.0]])
    assert lat == pytest.approx([np.pi / 2, -np.pi / 2], abs=1e-15)
    assert alt == pytest.approx([5.0, 5.0], abs=1e-8)


def test_radii_are_the_derivatives_of_position() -> None:
    lat, step = np.array([-1.2, -0.3, 0.0, 0.64, 1.4]), 1e-4
    r_meridian, r_normal = radii(lat)
    north = ecef_from_geodetic(lat + step, 0.0, 0.0) - ecef_from_geodetic(lat - step, 0.0, 0.0)
    assert np.linalg.norm(north, axis=1) / (2 * step) == pytest.approx(r_meridian, rel=1e-8)
    east = ecef_from_geodetic(lat, step, 0.0) - ecef_from_geodetic(lat, -step, 0.0)
    assert np.linalg.norm(east, axis=1) / (2 * step) == pytest.approx(r_normal * np.cos(lat), rel=1e-8)
