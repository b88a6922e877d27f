from typing import Any

import numpy as np
import pytest

from fti.terrain.landscape import NO_COVER, Cover, Landscape, SensedSurface
from fti.terrain.terrain import Terrain

#: Ground of 100 m with one column of each cover; 10 m of canopy on each, so that shares are read off.
COVER = np.tile(np.arange(len(Cover), dtype=np.uint8), (3, 1))
GROUND = Terrain.from_array(np.full(COVER.shape, 100.0), 10.0, east0=-30.0, north0=-10.0)
LANDSCAPE = Landscape(GROUND, np.full(COVER.shape, 10.0), COVER)


def heights_by_cover(sensed: SensedSurface) -> dict[Cover, float]:
    heights = LANDSCAPE.surface_for(sensed).finest.heights[1] - 100.0
    return {cover: float(heights[cover]) for cover in Cover}


def test_a_laser_returns_from_the_top_first_and_from_the_ground_last() -> None:
    assert heights_by_cover(SensedSurface.TOP) == dict.fromkeys(Cover, 10.0)
    assert heights_by_cover(SensedSurface.LAST) == dict.fromkeys(Cover, 0.0) | {Cover.BUILDING: 10.0}
    assert (LANDSCAPE.surface.finest.heights == 110.0).all()


def test_a_radar_returns_from_its_share_of_the_canopy_and_from_roofs() -> None:
    values = heights_by_cover(SensedSurface.RADAR)
    for cover in (Cover.GRASS, Cover.CROP, Cover.FOREST):
        assert 3.0 <= values[cover] <= 9.0
    assert values[Cover.BUILDING] == 10.0
    sparse = LANDSCAPE.surface_for(SensedSurface.RADAR, {Cover.FOREST: 0.3})
    assert sparse.finest.heights[1, Cover.FOREST] == 103.0 and sparse.finest.heights[1, Cover.BUILDING] == 110.0


def test_a_terrain_model_is_the_ground_alone() -> None:
    assert heights_by_cover(SensedSurface.GROUND) == dict.fromkeys(Cover, 0.0)


def test_cover_of_the_nearest_post() -> None:
    assert LANDSCAPE.cover_at([-30.0, -25.1, -24.9, 30.0], [0.0, 9.0, -9.0, 10.0]).tolist() == [0, 0, 1, 6]
    assert LANDSCAPE.cover_at([-30.1, 30.1, 0.0, 0.0, np.nan], [0.0, 0.0, -10.1, 10.1, 0.0]).tolist() == [NO_COVER] * 5


def test_wrong_landscapes_are_refused() -> None:
    shape = COVER.shape
    cover: Any
    for canopy, cover, message in (
        (np.zeros((2, 2)), COVER, "canopy has the shape"),
        (np.zeros(shape), COVER[:, :3], "cover has the shape"),
        (np.full(shape, -1.0), COVER, "negative or not finite"),
        (np.full(shape, np.nan), COVER, "negative or not finite"),
        (np.full(shape, np.inf), COVER, "negative or not finite"),
        (np.zeros(shape), np.full(shape, 7, dtype=np.uint8), "the number 7"),
        (np.zeros(shape), np.full(shape, -1, dtype=np.int8), "the number -1"),
        (np.zeros(shape), COVER.astype(np.float64), "the type float64"),
    ):
        with pytest.raises(ValueError, match=message):
            Landscape(GROUND, canopy, cover)
    with pytest.raises(ValueError, match="radar_share"):
        LANDSCAPE.surface_for(SensedSurface.RADAR, {Cover.FOREST: 1.2})
