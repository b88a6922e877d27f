"""The particle filters: exact over a plane, the profile's likelihood over hills, other measurements, their number."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.arrays import Array
from fti.nav.terrain_filters.drift_model import DriftModel
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_filters.marginalised import MarginalisedFilter
from fti.nav.terrain_filters.particle_drawing import choose_origins
from fti.nav.terrain_filters.particle_kernels import PROBABILITY, exp_of_negative
from fti.nav.terrain_filters.point_mass import PointMassFilter
from fti.nav.terrain_filters.sir import MIN_PARTICLES, ParticleFilter
from fti.nav.terrain_matching.window import TerrainWindow, finest_window
from tests.nav.terrain_filters.kalman import CELL_M, HALF_M, SLOPES, PlaneFilter, draw_samples, plane
from tests.nav.terrain_matching.grounds import fly, hills

MODEL = DriftModel(position_sd=60.0, height_sd=5.0, position_walk=2.0, height_walk=0.2)


def test_over_a_plane_it_is_the_kalman_filter() -> None:
    found, exact = ParticleFilter(MODEL, 4000), PlaneFilter(np.zeros(3), np.diag([60.0**2, 60.0**2, 5.0**2]))
    for sample in draw_samples(30, seed=1):
        found.predict(1.5)
        exact.predict(2.0**2 * 1.5, 0.2**2 * 1.5)
        found.update(plane(), sample)
        exact.update(sample)
    estimate, sds = found.estimate(), np.sqrt(np.diag(exact.cov))
    assert np.abs(estimate.shift - exact.mean[:2]).max() < 0.15 * sds[:2].min()
    assert np.diag(estimate.cov) == pytest.approx(np.diag(exact.cov)[:2], rel=0.15)
    assert estimate.height_error == pytest.approx(exact.mean[2], abs=0.15 * sds[2])
    assert estimate.height_sd == pytest.approx(sds[2], rel=0.07)


def test_with_a_velocity_error_it_is_the_kalman_filter_of_five_states() -> None:
    model = DriftModel(60.0, 5.0, position_walk=2.0, height_walk=0.2, velocity_sd=1.5, velocity_walk=0.1)
    found, row = MarginalisedFilter(model, 20_000), np.array([*SLOPES, 1.0, 0.0, 0.0])
    mean, cov = np.zeros(5), model.start_cov
    for sample in draw_samples(40, seed=3):
        matrix, noise = model.transition(1.5)
        found.predict(1.5)
        mean, cov = matrix @ mean, matrix @ cov @ matrix.T + noise
        found.update(plane(), sample)
        gain = cov @ row / (row @ cov @ row + sample.sd**2)
        mean = mean + gain * (sample.ground - SLOPES[0] * sample.east - SLOPES[1] * sample.north - row @ mean)
        cov = cov - np.outer(gain, row @ cov)
    estimate, sds = found.estimate(), np.sqrt(np.diag(cov))
    velocity, velocity_sd = found.velocity_error
    assert np.abs(estimate.shift - mean[:2]).max() < 0.15 * sds[:2].min()
    assert np.diag(estimate.cov) == pytest.approx(np.diag(cov)[:2], rel=0.15)
    assert velocity == pytest.approx(mean[3:], abs=0.15 * sds[3:].min())
    assert velocity_sd == pytest.approx(math.sqrt(cov[3:, 3:].trace() / 2.0), rel=0.07)


@pytest.mark.parametrize("particles", [1000, 20_000])
def test_over_hills_it_is_the_point_mass_filter(particles: int) -> None:
    """Another algorithm for the same probability, which has the likelihood of the profile."""
    ground, model = hills(), DriftModel(position_sd=20.0, height_sd=5.0, position_walk=1.5, height_walk=0.1)
    window, noise = finest_window(ground), np.random.default_rng(3).normal(size=40)
    profile = fly(ground, (18.0, -11.0), samples=40, height_error=2.0, noise=noise)
    found, exact = ParticleFilter(model, particles), PointMassFilter(model)
    for number, up in enumerate(profile.ground.tolist()):
        sample = HeightSample(float(profile.east[number]), float(profile.north[number]), up, 1.0)
        for each in (found, exact):
            each.predict(0.2)
            each.update(window, sample)
    estimate, expected = found.estimate(), exact.estimate()
    sds = np.sqrt(np.diag(expected.cov))
    assert np.abs(estimate.shift - expected.shift).max() < 0.2 * sds.min()
    assert np.diag(estimate.cov) == pytest.approx(sds**2, rel=0.2)
    assert estimate.height_error == pytest.approx(expected.height_error, abs=0.3 * expected.height_sd)


def test_the_measurement_may_be_any_that_each_particle_predicts() -> None:
    """Distances to two beacons, with a height error that changes them by -0.5 a metre: the posterior of a lattice."""
    model, beacons = DriftModel(position_sd=30.0, height_sd=4.0), np.array([[300.0, 100.0], [-50.0, 400.0]])
    found, lattice = ParticleFilter(model, 10_000), lattice_of(120.0, 1.0)
    residuals = []
    for beacon, measured in zip(beacons, (310.0, 385.0), strict=True):
        found.weigh(np.hypot(*(found.shifts - beacon[:, None])), measured, 3.0, -0.5)
        residuals.append(measured - np.hypot(*(lattice - beacon).T))
    cov = 3.0**2 * np.eye(2) + (0.5 * 4.0) ** 2  # the height error is common to both
    chi_square = np.einsum("in,ij,jn->n", residuals, np.linalg.inv(cov), residuals)
    mean, cov = moments(lattice, chi_square + (lattice**2).sum(axis=1) / 30.0**2)
    estimate = found.estimate()
    assert np.abs(estimate.shift - mean).max() < 0.1 * np.sqrt(np.diag(cov).min())
    assert estimate.cov == pytest.approx(cov, rel=0.15, abs=0.1 * cov.max())


def test_the_drift_has_its_variance_and_no_correlation_from_step_to_step() -> None:
    found = ParticleFilter(DriftModel(position_sd=1e-6, height_sd=1.0, position_walk=3.0, height_walk=0.5), 20_000)
    steps, before = [], found.shifts
    for _ in range(8):
        found.predict(2.0)
        steps.append(found.shifts - before)
        before = found.shifts
    between = np.corrcoef(np.reshape(steps, (16, -1))) - np.eye(16)
    assert np.abs(between).max() < 5.0 / math.sqrt(20_000)
    assert np.var(steps, axis=2) == pytest.approx(3.0**2 * 2.0, rel=5.0 * math.sqrt(2.0 / 20_000))
    assert found.estimate().height_sd == pytest.approx(math.sqrt(1.0 + 0.5**2 * 16.0))


def test_unknown_ground_gives_no_information() -> None:
    """Nothing everywhere; half of it: the half keeps its probability, whatever the sample is."""
    found, before = ParticleFilter(MODEL), ParticleFilter(MODEL).estimate()
    unknown = TerrainWindow(np.full((801, 801), np.nan), CELL_M, -HALF_M, -HALF_M)
    found.update(unknown, HeightSample(0.0, 0.0, 100.0, 1.0))
    assert math.isnan(found.residual_2)
    found.update(plane(), HeightSample(0.0, 9000.0, 100.0, 1.0))  # outside of the posts
    assert found.estimate().cov == pytest.approx(before.cov, rel=1e-9)
    half = plane()
    half.heights[:, 401:] = np.nan
    found.update(half, HeightSample(0.0, 0.0, 8.0, 1.0))
    is_unknown = found.shifts[0] > 0.0
    assert found._cloud[PROBABILITY][is_unknown].sum() == pytest.approx(0.5, abs=0.04)


def test_particles_are_fewer_when_one_hill_is_left_and_not_before() -> None:
    """Over waves of 300 m in both directions the same hill is everywhere; over hills there is one."""
    model = DriftModel(position_sd=400.0, height_sd=5.0, position_walk=1.0)
    axis = np.arange(-HALF_M, HALF_M + CELL_M, CELL_M)
    waves = 20.0 * (np.sin(math.tau * axis / 300.0) + np.sin(math.tau * axis[:, None] / 300.0))
    repeated, once = ParticleFilter(model, 20_000), ParticleFilter(model, 20_000)
    unique, ground = hills(size=800), finest_window(hills(size=800))
    for number in range(25):
        east, north = 1200.0 + 60.0 * number, 1000.0 + 35.0 * number
        x, y = ((at + 20.0) / 300.0 * math.tau for at in (east - 2000.0, north - 2000.0))
        up = 20.0 * (math.sin(x) + math.sin(y))
        repeated.update(
            TerrainWindow(waves, CELL_M, -HALF_M + 2000.0, -HALF_M + 2000.0), HeightSample(east, north, up, 1.5)
        )
        once.update(ground, HeightSample(east, north, float(unique.up(east + 20.0, north + 20.0)), 1.5))
        repeated.predict(1.0)
        once.predict(1.0)
    assert once.particles == MIN_PARTICLES
    assert once.estimate().shift == pytest.approx((20.0, 20.0), abs=6.0)
    assert repeated.particles > 2 * MIN_PARTICLES
    assert np.sqrt(np.diag(repeated.estimate().cov)).min() > 200.0


def test_it_begins_from_the_cells_of_a_grid() -> None:
    grid = PointMassFilter(MODEL)
    for sample in draw_samples(10, seed=1):
        grid.predict(1.0)
        grid.update(plane(), sample)
    found, expected = ParticleFilter(MODEL, 5000, cells=grid.cells).estimate(), grid.estimate()
    assert found.shift == pytest.approx(expected.shift, abs=0.05 * math.sqrt(expected.cov[0, 0]))
    assert np.diag(found.cov) == pytest.approx(np.diag(expected.cov), rel=0.05)
    assert found.height_error == pytest.approx(expected.height_error, abs=0.05 * expected.height_sd)
    assert found.height_sd == pytest.approx(expected.height_sd, rel=0.05)


def test_origins_are_those_of_the_cumulative_probability() -> None:
    rng = np.random.default_rng(1)
    for particles, count in ((1000, 1000), (5000, 1000), (7, 40)):
        probability, start = rng.random(particles) ** 8, rng.random()
        probability /= probability.sum()
        expected = np.searchsorted(np.cumsum(probability), (np.arange(count) + start) / count)
        assert (choose_origins(probability, count, start) == expected).all()


def test_the_exponential_is_that_of_the_library() -> None:
    for x in (0.0, -1e-9, -0.5, -12.0, -80.0):
        assert exp_of_negative(x) == pytest.approx(math.exp(x), rel=1e-8)
    assert 0.0 <= exp_of_negative(-1e9) < 1e-200


def test_the_same_seed_gives_the_same_numbers() -> None:
    def end(seed: int) -> Array:
        found = ParticleFilter(MODEL, 1000, seed)
        for sample in draw_samples(5, seed=1):
            found.predict(1.0)
            found.update(plane(), sample)
        return found.estimate().shift

    assert (end(1) == end(1)).all()
    assert (end(1) != end(2)).all()


def test_a_velocity_error_is_refused_by_the_sir_filter() -> None:
    with pytest.raises(ValueError, match="velocity error"):
        ParticleFilter(DriftModel(1.0, 1.0, velocity_sd=0.1))


def lattice_of(half_m: float, step_m: float) -> Array:
    axis = np.arange(-half_m, half_m, step_m)
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


def moments(lattice: Array, chi_square: Array) -> tuple[Array, Array]:
    """Mean and covariance of a probability on a lattice."""
    probability = np.exp(-0.5 * (chi_square - chi_square.min()))
    probability /= probability.sum()
    mean = probability @ lattice
    return mean, (probability[:, None] * (lattice - mean)).T @ (lattice - mean)
