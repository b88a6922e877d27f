"""The country around the demo airfield."""

from __future__ import annotations

import numpy as np
import pytest

from fti.terrain.demo_region import demo_region
from fti.terrain.demo_scene import demo_scene, track_point
from fti.terrain.grid import load_jacksboro
from fti.terrain.terrain import Terrain


@pytest.fixture(scope="module")
def country() -> Terrain:
    return demo_region()


def test_the_scene_is_in_the_middle_unchanged(country: Terrain) -> None:
    """From 6.9 km before the threshold to 1.2 km behind it and 300 m to each side, but for rounding."""
    east, north = track_point(np.arange(-1200.0, 6900.0, 35.0)[:, None], np.linspace(-300.0, 300.0, 9)[None, :])
    assert np.abs(country.up(east, north) - demo_scene().up(east, north)).max() < 1e-9


def test_the_country_is_the_real_elevation_with_a_little_relief(country: Terrain) -> None:
    """8 km west and south of the threshold: the published elevation, relief of 3 m on it."""
    east, north = np.meshgrid(np.arange(-12000.0, -4000.0, 333.0), np.arange(-8000.0, 8000.0, 333.0))
    lat, lon, _ = country.frame.to_geodetic(np.stack((east, north, np.zeros_like(east)), axis=-1))
    off = country.height(lat, lon) - load_jacksboro().height(lat, lon)
    assert off.mean() == pytest.approx(0.0, abs=1.5)
    assert 2.0 < off.std() < 6.0


def test_there_is_ground_where_a_pattern_is_flown(country: Terrain) -> None:
    """4 km to each side of the track and 12 km behind the threshold, where the scene has none."""
    east, north = track_point(np.arange(-12000.0, 6500.0, 500.0)[:, None], np.linspace(-4000.0, 4000.0, 9)[None, :])
    assert not np.isnan(country.up(east, north)).any()
    assert np.isnan(demo_scene().up(east, north)).mean() > 0.5
