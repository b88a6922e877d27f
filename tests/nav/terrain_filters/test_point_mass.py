"""The point-mass filter: exact over a plane, the profile's likelihood over hills, and the prior without ground."""

from __future__ import annotations

import numpy as np
import pytest

from fti.nav.terrain_filters.drift_model import DriftModel
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_filters.point_mass import MAX_CELLS, PointMassFilter
from fti.nav.terrain_matching.likelihood import Likelihood
from fti.nav.terrain_matching.window import TerrainWindow, finest_window
from tests.nav.terrain_filters.kalman import CELL_M, HALF_M, SLOPES, PlaneFilter, draw_samples, plane
from tests.nav.terrain_matching.grounds import fly, hills

MODEL = DriftModel(position_sd=60.0, height_sd=5.0, position_walk=2.0, height_walk=0.2)


def test_over_a_plane_it_is_the_kalman_filter() -> None:
    found, exact = PointMassFilter(MODEL), PlaneFilter(np.zeros(3), np.diag([60.0**2, 60.0**2, 5.0**2]))
    for sample in draw_samples(30, seed=1):
        found.predict(1.5)
        exact.predict(2.0**2 * 1.5, 0.2**2 * 1.5)
        row = np.array([*SLOPES, 1.0])
        residual = sample.ground - SLOPES[0] * sample.east - SLOPES[1] * sample.north - row @ exact.mean
        found.update(plane(), sample)
        assert found.residual_2 == pytest.approx(
            residual**2 / (row @ exact.cov @ row + sample.sd**2), rel=0.03, abs=0.05
        )
        exact.update(sample)
    estimate, sds = found.estimate(), np.sqrt(np.diag(exact.cov))
    assert np.abs(estimate.shift - exact.mean[:2]).max() < 0.05 * sds[:2].min()
    assert estimate.cov == pytest.approx(exact.cov[:2, :2], rel=0.03)
    assert estimate.height_error == pytest.approx(exact.mean[2], abs=0.05 * sds[2])
    assert estimate.height_sd == pytest.approx(sds[2], rel=0.02)


def test_without_drift_it_has_the_likelihood_of_the_profile() -> None:
    """The posterior on a lattice of 0.3 m from the chi-square of the whole profile, times the prior."""
    ground = hills()
    profile = fly(ground, (18.0, -11.0), samples=25, height_error=2.0, noise=np.random.default_rng(3).normal(size=25))
    window = finest_window(ground)
    found = PointMassFilter(DriftModel(position_sd=10.0, height_sd=profile.height_sd), start_cell_m=0.4)
    for east, north, up, sd in zip(profile.east, profile.north, profile.ground, profile.sd, strict=True):
        found.update(window, HeightSample(east, north, up, sd))
    lattice = np.stack(np.meshgrid(np.arange(-45.0, 45.0, 0.3), np.arange(-45.0, 45.0, 0.3)), axis=-1).reshape(-1, 2)
    chi_square = Likelihood(window, profile).chi_square(lattice) + (lattice**2).sum(axis=1) / 10.0**2
    probability = np.exp(-0.5 * (chi_square - chi_square.min()))
    probability /= probability.sum()
    mean = probability @ lattice
    cov = (probability[:, None] * (lattice - mean)).T @ (lattice - mean)
    estimate = found.estimate()
    assert np.abs(estimate.shift - mean).max() < 0.1 * np.sqrt(np.diag(cov).min())
    assert np.diag(estimate.cov) == pytest.approx(np.diag(cov), rel=0.06)


def test_level_ground_keeps_the_position_and_measures_the_height() -> None:
    found = PointMassFilter(MODEL)
    for number in range(20):
        found.predict(10.0)
        found.update(plane((0.0, 0.0)), HeightSample(10.0 * number, 0.0, 4.0, 0.5))
    estimate = found.estimate()
    assert estimate.shift == pytest.approx((0.0, 0.0), abs=0.01)
    assert estimate.cov == pytest.approx(np.eye(2) * (60.0**2 + 2.0**2 * 200.0), rel=0.01, abs=1.0)
    assert estimate.height_error == pytest.approx(4.0, abs=0.1)


def test_unknown_ground_gives_no_information() -> None:
    """Nothing everywhere; half of it: the half keeps its probability, whatever the sample is."""
    found, before = PointMassFilter(MODEL), PointMassFilter(MODEL).estimate()
    unknown = TerrainWindow(np.full((801, 801), np.nan), CELL_M, -HALF_M, -HALF_M)
    found.update(unknown, HeightSample(0.0, 0.0, 100.0, 1.0))
    assert np.isnan(found.residual_2)
    found.update(plane(), HeightSample(0.0, 9000.0, 100.0, 1.0))  # outside of the posts
    assert found.estimate().cov == pytest.approx(before.cov, rel=1e-6)
    half = plane()
    half.heights[:, 401:] = np.nan
    found.update(half, HeightSample(0.0, 0.0, 30.0, 1.0))
    east = found._axes()[0]
    assert found._probability.sum(axis=0)[east > 0.0].sum() == pytest.approx(0.5, abs=0.04)


def test_a_long_time_without_ground_keeps_the_grid_bounded() -> None:
    found = PointMassFilter(DriftModel(position_sd=5.0, height_sd=1.0, position_walk=10.0))
    for _ in range(10):
        found.predict(400.0)
        found.update(plane((0.0, 0.0)), HeightSample(0.0, 0.0, 0.0, 1.0))
    assert found.shape[0] * found.shape[1] <= MAX_CELLS
    assert np.diag(found.estimate().cov) == pytest.approx(5.0**2 + 10.0**2 * 4000.0, rel=0.02)


@pytest.mark.parametrize("wrong", [{"velocity_sd": 1.0}, {"position_sd": 0.0}, {"height_walk": -1.0}])
def test_a_model_that_it_cannot_have_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"velocity error|positive|negative"):
        PointMassFilter(DriftModel(**{"position_sd": 1.0, "height_sd": 1.0, **wrong}))
