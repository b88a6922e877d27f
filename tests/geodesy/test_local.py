import numpy as np
import pyproj
import pytest

from fti.geodesy.local import LocalFrame
from fti.geodesy.rotations import mat_from_rpy
from fti.geodesy.wgs84 import radii

LAT0, LON0, ALT0 = np.radians(36.58), np.radians(-84.25), 320.0


@pytest.fixture
def frame() -> LocalFrame:
    return LocalFrame(LAT0, LON0, ALT0)


def test_agrees_with_proj_topocentric(frame: LocalFrame) -> None:
    rng = np.random.default_rng(3)
    lat, lon = LAT0 + rng.uniform(-0.002, 0.002, 500), LON0 + rng.uniform(-0.002, 0.002, 500)
    alt = rng.uniform(0, 3000, 500)
    proj = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lat_0={np.degrees(LAT0):.17g} +lon_0={np.degrees(LON0):.17g} +h_0={ALT0}"
    )
    expected = np.stack(proj.transform(lon, lat, alt, radians=True), axis=-1)
    assert np.abs(frame.to_local(lat, lon, alt) - expected).max() < 5e-9


def test_geodetic_comes_back(frame: LocalFrame) -> None:
    enu = np.random.default_rng(4).uniform(-20_000, 20_000, (6, 50, 3))
    assert np.abs(frame.to_local(*frame.to_geodetic(enu)) - enu).max() < 5e-9


def test_up_drops_with_the_square_of_the_distance(frame: LocalFrame) -> None:
    lat, _, alt = frame.to_geodetic([0.0, 6000.0, 0.0])
    r_meridian, _ = radii(LAT0)
    assert alt - ALT0 == pytest.approx(6000.0**2 / (2 * (r_meridian + ALT0)), abs=1e-3)
    assert lat > LAT0


def test_navigation_axes_at_the_origin_are_reordered(frame: LocalFrame) -> None:
    expected = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
    assert frame.mat_ln(LAT0, LON0) == pytest.approx(np.array(expected), abs=1e-15)


def test_navigation_axes_elsewhere_are_the_derivatives_of_position(frame: LocalFrame) -> None:
    lat, lon, alt = frame.to_geodetic([5000.0, -7000.0, 300.0])
    mat = frame.mat_ln(lat, lon)
    down = (frame.to_local(lat, lon, alt - 50) - frame.to_local(lat, lon, alt + 50)) / 100
    north = frame.to_local(lat + 1e-6, lon, alt) - frame.to_local(lat - 1e-6, lon, alt)
    east = frame.to_local(lat, lon + 1e-6, alt) - frame.to_local(lat, lon - 1e-6, alt)
    axes = np.stack((north / np.linalg.norm(north), east / np.linalg.norm(east), down), axis=-1)
    assert mat == pytest.approx(axes, abs=1e-8)
    assert (mat @ mat_from_rpy(0.1, 0.2, 0.3)).shape == (3, 3)
    assert frame.mat_ln(np.full(7, lat), np.full(7, lon)).shape == (7, 3, 3)
