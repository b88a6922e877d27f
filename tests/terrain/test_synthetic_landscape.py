import functools

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.terrain.landscape import Cover, Landscape
from fti.terrain.synthetic_landscape import LANDSCAPES, RUNWAY_M, synthetic_landscape, synthetic_terrain

Array = NDArray[np.float64]


@functools.cache
def made(name: str, seed: int = 5, extent_m: float = 2000.0) -> Landscape:
    return synthetic_landscape(name, seed, extent_m=extent_m)


def heights(name: str) -> Array:
    return made(name).ground.finest.heights


@pytest.mark.parametrize("name", LANDSCAPES)
def test_same_seed_same_bytes_and_another_seed_another_land(name: str) -> None:
    small = [synthetic_landscape(name, seed, extent_m=500.0, cell_m=10.0) for seed in (1, 1, 2)]
    first, again, other = (scene.surface.finest.heights.tobytes() + scene.cover.tobytes() for scene in small)
    assert first == again
    assert (first == other) == (name == "plane")
    assert synthetic_terrain(name, 1, extent_m=500.0, cell_m=10.0).finest.heights.tobytes() == (
        small[0].surface.finest.heights.tobytes()
    )


@pytest.mark.parametrize("name", LANDSCAPES)
def test_posts_lie_around_the_origin_and_nothing_stands_on_bare_ground_water_or_tarmac(name: str) -> None:
    scene = made(name)
    layer = scene.ground.finest
    assert layer.heights.shape == (401, 401) and (layer.east0, layer.north0) == (-1000.0, -1000.0)
    assert np.isfinite(layer.heights).all()
    low = np.isin(scene.cover, [Cover.BARE, Cover.GRASS, Cover.WATER, Cover.TARMAC])
    assert (scene.canopy[low] == 0.0).all() and (scene.canopy[~low] > 0.0).all()


def test_rough_is_40_m_and_broken() -> None:
    assert heights("rough").std() == pytest.approx(40.0, rel=0.5)  # a third of the longest wave: not one sample of it
    assert 2.4 < np.diff(heights("rough"), axis=1).std() < 5.0  # m from post to post; 1.3 to 1.9 with smooth hills' 0.8


def test_stairs_have_level_treads_and_risers_of_2_to_6_m() -> None:
    steps = np.diff(heights("stairs"), axis=1)
    assert (steps == steps[0]).all()
    risers = steps[0][steps[0] != 0.0]
    assert risers.min() >= 2.0 and risers.max() <= 6.0
    assert 2000.0 / 120.0 - 1 < len(risers) < 2000.0 / 40.0
    assert abs(float(made("stairs").surface.up(0.0, 0.0))) <= 6.0


def test_dunes_are_steep_on_the_lee_and_gentle_to_windward() -> None:
    slope = np.degrees(np.arctan(np.diff(heights("dunes"), axis=1) / 5.0))
    assert np.median(slope[slope > 0]) == pytest.approx(10.0, abs=1.5)
    assert np.percentile(slope[slope < 0], 25) == pytest.approx(-33.0, abs=3.0)
    assert 0.15 < (slope < 0).mean() < 0.35  # cot 10 to cot 33 deg: a quarter of the way, and crests in between
    assert 8.0 < heights("dunes").max() < 160.0 / (1 / np.tan(np.radians(10)) + 1 / np.tan(np.radians(33))) + 1.0


def test_forest_stands_on_its_share() -> None:
    scene = made("forest")
    trees = scene.cover == Cover.FOREST
    assert trees.mean() == pytest.approx(0.45, abs=0.01)
    assert scene.canopy[trees].min() >= 10.0 and scene.canopy[~trees].max() <= 2.0


def test_town_has_houses_on_a_fifth_to_a_third_and_streets_between() -> None:
    cover = made("town").cover
    share = {kind: float((cover == kind).mean()) for kind in Cover}
    assert 0.2 < share[Cover.BUILDING] < 0.35 and 0.1 < share[Cover.TARMAC] < 0.3
    tarmac = cover == Cover.TARMAC
    assert tarmac.all(axis=1).any() and tarmac.all(axis=0).any()  # right through, both ways


@pytest.mark.parametrize("seed", range(2))
def test_airfield_of_the_river_valley_is_level_dry_and_clear(seed: int) -> None:
    scene = made("river_valley", seed, 4000.0)
    along = np.arange(0.0, RUNWAY_M + 1.0, 5.0)
    assert (scene.ground.up(0.0, along) == 0.0).all()
    assert (scene.cover_at(np.zeros_like(along), along) == Cover.TARMAC).all()
    assert scene.cover_at(20.0, 600.0) == Cover.GRASS
    before = np.arange(100.0, 1900.0, 5.0)
    glide = 15.0 + before * np.tan(np.radians(3.0))
    for end in (-before, RUNWAY_M + before[before < 700.0]):
        assert (glide[: len(end)] - scene.surface.up(0.0, end)).min() > 10.0
    water = scene.cover == Cover.WATER
    assert water.any(axis=1).all()  # the river comes in and goes out
    assert scene.ground.finest.heights[water].max() < -3.9
    assert scene.ground.finest.heights.max() > 100.0


def test_wrong_names_and_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match=r"unknown landscape 'hills'; must be one of plane, rough"):
        synthetic_landscape("hills", 1)
    for size in (
        {"cell_m": 0.0},
        {"extent_m": 400.0},
        {"cell_m": 51.0},
        {"extent_m": float("nan")},
        {"extent_m": np.inf},
    ):
        with pytest.raises(ValueError, match="extent_m is"):
            synthetic_landscape("plane", 1, **size)
