"""The terrain filter of a flight: its form by the uncertainty of the start, and its restart when lost."""

from __future__ import annotations

import numpy as np
import pytest

from fti.nav.terrain_filters.drift_model import DriftModel
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_filters.recovery import SAMPLES, ResidualTest
from fti.nav.terrain_filters.terrain_filter import TerrainFilter
from fti.nav.terrain_matching.window import TerrainWindow, finest_window
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

RELIEF = Terrain.from_array(
    fractal_relief((800, 800), 10.0, np.random.default_rng(5), sd=40.0, max_size_m=2000.0, min_size_m=60.0), 10.0
)
WINDOW = finest_window(RELIEF)


def fly(found: TerrainFilter, seconds: int, shift: tuple[float, float], begin: int = 0) -> None:
    """Samples of the relief once a second, 60 m apart, without noise."""
    for number in range(begin, begin + seconds):
        east, north = 1500.0 + 40.0 * number, 1500.0 + 40.0 * number
        up = float(RELIEF.up(east + shift[0], north + shift[1]))
        found.predict(1.0)
        found.update(WINDOW, HeightSample(east, north, up, 1.5))


@pytest.mark.parametrize(("sd", "expected"), [(122.0, 1000), (408.0, 20_000), (420.0, 0), (3000.0, 0)])
def test_the_form_follows_the_uncertainty(sd: float, expected: int) -> None:
    assert TerrainFilter(DriftModel(sd, 5.0, 1.0)).particles == expected


def test_with_a_velocity_error_there_are_always_particles() -> None:
    numbers = [TerrainFilter(DriftModel(sd, 5.0, 1.0, velocity_sd=1.0)).particles for sd in (122.0, 408.0, 1634.0)]
    assert numbers == [5000, 40_000, 500_000]


def test_far_off_it_finds_the_position_and_goes_on_with_particles() -> None:
    found = TerrainFilter(DriftModel(800.0, 5.0, 1.0))
    fly(found, 40, (900.0, -700.0))
    assert found.particles == 1000
    assert found.estimate().shift == pytest.approx((900.0, -700.0), abs=10.0)
    assert found.restarts == 0


def test_a_lost_filter_begins_again_and_finds_the_position() -> None:
    """The navigated position jumps by 300 m, which no model of the drift contains."""
    found = TerrainFilter(DriftModel(122.0, 5.0, 1.0))
    fly(found, 30, (40.0, -20.0))
    assert found.restarts == 0
    fly(found, 40, (-180.0, 180.0), begin=30)
    assert found.restarts >= 1
    assert found.estimate().shift == pytest.approx((-180.0, 180.0), abs=10.0)


def test_a_lost_grid_begins_again() -> None:
    """Level ground leaves the position open, so the form stays a grid.  The height jumps by 20 m."""
    found = TerrainFilter(DriftModel(800.0, 5.0, 1.0, 0.05))
    level = TerrainWindow(np.zeros((800, 800)), 10.0, 0.0, 0.0)
    for number in range(60):
        found.predict(1.0)
        found.update(level, HeightSample(4000.0, 4000.0, 2.0 if number < 20 else 22.0, 1.5))
        assert found.particles == 0
        assert (found.restarts == 0) == (number < 20)
    assert found.restarts < 5


def test_the_residual_test_has_the_limit_of_ten_samples_at_one_in_100_000() -> None:
    """41.30 : chi-square of 10 degrees of freedom, tables; unknown ground counts nothing."""
    test = ResidualTest()
    assert not any(test.add(value) for value in [4.12, float("nan")] * SAMPLES)
    assert not test.add(4.21)
    assert test.add(4.12 + 0.12)
    test.clear()
    assert not test.add(41.2)
    assert test.add(0.2)


def test_without_samples_the_model_grows_as_its_covariance() -> None:
    """A velocity walk: the variance of the position is the limit of many short steps."""
    model = DriftModel(10.0, 2.0, 1.0, 0.1, velocity_sd=0.5, velocity_walk=0.2)
    cov = model.start_cov
    for _ in range(4000):
        cov = model.propagate(cov, 0.01)
    after = model.after(40.0)
    found = (after.position_sd, after.height_sd, after.velocity_sd)
    assert found == pytest.approx(np.sqrt(np.diag(cov))[[0, 2, 3]], rel=1e-3)
