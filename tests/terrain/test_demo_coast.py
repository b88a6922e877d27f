"""The demo region with a level sea and equal dunes."""

from __future__ import annotations

import numpy as np
import pytest

from fti.terrain.demo_coast import COAST_M, DUNES_BEGIN_M, DUNES_M, SEA_ALT_M, SHORE_M, demo_coast
from fti.terrain.demo_region import WEST_M, demo_region
from fti.terrain.terrain import Terrain


@pytest.fixture(scope="module")
def coast() -> Terrain:
    return demo_coast()


def heights(terrain: Terrain, east: float, west: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """East, north and height above the ellipsoid of points between two meridians [m]."""
    x, y = np.meshgrid(np.arange(west, east, 37.0), np.arange(-8000.0, 8000.0, 411.0))
    *_, alt = terrain.frame.to_geodetic(np.stack((x, y, terrain.up(x, y)), axis=-1))
    return x, y, np.asarray(alt)


def test_the_land_is_that_of_the_region(coast: Terrain) -> None:
    x, y, _ = heights(coast, 7000.0, COAST_M + SHORE_M + 40.0)  # the next post
    assert np.array_equal(coast.up(x, y), demo_region().up(x, y))


def test_the_sea_is_level(coast: Terrain) -> None:
    *_, alt = heights(coast, COAST_M - 100.0, DUNES_BEGIN_M + 100.0)
    assert np.abs(alt - SEA_ALT_M).max() < 0.05


def test_the_dunes_repeat_in_both_directions(coast: Terrain) -> None:
    x, y, alt = heights(coast, DUNES_BEGIN_M - SHORE_M - DUNES_M, WEST_M + DUNES_M)
    lat, lon, _ = coast.frame.to_geodetic(np.stack((x + DUNES_M, y - DUNES_M, np.zeros_like(x)), axis=-1))
    assert np.abs(coast.height(lat, lon) - alt).max() < 0.2
    assert alt.std() > 6.0
