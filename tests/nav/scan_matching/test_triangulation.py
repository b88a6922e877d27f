"""Triangles between the points of a look: planes, checks of the geometry, times; the five-point search over them."""

from __future__ import annotations

import numpy as np
import pytest

from fti.arrays import Array
from fti.nav.scan_matching.look import Look
from fti.nav.scan_matching.triangulation import TriangulatedLook, register_printed

#: Where the grids begin, east and north [m].
ORIGIN = np.array([4e5, -7e5])


def look_of(points: Array, t: Array | None = None) -> Look:
    n = len(points)
    return Look(points, np.tile([0.0, 0.0, -1.0], (n, 1)), np.zeros(n) if t is None else t, 0.1)


def lattice(n: int, distance: float) -> Array:
    """East, north of a grid, slightly irregular, far from the origin; up 0."""
    places = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2) * distance
    places += np.random.default_rng(1).uniform(-0.2, 0.2, places.shape) * distance + ORIGIN
    return np.column_stack((places, np.zeros(n * n)))


def test_a_plane_and_a_linear_time_are_interpolated_exactly() -> None:
    points = lattice(20, 5.0)
    east, north = points[:, 0] - 4e5, points[:, 1] + 7e5
    points[:, 2] = 100.0 + 0.3 * east - 0.2 * north
    surface = TriangulatedLook(look_of(points, 7.0 + 0.01 * east))
    places = np.random.default_rng(2).uniform(10.0, 85.0, (500, 2))
    up, t = surface.at(places + ORIGIN)
    assert np.abs(up - (100.0 + 0.3 * places[:, 0] - 0.2 * places[:, 1])).max() < 1e-6
    assert np.abs(t - (7.0 + 0.01 * places[:, 0])).max() < 1e-9


def test_places_outside_have_no_height() -> None:
    up, t = TriangulatedLook(look_of(lattice(5, 5.0))).at(np.array([[4e5 + 500.0, -7e5], [0.0, 0.0]]))
    assert np.isnan(up).all() and np.isnan(t).all()


def test_a_sliver_has_no_height() -> None:
    """Corners 10 m apart and 0.5 m beside: an angle of 2.9 deg; 3 m beside: 16.7 deg."""
    for beside, is_known in ((0.5, False), (3.0, True)):
        corners = np.array([[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [10.0, beside, 0.0]])
        up, _ = TriangulatedLook(look_of(corners)).at(np.array([[10.0, 0.3 * beside]]))
        assert np.isfinite(up[0]) == is_known


def test_a_triangle_with_distant_corners_has_no_height() -> None:
    """Points 5 m apart around a hole: triangles across it have sides of 30 m."""
    points = lattice(21, 5.0)
    places = points[:, :2] - ORIGIN
    kept = np.abs(places - 50.0).max(axis=1) > 14.0
    surface = TriangulatedLook(look_of(points[kept]))
    middle, beside = (np.array([[4e5 + place, -7e5 + place]]) for place in (50.0, 20.0))
    assert np.isnan(surface.at(middle)[0][0])
    assert np.isfinite(surface.at(beside)[0][0])


def test_a_triangle_of_different_times_has_no_height() -> None:
    corners = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [5.0, 8.0, 0.0]])
    for last, is_known in ((0.2, True), (0.3, False)):
        up, _ = TriangulatedLook(look_of(corners, np.array([0.0, 0.0, last]))).at(np.array([[5.0, 3.0]]))
        assert np.isfinite(up[0]) == is_known


def hills(places: Array) -> Array:
    return np.asarray(4.0 * np.sin(places[:, 0] / 14.0) + 4.0 * np.sin(places[:, 1] / 11.0))


def test_the_search_finds_the_drift_and_the_time_to_overlap() -> None:
    """Points every 2 m on waves of 4 m; the later look is 0.8 s later and 3.1, -1.7, 0.9 m off."""
    drift = np.array([3.1, -1.7, 0.9])
    first, second = lattice(60, 2.0), lattice(60, 2.0)
    second[:, :2] += np.random.default_rng(3).uniform(-1.0, 1.0, (3600, 2)) + np.array([20.0, 10.0])
    for points in (first, second):
        points[:, 2] = hills(points[:, :2] - ORIGIN)
    t = 5.0 + (first[:, 0] - 4e5) / 1000.0
    later = 5.8 + (second[:, 0] - 4e5) / 1000.0
    found = register_printed(look_of(first, t), look_of(second + drift, later), 16.0, 0.05)
    assert np.abs(found.drift - drift).max() < 0.2
    assert found.interval == pytest.approx(0.8, abs=0.005)
    assert found.shifts >= 1 + 4 * 9


def test_looks_without_triangles_or_common_ground_are_refused() -> None:
    line = np.column_stack((np.arange(5.0), np.zeros(5), np.zeros(5)))
    for points in (np.zeros((0, 3)), np.zeros((2, 3)), line):
        with pytest.raises(ValueError, match=f"{len(points)} points make no triangle"):
            TriangulatedLook(look_of(points))
    here = lattice(10, 5.0)
    with pytest.raises(ValueError, match="too little ground in common"):
        register_printed(look_of(here), look_of(here + np.array([900.0, 0.0, 0.0])), 8.0, 0.1)
