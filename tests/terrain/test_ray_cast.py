"""Rays against an exact solution of every cell of the grid, in extended precision."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fti.terrain.layer import Layer
from fti.terrain.nearest_ray import cast_bundle_min
from fti.terrain.pyramid_nodes import slot
from fti.terrain.ray_cast import cast_one
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain
from tests.terrain_kernels import warm_up

Array = NDArray[np.float64]
Long = NDArray[np.longdouble]
LAT0, LON0 = 0.64, -1.47


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    warm_up()


def terrain(heights: Array, cell: float = 5.0, east0: float = 0.0, north0: float = 0.0) -> Terrain:
    return Terrain.from_array(heights, cell, lat0=LAT0, lon0=LON0, east0=east0, north0=north0)


def smallest_root(f0: Long, b: Long, a: Long, low: Long, high: Long) -> Long:
    """Smallest root of f0 + b t + a t^2 in [low, high] for each cell, inf without one; textbook formula."""
    with np.errstate(all="ignore"):
        disc = np.sqrt(b * b - 4 * a * f0)
        roots = np.stack(((-b - disc) / (2 * a), (-b + disc) / (2 * a), np.where(a == 0, -f0 / b, np.nan)))
    slack = 1e-13 * (1 + np.abs(high))
    roots[~((roots >= low - slack) & (roots <= high + slack))] = np.inf
    return np.asarray(roots.min(axis=0))


def brute_force(ground: Terrain, origin: Array, direction: Array, max_range: float) -> float:
    """The first hit among all cells, each solved on its own in long double; inf without one; starts above."""
    z = ground.finest.heights.astype(np.longdouble)
    base, rise_x, rise_y = z[:-1, :-1], z[:-1, 1:] - z[:-1, :-1], z[1:, :-1] - z[:-1, :-1]
    twist = z[1:, 1:] - z[1:, :-1] - rise_x
    o, d = origin.astype(np.longdouble), direction.astype(np.longdouble)
    iy, ix = np.indices(base.shape)
    u0, v0 = (
        (o[0] - ground.finest.east0) / ground.finest.cell_m - ix,
        (o[1] - ground.finest.north0) / ground.finest.cell_m - iy,
    )
    vx, vy = d[0] / ground.finest.cell_m, d[1] / ground.finest.cell_m
    low, high = np.zeros_like(base), np.full_like(base, max_range)
    for at, speed in ((u0, vx), (v0, vy)):
        if speed == 0:
            high = np.where((at < 0) | (at > 1), -1.0, high)
        else:
            ends = np.stack(((0 - at) / speed, (1 - at) / speed))
            low, high = np.maximum(low, ends.min(axis=0)), np.minimum(high, ends.max(axis=0))
    f0 = o[2] - (base + u0 * rise_x + v0 * (rise_y + u0 * twist))
    b = d[2] - vx * (rise_x + v0 * twist) - vy * (rise_y + u0 * twist)
    found = smallest_root(f0, b, -twist * vx * vy, low, high)
    return float(np.where(high >= low, found, np.inf).min())


def incidence(ground: Terrain, point: Array, direction: Array) -> float:
    return float(abs(ground.normal(point[0], point[1]) @ direction))


def check_ray(ground: Terrain, origin: Array, direction: Array, max_range: float = 400.0) -> float:
    """The ray agrees with brute force and ends on the surface; returns its range."""
    direction = direction / np.linalg.norm(direction)
    value = float(ground.cast(origin, direction, max_range))
    expected = brute_force(ground, origin, direction, max_range)
    assert np.isnan(value) == (expected == np.inf), (value, expected)
    if not np.isnan(value):
        point = origin + value * direction
        size = np.array(ground.finest.heights.shape[::-1]) - 1
        inside = np.clip(point[:2], 0, ground.finest.cell_m * size)
        assert np.abs(inside - point[:2]).max() < 1e-9
        assert abs(point[2] - ground.up(*inside)) <= 1e-9
        grazing = incidence(ground, np.append(inside, 0), direction)
        assert abs(value - expected) <= max(1e-8, 1e-11 / max(grazing, 1e-9))
    return value


def random_ray(rng: np.random.Generator, ground: Terrain) -> tuple[Array, Array]:
    rows, columns = ground.finest.heights.shape
    place = rng.uniform(0, 1, 2) * ground.finest.cell_m * np.array([columns - 1, rows - 1])
    above = float(ground.up(*place)) + rng.choice([1e-3, 1.0, 30.0])
    flatness = rng.choice([0.01, 0.1, 1.0])
    return np.array([*place, above]), rng.normal(0, 1, 3) * [1, 1, flatness]


@pytest.mark.parametrize("roughness", [0.0, 0.3, 3.0, 30.0])
def test_random_rays_equal_brute_force(roughness: float) -> None:
    rng = np.random.default_rng(5)
    ground = terrain(rng.normal(0, 1, (23, 38)) * roughness)
    hits = 0
    for _ in range(400):
        hits += not np.isnan(check_ray(ground, *random_ray(rng, ground)))
    assert 100 < hits < 400


def test_tilted_plane_has_the_closed_form() -> None:
    east, north = np.meshgrid(5.0 * np.arange(60), 5.0 * np.arange(40))
    ground = terrain(0.2 * east - 0.1 * north + 7.0)
    normal = np.array([-0.2, 0.1, 1.0])
    rng = np.random.default_rng(6)
    origins = np.array([150.0, 100.0, 90.0]) + rng.uniform(-20, 20, (500, 3))
    rays = rng.normal(0, 0.4, (500, 3)) - [0, 0, 1]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    expected = (7.0 - origins @ normal) / (rays @ normal)
    point = origins + expected[:, None] * rays
    hit = (expected > 0) & (point[:, 0] > 0) & (point[:, 0] < 295) & (point[:, 1] > 0) & (point[:, 1] < 195)
    values = ground.cast(origins, rays, 1e4)
    assert hit.sum() > 300
    assert np.abs(values[hit] / expected[hit] - 1).max() < 1e-12
    assert np.isnan(values[~hit]).all()


@settings(max_examples=150)
@given(
    posts=st.lists(st.integers(-3, 3), min_size=35, max_size=35),
    place=st.tuples(st.integers(0, 12), st.integers(0, 8)),
    above=st.sampled_from([0.5, 1.0, 3.0, 6.5]),
    ray=st.tuples(st.integers(-3, 3), st.integers(-3, 3), st.integers(-3, 3)).filter(any),
)
def test_rays_along_edges_and_through_posts(
    posts: list[int], place: tuple[int, int], above: float, ray: tuple[int, int, int]
) -> None:
    """Whole numbers put the rays on edges, diagonals and posts, flat cells and double roots among them."""
    ground = terrain(np.array(posts, dtype=float).reshape(5, 7), cell=1.0)
    x, y = place[0] / 2, place[1] / 2
    z = float(ground.up(x, y)) + above
    direction = np.array(ray, dtype=float)
    origin = np.array([x, y, z])
    unit = direction / np.linalg.norm(direction)
    value = float(np.nan_to_num(ground.cast(origin, unit, 50.0), nan=np.inf))
    # a ray that only touches is a hit or a miss by rounding; a ray 1 nm lower hits sooner, one 1 nm higher later
    sooner, later = (brute_force(ground, origin + np.array([0, 0, dz]), unit, 50.0) for dz in (-1e-9, 1e-9))
    assert sooner - 1e-12 <= value <= later + 1e-12
    if value < np.inf:
        point = origin + value * unit
        assert abs(point[2] - ground.up(*np.clip(point[:2], 0, [6, 4]))) < 1e-9


def test_vertical_ray_reads_the_height() -> None:
    rng = np.random.default_rng(7)
    ground = terrain(rng.normal(0, 20, (30, 30)))
    places = np.concatenate((rng.uniform(0, 145, (300, 2)), 5.0 * rng.integers(0, 30, (300, 2))))
    origins = np.column_stack((places, np.full(600, 500.0)))
    heights = 500.0 - ground.cast(origins, np.array([0.0, 0.0, -1.0]), 1000.0)
    assert np.abs(heights - ground.up(*places.T)).max() < 1e-12 * 1000
    assert np.isnan(ground.cast(origins, np.array([0.0, 0.0, 1.0]), 1000.0)).all()


def test_grazing_ray_touches_a_ridge_or_passes_it() -> None:
    heights = np.zeros((9, 41))
    heights[:, 20] = 10.0
    ground = terrain(heights)
    for margin, hit in ((-1e-6, True), (1e-6, False)):
        origin = np.array([3.0, 17.0, 10.0 + margin])
        value = float(ground.cast(origin, np.array([1.0, 0.0, 0.0]), 500.0))
        assert np.isnan(value) != hit
        if hit:
            assert value == pytest.approx(97.0 - 5.0 * 1e-7, abs=1e-9)


def test_origin_on_the_surface_is_a_range_of_zero_and_under_it_none() -> None:
    ground = terrain(np.full((9, 9), 4.0))
    rays = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.6, 0.8, 0.0], [0.6, 0.0, 0.8]])
    for height in (4.0, 4.0 + 0.9e-9, 4.0 - 0.9e-9):
        ranges, outcomes = ground.trace(np.array([11.0, 13.0, height]), rays, 100.0)
        assert (ranges == 0.0).all() and (outcomes == RayOutcome.HIT).all()
    for height in (4.0 - 2e-9, 3.0):
        ranges, outcomes = ground.trace(np.array([11.0, 13.0, height]), rays, 100.0)
        assert np.isnan(ranges).all() and (outcomes == RayOutcome.BURIED).all()


def test_outside_the_coverage() -> None:
    ground = terrain(np.full((9, 9), 4.0))
    inward = np.array([1.0, 0.0, -0.1]) / np.hypot(1.0, 0.1)
    assert ground.cast(np.array([-20.0, 20.0, 7.0]), inward, 1e3) == pytest.approx(30.0 * np.hypot(1.0, 0.1))
    assert np.isnan(ground.cast(np.array([-20.0, 20.0, 5.0]), inward, 1e3))  # enters from the side, below the surface
    assert np.isnan(ground.cast(np.array([-20.0, 20.0, 7.0]), -inward, 1e3))
    assert np.isnan(ground.cast(np.array([41.0, 20.0, 7.0]), np.array([0.0, 0.0, -1.0]), 1e3))


def test_nothing_beyond_the_maximum_range() -> None:
    ground = terrain(np.zeros((9, 9)))
    down = np.array([0.0, 0.0, -1.0])
    assert ground.cast(np.array([20.0, 20.0, 99.0]), down, 99.5) == 99.0
    assert np.isnan(ground.cast(np.array([20.0, 20.0, 99.0]), down, 98.5))


def test_nan_pose_is_a_nan_range() -> None:
    ground = terrain(np.zeros((9, 9)))
    assert np.isnan(ground.cast(np.array([[np.nan, 20.0, 9.0], [20.0, 20.0, np.nan]]), [0.0, 0.0, -1.0], 1e3)).all()


def test_bad_calls_are_refused() -> None:
    ground = terrain(np.zeros((9, 9)))
    with pytest.raises(ValueError, match="length 0"):
        ground.cast([20.0, 20.0, 9.0], [0.0, 0.0, 0.0], 1e3)
    with pytest.raises(ValueError, match="max_range"):
        ground.cast([20.0, 20.0, 9.0], [0.0, 0.0, -1.0], float("nan"))


def blocks(heights: Array, level: int) -> Iterator[tuple[int, int, Array]]:
    """East and north number of each node of a level, and its posts."""
    size = 4**level
    rows, columns = heights.shape
    for north in range(-(-(rows - 1) // size)):
        for east in range(-(-(columns - 1) // size)):
            posts = heights[north * size : (north + 1) * size + 1, east * size : (east + 1) * size + 1]
            yield east, north, posts


def test_pyramid_holds_the_maximum_of_every_node() -> None:
    heights = np.random.default_rng(8).normal(0, 1, (14, 23))
    pyramid = terrain(heights).pyramid
    for level, (start, wide) in enumerate(pyramid.levels.tolist()):
        maxima = pyramid.nodes["highest"] if level else pyramid.maxima
        for east, north, posts in blocks(heights, level):
            found = maxima[start + slot(east, north, wide)]
            assert posts.max() <= found <= np.nextafter(np.float32(posts.max()), np.float32(np.inf))
    assert pyramid.maxima.ctypes.data % 64 == pyramid.nodes.ctypes.data % 64 == 0
    assert pyramid.addresses.summit == pyramid.nodes["highest"][pyramid.levels[-1]["start"]]


def test_plane_of_a_node_lies_on_its_highest_posts_and_under_none() -> None:
    """Above every post by at least the rounding margin, and at the one that limits it by hardly more."""
    rng = np.random.default_rng(8)
    north, east = np.mgrid[:70.0, :90.0]
    heights = 300.0 + 0.8 * east - 1.7 * north + rng.normal(0, 0.05, (70, 90))
    pyramid = terrain(heights).pyramid
    for level, (start, wide) in enumerate(pyramid.levels[1:].tolist(), 1):
        for x, y, posts in blocks(heights, level):
            node = pyramid.nodes[start + slot(x, y, wide)]
            row, column = np.mgrid[: posts.shape[0], : posts.shape[1]]
            slope_x, slope_y, base = (float(node[name]) for name in ("slope_x", "slope_y", "base"))
            above = base + slope_x * column + slope_y * row - posts
            assert 1e-7 < above.min() < 1e-4
            assert (slope_x, slope_y) == pytest.approx((0.8, -1.7), abs=0.3)


@pytest.mark.parametrize("unknown", [False, True])
def test_rays_in_turns_do_what_each_does_alone(unknown: bool) -> None:
    """Bit by bit, on two layers with holes: ranges and outcomes of many rays, and of each through ``cast_one``."""
    rng = np.random.default_rng(21)
    coarse, fine = np.full((12, 14), 3.0), rng.normal(3.0, 2.0, (25, 25))
    coarse[7:] += rng.normal(0.0, 4.0, (5, 14))
    fine[0], fine[-1], fine[:, 0], fine[:, -1] = 3.0, 3.0, 3.0, 3.0
    if unknown:
        fine[9, 11] = coarse[9, 4] = np.nan
    layers = (Layer(fine, 1.0, 16.0, 0.0), Layer(coarse, 8.0, 0.0, 0.0))
    ground = Terrain(layers, Terrain.from_array(np.zeros((2, 2)), 1.0).frame)
    origins = rng.uniform((-10, -10, 1), (110, 95, 30), (3000, 3))
    rays = rng.normal(0.0, (1.0, 1.0, 0.4), (3000, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    ranges, outcomes = ground.trace(origins, rays, 90.0)
    rays /= np.sqrt((rays[:, 0] * rays[:, 0] + rays[:, 1] * rays[:, 1]) + rays[:, 2] * rays[:, 2])[:, None]
    cast: Any = cast_one
    alone = [cast(ground.pyramid, *o, *d, 90.0) for o, d in zip(origins.tolist(), rays.tolist(), strict=True)]
    assert outcomes.tolist() == [outcome for _, outcome in alone]
    assert ranges.tobytes() == np.array([r for r, _ in alone]).tobytes()
    assert set(outcomes.tolist()) >= {RayOutcome.HIT, RayOutcome.NOTHING, RayOutcome.OUTSIDE, RayOutcome.BURIED}
    assert (RayOutcome.HOLE in outcomes) == unknown


def test_bundle_is_the_nearest_of_its_rays() -> None:
    rng = np.random.default_rng(9)
    ground = terrain(rng.normal(0, 3, (40, 40)))
    angles = np.concatenate((np.zeros((1, 2)), rng.uniform(-0.3, 0.3, (60, 2))))
    mats = np.tile(np.diag([1.0, -1.0, -1.0]), (25, 1, 1))
    origins = np.column_stack((rng.uniform(60, 130, (25, 2)), rng.uniform(20, 60, 25)))
    off = np.linalg.norm(angles, axis=1)
    rays = np.column_stack((angles * np.sinc(off / np.pi)[:, None], np.cos(off))) @ mats[0].T
    expected = [np.nanmin(ground.cast(origin, rays, 500.0)) for origin in origins]
    found, _, outcomes = cast_bundle_min(ground.pyramid, origins, mats, angles, 0.5, 0, 500.0)
    assert found == pytest.approx(expected, abs=1e-11)
    assert (outcomes == RayOutcome.HIT).all()
    refined, _, _ = cast_bundle_min(ground.pyramid, origins, mats, angles, 0.5, 4, 500.0)
    assert (refined <= found).all() and (refined < found - 1e-3).any()
