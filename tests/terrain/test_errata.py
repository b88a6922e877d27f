"""Equations of section 2.2.2 and 2.2.3 as they are printed, and where they fail."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

POSTS = np.array([[10.0, 12.0], [11.0, 17.0]])  # T11, T12; T21, T22: a twisted cell


def printed_height(posts: Array, lat: float, lon: float, *, corrected: bool = False) -> float:
    """Eq. 2.50 and 2.51 on the cell [0, 1] x [0, 1]; corrected: latitude in the denominator of a3."""
    along_south = posts[0, 0] + (posts[0, 1] - posts[0, 0]) * lon
    along_north = posts[1, 0] + (posts[1, 1] - posts[1, 0]) * lon
    r1, r2 = np.array([0.0, lon]), np.array([1.0, lon])  # the auxiliary points have the longitude of P
    with np.errstate(all="ignore"):
        a3 = np.float64(along_north - along_south) / ((r2 - r1)[0 if corrected else 1])
        return float(a3 * lat + along_south - a3 * r1[0])


def test_2_51_divides_by_the_difference_of_equal_longitudes() -> None:
    ground = Terrain.from_array(POSTS, 1.0)
    for lat, lon in ((0.3, 0.6), (0.9, 0.2)):
        assert not np.isfinite(printed_height(POSTS, lat, lon))
        assert printed_height(POSTS, lat, lon, corrected=True) == pytest.approx(float(ground.up(lon, lat)))


def printed_slope_east(posts: Array, lat: float, lon: float, *, corrected: bool = False) -> float:
    """Eq. 4.7 and 4.8 on the cell [0, 1] x [0, 1]; corrected: longitude in the denominator."""
    west = posts[0, 0] + (posts[1, 0] - posts[0, 0]) * lat
    east = posts[0, 1] + (posts[1, 1] - posts[0, 1]) * lat
    q1, q2 = np.array([lat, 0.0]), np.array([lat, 1.0])  # the auxiliary points have the latitude of P
    with np.errstate(all="ignore"):
        return float(np.float64(east - west) / ((q2 - q1)[1 if corrected else 0]))


def test_4_7_divides_by_the_difference_of_equal_latitudes() -> None:
    ground = Terrain.from_array(POSTS, 1.0)
    for lat, lon in ((0.3, 0.6), (0.9, 0.2)):
        assert not np.isfinite(printed_slope_east(POSTS, lat, lon))
        slope_east, _ = ground.gradient(lon, lat)
        assert printed_slope_east(POSTS, lat, lon, corrected=True) == pytest.approx(float(slope_east))


def printed_intersections(posts: Array, origin: Array, ray: Array) -> list[Array]:
    """Eq. 2.52 to 2.62 on the cell [0, 1] x [0, 1]: the intersections that are called valid."""
    a, b, c, d = (np.array([x, y, posts[int(y), int(x)]]) for x, y in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)))
    ba, ca, bent = b - a, c - a, a - b - c + d
    k1 = np.array([-ray[1], ray[0], 0.0])  # 2.54
    k2 = np.cross(k1, ray)
    eta = (ba @ k2) * (bent @ k1) - (ba @ k1) * (bent @ k2)  # 2.59
    p1, p2 = (origin - a) @ k1, (origin - a) @ k2
    kappa = p1 * (bent @ k2) - (ba @ k1) * (ca @ k2) - p2 * (bent @ k1) + (ba @ k2) * (ca @ k1)
    xi = p1 * (ca @ k2) - p2 * (ca @ k1)
    with np.errstate(all="ignore"):
        half = kappa / (2 * eta)
        found = -half + np.array([-1.0, 1.0]) * np.sqrt(half**2 - xi / eta)  # 2.60
        other = (p1 - found * (ba @ k1)) / (ca @ k1 + found * (bent @ k1))  # 2.61
    inside = (found >= 0) & (found <= 1) & (other >= 0) & (other <= 1)  # 2.62
    return [a + s * ba + t * ca + s * t * bent for s, t in zip(found[inside], other[inside], strict=True)]


def unit(*vector: float) -> Array:
    return np.asarray(np.array(vector) / np.linalg.norm(vector))


def test_the_auxiliary_planes_agree_where_they_exist() -> None:
    ground, origin, ray = Terrain.from_array(POSTS, 1.0), np.array([0.1, 0.2, 15.0]), unit(0.3, 0.4, -3.0)
    (point,) = printed_intersections(POSTS, origin, ray)
    assert float(ground.cast(origin, ray, 100.0)) == pytest.approx(float(np.linalg.norm(point - origin)), abs=1e-9)


def test_2_54_has_no_planes_for_the_nadir_ray() -> None:
    ground, origin, ray = Terrain.from_array(POSTS, 1.0), np.array([0.3, 0.6, 20.0]), unit(0.0, 0.0, -1.0)
    assert printed_intersections(POSTS, origin, ray) == []
    assert float(ground.cast(origin, ray, 100.0)) == pytest.approx(20.0 - float(ground.up(0.3, 0.6)), abs=1e-12)


def test_2_60_divides_by_zero_on_a_plane_cell() -> None:
    posts = np.array([[10.0, 12.0], [11.0, 13.0]])
    ground, origin, ray = Terrain.from_array(posts, 1.0), np.array([0.1, 0.2, 15.0]), unit(0.3, 0.4, -3.0)
    assert printed_intersections(posts, origin, ray) == []
    value = float(ground.cast(origin, ray, 100.0))
    assert origin[2] + value * ray[2] == pytest.approx(10.0 + np.array([2.0, 1.0]) @ (origin + value * ray)[:2])


def test_2_62_takes_the_ground_behind_a_ray_that_leads_away() -> None:
    ground, origin, ray = Terrain.from_array(POSTS, 1.0), np.array([0.1, 0.2, 15.0]), -unit(0.3, 0.4, -3.0)
    (point,) = printed_intersections(POSTS, origin, ray)
    assert (point - origin) @ ray < 0
    assert np.isnan(ground.cast(origin, ray, 100.0))
