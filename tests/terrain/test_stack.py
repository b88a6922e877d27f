"""Layers of different cells as one surface: which counts where, that nothing gapes, and what a ray says of a hole."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.local import LocalFrame
from fti.terrain.file_info import NO_SOURCE
from fti.terrain.layer import Layer
from fti.terrain.nearest_ray import cast_bundle_min
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]
FRAME = LocalFrame(0.64, -1.47, 0.0)
DOWN = np.array([0.0, 0.0, -1.0])


def stack(gap: float = 0.0, hole: bool = False) -> Terrain:
    """A level plain at 100 m of 10 m cells; in its middle 2 m cells with a hill of 20 m."""
    plain, hill = np.full((21, 21), 100.0), np.full((31, 31), 100.0 - gap)
    hill[10:20, 10:20] = 120.0
    origin = np.ones((31, 31), dtype=np.uint8)
    origin[:, :15] = 7
    if hole:
        hill[15, 15] = np.nan
        plain[2, 2] = np.nan
    return Terrain((Layer(hill, 2.0, 60.0, 60.0, origin), Layer(plain, 10.0, 0.0, 0.0)), FRAME)


def test_the_finer_layer_counts_where_it_lies() -> None:
    ground = stack()
    assert ground.up([90.0, 30.0, 60.0, 120.0], [90.0, 30.0, 90.0, 120.0]).tolist() == [120.0, 100.0, 100.0, 100.0]
    assert ground.cell([90.0, 30.0, 250.0], [90.0, 30.0, 90.0])[:2].tolist() == [2.0, 10.0]
    assert np.isnan(ground.cell(250.0, 90.0))
    assert ground.source([70.0, 110.0, 30.0, 250.0], [90.0, 90.0, 30.0, 90.0]).tolist() == [7, 1, 0, NO_SOURCE]
    assert ground.gradient(79.0, 90.0)[0] == pytest.approx(10.0)
    above = np.array([[90.0, 90.0, 500.0], [30.0, 30.0, 500.0]])
    assert ground.cast(above, DOWN, 1e3).tolist() == [380.0, 400.0]


def test_what_a_finer_layer_covers_is_not_looked_at() -> None:
    ground = stack()
    coarse = ground.layers[1].heights.copy()
    coarse[8:11, 8:11] = 400.0  # a tower that the finer source does not know
    built_over = Terrain((ground.layers[0], Layer(coarse, 10.0, 0.0, 0.0)), FRAME)
    assert built_over.cast([90.0, 90.0, 500.0], DOWN, 1e3) == 380.0
    assert built_over.cast([0.0, 90.0, 300.0], [1.0, 0.0, -1.0], 1e3) == pytest.approx(200.0 * np.sqrt(2.0))


@pytest.mark.parametrize("gap", [0.0, 9e-4, -9e-4])
def test_nothing_slips_through_a_seam(gap: float) -> None:
    """Rays along, across and down the seam; as steep a step as is let pass is a wall, from either side."""
    ground, along = stack(gap), np.linspace(60.0, 120.0, 61)
    on_seam = np.concatenate([np.column_stack((np.full(61, x), along)) for x in (60.0, 120.0)])
    rng = np.random.default_rng(1)
    near = on_seam + rng.choice([0.0, 1e-13, -1e-13, 1e-9, -1e-9], on_seam.shape)
    down = ground.cast(np.column_stack((near, np.full(len(near), 130.0))), DOWN, 1e3)
    assert np.abs(down - 30.0).max() <= abs(gap) + 1e-12
    for ray in ([0.0, 1.0, -1e-3], [0.0, -1.0, -1e-3], [1.0, 0.0, -1e-3], [-1.0, 0.0, -1e-3], [1.0, 1.0, -1e-3]):
        level = ground.cast(np.column_stack((near, np.full(len(near), 100.02))), ray, 1e3)
        assert np.nanmax(level) <= 21.1 * np.linalg.norm(ray)
        assert np.isfinite(level).mean() > 0.5
    low = np.array([[50.0, 90.0, 100.0005], [130.0, 90.0, 100.0005]])
    assert np.isfinite(ground.cast(low, [[1.0, 0.0, -1e-5], [-1.0, 0.0, -1e-5]], 1e3)).all()


def test_a_ray_ends_at_a_hole_however_high_it_flies() -> None:
    ground = stack(hole=True)
    assert np.isnan(ground.up(91.0, 91.0)) and ground.source(91.0, 91.0) == NO_SOURCE
    origins = np.array([[91.0, 91.0, 500.0], [0.0, 90.5, 900.0], [70.0, 91.0, 500.0], [20.0, 20.0, 150.0]])
    rays = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    ranges, outcomes = ground.trace(origins, rays, 550.0)
    assert outcomes.tolist() == [RayOutcome.HOLE, RayOutcome.HOLE, RayOutcome.HIT, RayOutcome.HOLE]
    assert np.isnan(ranges[[0, 1, 3]]).all() and ranges[2] == 400.0
    assert ground.trace([0.0, 90.5, 900.0], [1.0, 0.0, 0.0], 80.0)[1] == RayOutcome.NOTHING  # ends before the hole
    # ground before the hole is seen
    assert ground.trace([40.0, 91.0, 110.0], [1.0, 0.0, 0.0], 500.0)[1] == RayOutcome.HIT


def test_every_ray_without_a_range_has_its_reason() -> None:
    ground = stack()
    cases = {
        RayOutcome.NOTHING: ([30.0, 30.0, 200.0], [0.0, 0.0, -1.0], 99.0),
        RayOutcome.OUTSIDE: ([30.0, 30.0, 200.0], [-1.0, 0.0, 0.0], 99.0),
        RayOutcome.BURIED: ([90.0, 90.0, 110.0], [0.0, 0.0, 1.0], 99.0),
        RayOutcome.UNKNOWN: ([90.0, np.nan, 110.0], [0.0, 0.0, 1.0], 99.0),
        RayOutcome.HIT: ([30.0, 30.0, 200.0], [0.0, 0.0, -1.0], 101.0),
    }
    for outcome, (origin, ray, max_range) in cases.items():
        found, reason = ground.trace(origin, ray, max_range)
        assert reason == outcome and np.isnan(found) == (outcome != RayOutcome.HIT)
    assert ground.trace([-50.0, 30.0, 50.0], [1.0, 0.0, 0.0], 99.0)[1] == RayOutcome.BURIED  # comes in from the side
    assert ground.trace([-50.0, 30.0, 50.0], [-1.0, 0.0, 0.0], 99.0)[1] == RayOutcome.OUTSIDE
    assert ground.trace([30.0, 30.0, 200.0], [0.0, 0.0, 1.0], np.inf)[1] == RayOutcome.NOTHING


def test_a_pool_gives_the_same_bytes() -> None:
    rng = np.random.default_rng(2)
    ground = stack(hole=True)
    origins = np.column_stack((rng.uniform(-10, 210, (70_000, 2)), rng.uniform(95, 200, 70_000)))
    rays = rng.normal(0, 1, (70_000, 3))
    alone = ground.trace(origins, rays, 300.0)
    with ThreadPoolExecutor(2) as pool:
        shared = ground.trace(origins, rays, 300.0, pool)
    assert set(np.unique(alone[1])) == set(RayOutcome) - {RayOutcome.UNKNOWN}
    assert [part.tobytes() for part in alone] == [part.tobytes() for part in shared]


def test_shapes_of_origins_and_rays() -> None:
    ground, origin = stack(), np.array([90.0, 90.0, 500.0])
    assert ground.cast(origin, DOWN, 1e3).shape == ()
    assert ground.cast(np.tile(origin, (4, 1)), DOWN, 1e3).tolist() == [380.0] * 4
    assert ground.cast(origin, 3.0 * np.tile(DOWN, (2, 3, 1)), 1e3).tolist() == [[380.0] * 3] * 2
    assert ground.cast(origin, np.empty((0, 3)), 1e3).shape == (0,)
    with pytest.raises(ValueError, match="three numbers"):
        ground.cast(origin[:2], DOWN[:2], 1e3)


def test_a_bundle_reports_when_something_nearer_is_not_ruled_out() -> None:
    mats = np.diag([1.0, -1.0, -1.0])[None]
    angles = np.array([[0.0, 0.0], [0.2, 0.0], [-0.2, 0.0], [0.0, 0.2]])
    places = {RayOutcome.HIT: (75.0, 75.0), RayOutcome.HOLE: (85.0, 91.0), RayOutcome.OUTSIDE: (190.0, 150.0)}
    for outcome, place in places.items():
        origin = np.array([[*place, 200.0]])
        found, at, reason = cast_bundle_min(stack(hole=True).pyramid, origin, mats, angles, 0.2, 3, 1e3)
        assert reason.tolist() == [outcome]
        assert np.isnan(found[0]) == np.isnan(at).all() == (outcome != RayOutcome.HIT)


HALF = np.zeros((6, 6))


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        ((), "at least one layer"),
        ((Layer(np.zeros((9, 9)), 10.0, 0.0, 0.0), Layer(HALF, 2.0, 20.0, 20.0)), "finest first"),
        ((Layer(HALF, 3.0, 20.0, 20.0), Layer(np.zeros((9, 9)), 10.0, 0.0, 0.0)), "not a multiple of 3.0 m"),
        ((Layer(HALF, 2.0, 21.0, 20.0), Layer(np.zeros((9, 9)), 10.0, 0.0, 0.0)), "edge of layer 0 at 21.0 m"),
        ((Layer(HALF + 0.1, 2.0, 20.0, 20.0), Layer(np.zeros((9, 9)), 10.0, 0.0, 0.0)), "0.100 m off the coarser"),
    ],
)
def test_layers_that_do_not_fit_are_refused(layers: tuple[Layer, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Terrain(layers, FRAME)


def test_what_is_no_layer_is_refused() -> None:
    with pytest.raises(ValueError, match="origin has the shape"):
        Layer(np.zeros((3, 3)), 1.0, 0.0, 0.0, np.zeros((2, 3), dtype=np.uint8))
    with pytest.raises(ValueError, match="must be finite"):
        Layer(np.zeros((3, 3)), 1.0, np.nan, 0.0)
