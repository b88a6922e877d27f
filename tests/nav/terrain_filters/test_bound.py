"""The posterior bound against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.nav.terrain_filters.bound import PosteriorBound
from fti.nav.terrain_filters.drift_model import DriftModel
from tests.nav.terrain_filters.kalman import SLOPES, PlaneFilter, draw_samples


def test_over_a_plane_it_is_the_covariance_of_the_kalman_filter() -> None:
    bound = PosteriorBound(DriftModel(60.0, 5.0, 2.0, 0.2))
    exact = PlaneFilter(np.zeros(3), np.diag([60.0**2, 60.0**2, 5.0**2]))
    for sample in draw_samples(30, seed=1):
        bound.predict(1.5)
        bound.update(*SLOPES, sample.sd)
        exact.predict(2.0**2 * 1.5, 0.2**2 * 1.5)
        exact.update(sample)
    assert bound.cov[:3, :3] == pytest.approx(exact.cov, rel=1e-9)


def test_over_whole_waves_it_is_the_mean_square_of_the_slope() -> None:
    """A sin(k east), 64 samples over four waves, no drift: 1 / (1 / sd^2 + 64 (A k)^2 / 2 / noise^2)."""
    bound, k = PosteriorBound(DriftModel(position_sd=50.0, height_sd=5.0)), math.tau / 200.0
    for phase in math.tau * np.arange(64) / 16.0:
        bound.update(20.0 * k * math.cos(phase), 0.0, 1.5)
    expected = 1.0 / (1.0 / 50.0**2 + 64.0 * (20.0 * k) ** 2 / 2.0 / 1.5**2)
    assert bound.shift_cov == pytest.approx(np.diag([expected, 50.0**2]), rel=1e-9, abs=1e-9)
    assert bound.cov[2, 2] == pytest.approx(1.0 / (1.0 / 5.0**2 + 64.0 / 1.5**2), rel=1e-9)


def test_with_drift_it_settles_where_drift_and_samples_are_equal() -> None:
    """A known height, a slope s to the east: P = (-q + sqrt(q^2 + 4 q noise^2 / s^2)) / 2."""
    bound = PosteriorBound(DriftModel(position_sd=100.0, height_sd=1e-6, position_walk=3.0))
    for _ in range(200):
        bound.predict(0.5)
        bound.update(0.2, 0.0, 1.5)
    q, noise = 3.0**2 * 0.5, 1.5**2 / 0.2**2
    assert bound.shift_cov[0, 0] == pytest.approx((-q + math.sqrt(q**2 + 4.0 * q * noise)) / 2.0, rel=1e-6)
    assert bound.shift_cov[1, 1] == pytest.approx(100.0**2 + 3.0**2 * 100.0, rel=1e-9)


def test_a_velocity_error_moves_the_position_and_unknown_ground_does_not() -> None:
    bound = PosteriorBound(DriftModel(position_sd=10.0, height_sd=1.0, velocity_sd=0.5))
    for _ in range(8):
        bound.predict(5.0)
        bound.update(math.nan, math.nan, 1.0)
    assert bound.shift_cov == pytest.approx(np.eye(2) * (10.0**2 + (0.5 * 40.0) ** 2), abs=1e-9)
