"""The undulation of the packaged grid: against published values and against the grid that it was made from."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.geodesy.coarse_geoid import undulation
from fti.geodesy.geoid import load_geoid
from tests.geodesy.test_geoid import NGA
from tests.grids import needs_egm96


def test_agrees_with_published_undulations() -> None:
    for lat, lon, expected in NGA:
        assert undulation(math.radians(lat), math.radians(lon)) == pytest.approx(expected, abs=0.4)


@needs_egm96
def test_it_is_off_the_full_grid_by_no_more_than_is_stated() -> None:
    rng = np.random.default_rng(3)
    lat, lon = np.arcsin(rng.uniform(-1.0, 1.0, 4000)), rng.uniform(-math.pi, math.pi, 4000)
    full = load_geoid("egm96").undulation(lat, lon)
    coarse = np.array([undulation(a, b) for a, b in zip(lat.tolist(), lon.tolist(), strict=True)])
    off = np.abs(coarse - full)
    assert np.quantile(off, 0.995) < 1.3
    assert off.max() < 4.0


def test_the_edges_of_the_grid_meet() -> None:
    for lat in (-90.0, -30.2, 0.0, 89.9, 90.0):
        here = undulation(math.radians(lat), math.pi)
        assert here == pytest.approx(undulation(math.radians(lat), -math.pi), abs=1e-6)
        assert here == pytest.approx(undulation(math.radians(lat), 3.0 * math.pi), abs=1e-6)


@pytest.mark.parametrize("place", [(math.nan, 0.0), (2.0, 0.0), (0.0, math.inf)])
def test_what_is_not_on_earth_has_no_undulation(place: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="invalid position"):
        undulation(*place)
