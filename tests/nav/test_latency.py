"""Latency and averaging: found where they were put, with a sigma that is true; and series that tell nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.rotations import mat_from_rpy
from fti.nav.altimetry.latency import LatencyEstimate, estimate_latency
from fti.nav.altimetry.range_prediction import Predictor
from fti.ranging.nearest import NearestReturn
from fti.terrain.synthetic_landscape import synthetic_landscape

Array = NDArray[np.float64]
Rng = np.random.Generator

FINE_S, SENSOR_S, KNOWN_S, LONG_S = 0.01, 0.05, 0.05, 240.0
RELIEF_M, DEM_M, NOISE_M = 25.0, 2.4, 0.5


def country(rng: Rng, n: int) -> Array:
    """Heights under a flight with an autocorrelation of about 2 s, smooth over one; sd about 0.5."""
    wavelets = np.hanning(round(4.0 / FINE_S))
    return np.convolve(rng.standard_normal(n), wavelets / np.linalg.norm(wavelets), "same")


def flight(seed: int, latency: float, averaging: float, dem: float = DEM_M) -> tuple[Array, Array, Array, Array]:
    """What an altimeter said and when, and what it should have said."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, LONG_S, FINE_S)
    true = 200.0 + RELIEF_M * country(rng, len(t))
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (true[1:] + true[:-1]) * FINE_S)))
    at = np.arange(3.0, LONG_S - 3.0, SENSOR_S)
    half = max(0.5 * averaging, 1e-3)
    measured_ranges = np.interp(at - latency + half, t, integral) - np.interp(at - latency - half, t, integral)
    measured_ranges = measured_ranges / (2.0 * half) + 3.0 - 0.01 * at + NOISE_M * rng.standard_normal(len(at))
    known = true + dem * country(rng, len(t))
    every = round(KNOWN_S / FINE_S)
    return at, measured_ranges, t[::every], known[::every]


def found(t: Array, measured_ranges: Array, t_known: Array, known: Array) -> LatencyEstimate:
    estimate = estimate_latency(t, measured_ranges, t_known, known)
    assert estimate is not None
    return estimate


@pytest.mark.parametrize(("latency", "averaging"), [(0.1, 0.0), (0.1, 0.2), (-0.06, 0.5), (0.35, 0.1)])
def test_without_errors_of_the_ground_both_are_found_to_milliseconds(latency: float, averaging: float) -> None:
    estimate = found(*flight(1, latency, averaging, dem=0.0))
    assert estimate.latency == pytest.approx(latency, abs=0.003)
    assert estimate.averaging == pytest.approx(averaging, abs=0.03)
    assert estimate.latency_sd < 0.002
    assert estimate.correlation > 0.99


def test_sigma_is_true_with_errors_of_the_ground(scale: int) -> None:
    """20 flights, unit the flight: RMS of error over sigma; 0.70 to 1.40 is more than 3 sigma of it."""
    estimates = [found(*flight(seed, 0.1, 0.2)) for seed in range(20 * scale)]
    ratios = [(e.latency - 0.1) / e.latency_sd for e in estimates]
    assert 0.70 < math.sqrt(np.mean(np.square(ratios))) < 1.40
    assert np.median([e.latency_sd for e in estimates]) < 0.02
    inside = [abs(e.averaging - 0.2) < 3.0 * e.averaging_sd for e in estimates]
    assert np.mean(inside) > 0.8


def test_outliers_gaps_and_disorder_do_not_matter() -> None:
    t, measured_ranges, t_known, known = flight(3, 0.1, 0.2)
    clean = found(t, measured_ranges, t_known, known)
    rng = np.random.default_rng(4)
    spoilt = measured_ranges.copy()
    spoilt[rng.choice(len(t), 200, replace=False)] += rng.choice([-150.0, 300.0], 200)
    spoilt[1000:1300] = np.nan
    order, again = rng.permutation(len(t)), rng.permutation(np.repeat(np.arange(len(t_known)), 2))
    estimate = found(t[order], spoilt[order], t_known[again], known[again])
    assert estimate.latency == pytest.approx(clean.latency, abs=2.0 * clean.latency_sd)
    assert estimate.count < len(t) - 450


def test_clocks_that_jump_and_gaps_in_what_is_predicted_do_not_matter() -> None:
    t, measured_ranges, t_known, known = flight(3, 0.1, 0.2)
    clean = found(t, measured_ranges, t_known, known)
    there = (t_known < 60.0) | (t_known > 75.0)
    jumped = np.concatenate((t, [-1e12, 1e12, 1e300])), np.concatenate((measured_ranges, [1.0, 2.0, 3.0]))
    known_jumped = np.concatenate((t_known[there], [1e12])), np.concatenate((known[there], [50.0]))
    estimate = found(*jumped, *known_jumped)
    assert estimate.latency == pytest.approx(clean.latency, abs=2.0 * clean.latency_sd)
    assert estimate.count < clean.count - 250


def test_a_predicted_radar_over_forest() -> None:
    """The whole way: a flight 60 m/s fast, predictions with 10 m of error in the place, measured 120 ms late."""
    ground = synthetic_landscape("forest", 2, extent_m=9000.0, cell_m=10.0).surface
    t = np.arange(0.0, 130.0, 0.1)
    north = 60.0 * t - 3900.0
    points = np.stack((np.zeros_like(t), north, np.full_like(t, 220.0)), axis=-1)
    radar, mats = NearestReturn(rings=4), mat_from_rpy(0.0, 0.0, 0.0)
    known = Predictor(ground, radar).predict_local(points + np.array([10.0, 0.0, 0.0]), mats).slant_range
    late = Predictor(ground, radar).predict_local(points - np.array([0.0, 0.12 * 60.0, 0.0]), mats).slant_range
    estimate = found(t, late, t, known)
    assert estimate.latency == pytest.approx(0.12, abs=3.0 * estimate.latency_sd)
    assert estimate.latency_sd < 0.03


def test_unobservable_latency_is_none() -> None:
    t, measured_ranges, t_known, known = flight(5, 0.1, 0.0)
    level = np.full_like(known, 200.0)
    noise = np.random.default_rng(6).standard_normal(len(measured_ranges))
    assert estimate_latency(t, measured_ranges, t_known, level) is None
    assert estimate_latency(t[:1200], measured_ranges[:1200], t_known, known) is None  # 60 s
    assert estimate_latency(t, measured_ranges, [], []) is None
    assert estimate_latency([], [], t_known, known) is None
    assert estimate_latency(t, np.full_like(measured_ranges, np.nan), t_known, known) is None
    assert estimate_latency(t, measured_ranges, t_known, known, max_lag=math.nan) is None
    assert estimate_latency(t, measured_ranges, t_known, known, max_lag=0.08) is None  # it lies beyond
    estimate = estimate_latency(t, noise, t_known, known)
    assert estimate is None or estimate.latency_sd > 0.05  # unrelated: nothing, or a sigma that says so
