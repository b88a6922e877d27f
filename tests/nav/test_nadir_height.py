"""How well the ground below is known: closed forms on a slope and at a step, Monte Carlo over hills."""

import math

import numpy as np
import pytest

from fti.nav.altimetry.nadir_height import ground_below, ground_sd
from fti.nav.source_interpolation import PositionState
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain


def _terrain(heights: np.ndarray) -> Terrain:
    return Terrain.from_array(heights, 5.0, east0=-500.0, north0=-500.0)


def test_a_slope_is_the_slope_times_the_error_of_the_place() -> None:
    east = np.arange(-500.0, 501.0, 5.0)
    slope = _terrain(np.broadcast_to(0.3 * east, (201, 201)))
    assert ground_sd(slope, [[7.0, 3.0, 100.0]], 10.0) == pytest.approx([3.0], abs=1e-9)
    assert ground_sd(slope, [7.0, 3.0, 100.0], 0.0) == pytest.approx([0.0], abs=1e-9)


def test_the_edge_of_a_wood_is_seen_before_it_is_reached() -> None:
    east = np.arange(-500.0, 501.0, 5.0)
    edge = _terrain(np.broadcast_to(np.where(east >= 0.0, 20.0, 0.0), (201, 201)))
    far, near = ground_sd(edge, [[-30.0, 0.0, 99.0], [-9.0, 0.0, 99.0]], 10.0)
    assert far == 0.0
    assert 8.0 < near < 20.0


def test_over_hills_it_is_what_places_around_give() -> None:
    """One sigma pooled over 4000 places, within 5 %."""
    rng = np.random.default_rng(3)
    hills = _terrain(fractal_relief((201, 201), 5.0, rng, sd=15.0, max_size_m=800.0, min_size_m=80.0))
    points = np.column_stack((rng.uniform(-400.0, 400.0, (4000, 2)), np.zeros(4000)))
    moved = points[:, :2] + 10.0 * rng.standard_normal((4000, 2))
    true = np.sqrt(np.mean((hills.up(*moved.T) - hills.up(*points[:, :2].T)) ** 2))
    assert np.sqrt(np.mean(ground_sd(hills, points, 10.0) ** 2)) == pytest.approx(true, rel=0.05)


def test_unknown_ground_gives_nan() -> None:
    holed = np.zeros((201, 201))
    holed[100, 102] = np.nan
    places = [[0.0, 0.0, 9.0], [-499.0, 0.0, 9.0], [np.nan, 0.0, 9.0], [200.0, 0.0, 9.0]]
    values = ground_sd(_terrain(holed), places, 10.0)
    assert np.isnan(values).tolist() == [True, True, True, False]


def test_the_ground_below_a_place_is_as_uncertain_as_the_place_on_its_slope() -> None:
    """A slope of 0.2 and 100 m of doubt: an altitude made of it is 20 m off, one sigma."""
    posts = 100.0 + 0.2 * np.arange(0.0, 4001.0, 20.0)[:, None] + np.zeros((1, 201))
    terrain = Terrain.from_array(posts, 20.0, lat0=0.8, lon0=0.2, east0=-2000.0, north0=-2000.0)

    def at(sd: float | None, lat: float = 0.8) -> tuple[float, float] | None:
        return ground_below(terrain, PositionState(lat, 0.2, 900.0, sd, 1.0, None, None, None, 0))

    assert at(100.0) == pytest.approx((500.0, 20.0), rel=1e-3)
    assert at(None) == pytest.approx((500.0, 1.0), rel=1e-3)
    assert at(math.nan) == at(None)
    assert at(3000.0) is None  # beyond what is known
    assert at(1.0, lat=0.9) is None
