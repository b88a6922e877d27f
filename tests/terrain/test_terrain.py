import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from fti.geodesy.local import LocalFrame
from fti.terrain.terrain import Terrain

LAT0, LON0, ALT0 = np.radians(36.63), np.radians(-84.17), 360.0


def tilted() -> Terrain:
    east, north = np.meshgrid(-100.0 + 5.0 * np.arange(41), -50.0 + 5.0 * np.arange(21))
    return Terrain.from_array(
        0.3 * east - 0.2 * north + 12.0, 5.0, lat0=LAT0, lon0=LON0, alt0=ALT0, east0=-100.0, north0=-50.0
    )


def test_row_0_is_south_and_column_0_west() -> None:
    ground = Terrain.from_array([[1.0, 2.0], [3.0, 5.0]], 10.0, lat0=LAT0, lon0=LON0, east0=100.0, north0=200.0)
    assert ground.up([100, 110, 100, 110], [200, 200, 210, 210]).tolist() == [1.0, 2.0, 3.0, 5.0]
    assert ground.up(105.0, 205.0) == pytest.approx(11.0 / 4)  # the mean of four posts at the centre of a tile
    assert ground.up(102.5, 207.5) == pytest.approx(1 + 0.25 * 1 + 0.75 * 2 + 0.25 * 0.75 * 1)


def test_plane_is_read_exactly_with_its_gradient_and_normal() -> None:
    ground = tilted()
    rng = np.random.default_rng(1)
    east, north = rng.uniform(-100, 100, 200), rng.uniform(-50, 50, 200)
    assert ground.up(east, north) == pytest.approx(0.3 * east - 0.2 * north + 12.0, abs=1e-12)
    slope_east, slope_north = ground.gradient(east, north)
    assert slope_east == pytest.approx(np.full(200, 0.3)) and slope_north == pytest.approx(np.full(200, -0.2))
    assert ground.normal(3.0, 4.0) == pytest.approx(np.array([-0.3, 0.2, 1.0]) / np.sqrt(1.13))
    assert ground.normal(east, north).shape == (200, 3)


def test_gradient_is_the_derivative_of_up() -> None:
    ground = Terrain.from_array(np.random.default_rng(2).normal(0, 3, (9, 9)), 2.0, lat0=LAT0, lon0=LON0)
    east, north, step = np.array([3.1, 7.7, 12.3]), np.array([1.3, 8.9, 14.9]), 1e-6
    slope_east, slope_north = ground.gradient(east, north)
    assert slope_east == pytest.approx((ground.up(east + step, north) - ground.up(east - step, north)) / 2e-6, abs=1e-7)
    assert slope_north == pytest.approx(
        (ground.up(east, north + step) - ground.up(east, north - step)) / 2e-6, abs=1e-7
    )


def test_nan_outside_the_coverage_and_not_on_its_edge() -> None:
    ground = tilted()
    edge_east, edge_north = np.array([-100.0, 100.0, 100.0]), np.array([-50.0, 50.0, -50.0])
    assert np.isfinite(ground.up(edge_east, edge_north)).all()
    assert np.isnan(ground.up(edge_east * 1.0001, edge_north * 1.0001)).all()
    assert np.isnan(ground.gradient(101.0, 0.0)).all()
    assert np.isnan(ground.up(np.nan, 0.0))
    assert np.isnan(ground.height(LAT0 + 0.1, LON0))


def test_height_is_the_ellipsoidal_height_of_the_point_on_the_surface() -> None:
    rng = np.random.default_rng(3)
    heights = rng.normal(0, 15, (81, 81)) + 300.0
    ground = Terrain.from_array(heights, 250.0, lat0=LAT0, lon0=LON0, alt0=ALT0, east0=-1e4, north0=-1e4)
    east, north = rng.uniform(-9900, 9900, (2, 7, 30))
    lat, lon, alt = ground.frame.to_geodetic(np.stack((east, north, ground.up(east, north)), axis=-1))
    assert ground.height(lat, lon).shape == (7, 30)
    assert np.abs(ground.height(lat, lon) - alt).max() < 1e-8


def test_curvature_of_the_earth_is_in_the_surface() -> None:
    """A sea at a constant ellipsoidal height bends below the tangent plane by d^2 / 2R."""
    frame = LocalFrame(LAT0, LON0, 0.0)
    posts = np.linspace(-9000.0, 9000.0, 721)
    east, north = np.meshgrid(posts, posts)
    up = np.zeros_like(east)
    for _ in range(3):
        up -= frame.to_geodetic(np.stack((east, north, up), axis=-1))[2]
    assert up[360, 720] == pytest.approx(-(9000.0**2) / (2 * 6_386_000), abs=0.01)
    sea = Terrain.from_array(up, 25.0, lat0=LAT0, lon0=LON0, east0=-9000.0, north0=-9000.0)
    heights = sea.height(LAT0 + np.linspace(-1e-3, 1e-3, 50), np.full(50, LON0))
    assert np.abs(heights).max() < 25.0**2 / (8 * 6.35e6) + 1e-6  # bilinear posts of a sphere: c^2 / 8R


@pytest.mark.parametrize(("distance", "error"), [(1e3, 0.08), (5e3, 2.0), (10e3, 7.8), (50e3, 196.0)])
def test_error_of_a_flat_earth_is_as_stated(distance: float, error: float) -> None:
    frame = LocalFrame(LAT0, LON0, ALT0)
    around = np.linspace(0.0, 2.0 * np.pi, 16)
    level = np.zeros(16)
    for _ in range(4):  # the point at that distance whose height above the ellipsoid is that of the origin
        level -= (
            frame.to_geodetic(np.stack((distance * np.sin(around), distance * np.cos(around), level), -1))[2] - ALT0
        )
    assert level == pytest.approx(np.full(16, -error), rel=0.03)
    tilt = frame.mat_ln(*frame.to_geodetic(np.array([0.0, distance, level[0]]))[:2])[:, 2] @ np.array([0.0, 0.0, -1.0])
    assert np.arccos(tilt) == pytest.approx(0.16e-3 * distance / 1e3, rel=0.03)


@pytest.mark.parametrize(
    ("heights", "cell", "message"),
    [
        (np.zeros((1, 5)), 5.0, "2 x 2"),
        (np.zeros(7), 5.0, "2 x 2"),
        (np.array([[0.0, np.inf], [0.0, 1.0]]), 5.0, "1 posts are infinite"),
        (np.zeros((3, 3)), 0.0, "cell_m"),
    ],
)
def test_what_is_no_surface_is_refused(heights: np.ndarray, cell: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Terrain.from_array(heights, cell, lat0=LAT0, lon0=LON0)


@pytest.mark.parametrize("copied", [lambda t: pickle.loads(pickle.dumps(t)), copy.deepcopy])
def test_a_copy_casts_on_its_own_posts(copied: Callable[[Terrain], Terrain]) -> None:
    """The kernels read addresses: the original's may be another process's, or given back."""
    ground = Terrain.from_array(np.random.default_rng(3).normal(0.0, 5.0, (40, 50)), 5.0)
    origin, rays = [100.0, 90.0, 60.0], [[0.1, 0.2, -1.0], [0.0, 0.0, -1.0]]
    expected = ground.cast(origin, rays, 500.0)
    other = copied(ground)
    assert other.pyramid.addresses.heights == other.pyramid.heights.ctypes.data
    assert other.pyramid.addresses.maxima == other.pyramid.maxima.ctypes.data
    del ground
    assert other.cast(origin, rays, 500.0).tolist() == expected.tolist()
