"""Drawn errors, against the statistics that their models state; every bound is 4 sigma of the estimate or wider."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.hil.sensors.errors import gauss_markov
from fti.study.faults.inertial_unit import UNITS, TriadErrors, triad_output
from fti.study.faults.receiver import COMMON_SHARE, HEIGHT_FACTOR, WHITE_SD_M, SatelliteErrors, draw_satellites
from fti.study.faults.terrain import RELIEF_SD_M, terrain


def test_doubling_is_the_recursion_sample_by_sample() -> None:
    tau_s, step_s, sd, count = 7.0, 0.2, 1.5, 1000
    x = gauss_markov(count, step_s, tau_s, sd, np.random.default_rng(4))
    rng, a = np.random.default_rng(4), math.exp(-step_s / tau_s)
    noises = rng.normal(0.0, sd * math.sqrt(1.0 - a * a), count)
    value, expected = rng.normal(0.0, sd), list[float]()
    for noise in [0.0, *noises[1:].tolist()]:
        value = value if not expected else a * value + noise
        expected.append(value)
    assert x == pytest.approx(np.array(expected), abs=1e-12)


def test_autocorrelation_is_exponential() -> None:
    """Over 100,000 s of tau 20 s: sd 2.5 sqrt(tau / T) = 4 % and correlation at 0.5, 1, 2 tau within 0.06."""
    step_s, tau_s, sd = 0.5, 20.0, 2.0
    x = gauss_markov(200_000, step_s, tau_s, sd, np.random.default_rng(1))
    assert np.std(x) == pytest.approx(sd, rel=0.06)
    for lag_s in (10.0, 20.0, 40.0):
        k = round(lag_s / step_s)
        assert np.mean(x[k:] * x[:-k]) / sd**2 == pytest.approx(math.exp(-lag_s / tau_s), abs=0.08)


def test_processes_are_stationary_from_the_first_sample() -> None:
    """3000 draws: sigma of the first and of the last sample within 6 %."""
    rng = np.random.default_rng(2)
    drawn = np.array([gauss_markov(50, 1.0, 100.0, 3.0, rng)[[0, -1]] for _ in range(3000)])
    assert np.std(drawn, axis=0) == pytest.approx([3.0, 3.0], rel=0.06)


def allan_deviation(x: NDArray[np.float64], cluster: int) -> float:
    """IEEE Std 952, equation C.10: of averages over so many samples, without overlap."""
    means = x[: len(x) // cluster * cluster].reshape(-1, cluster).mean(axis=1)
    return float(np.sqrt(0.5 * np.mean(np.diff(means) ** 2)))


@pytest.mark.parametrize("grade", UNITS)
def test_allan_deviation_of_the_gyroscopes_is_the_angle_random_walk(grade: str) -> None:
    """At 0.4 s and 4 s, N / sqrt(tau); 25 min at rest hold 375 clusters of 4 s: 5 % of sigma, bound 20 %.

    Variations of the bias over 100 s and more are small beside it at 4 s in every grade.
    """
    deg_root_h = {"navigation": 0.002, "tactical": 0.1, "industrial": 0.3, "mems": 0.6}[grade]
    walk = math.radians(deg_root_h) / 60.0
    x = triad_output(np.zeros((37_500, 3)), UNITS[grade].gyro, np.random.default_rng(3))[:, 0]
    for tau_s, bound in ((0.4, 0.08), (4.0, 0.2)):
        assert allan_deviation(x, round(25 * tau_s)) == pytest.approx(walk / math.sqrt(tau_s), rel=bound)


def test_biases_and_scale_factors_have_their_sigma() -> None:
    """600 units, three axes each: 4 sigma of a sample sigma are 9 %; the in-run part adds 0.5 %."""
    triad, rng = TriadErrors(bias=2e-3, walk=0.0, scale=5e-4), np.random.default_rng(8)
    at_rest = np.array([triad_output(np.zeros((1, 3)), triad, rng)[0] for _ in range(600)])
    assert np.std(at_rest) == pytest.approx(2e-3, rel=0.1)
    scaled = TriadErrors(bias=0.0, walk=0.0, scale=5e-4)
    moved = np.array([triad_output(np.array([[0.0, 0.0, 10.0]]), scaled, rng)[0] for _ in range(600)])
    assert np.std(moved - [0.0, 0.0, 10.0]) == pytest.approx(5e-3, rel=0.1)


def test_published_sizes_of_the_grades() -> None:
    mg, deg_h = 9.80665e-3, math.radians(1.0) / 3600.0
    sizes = {g: (u.accel.bias / mg, u.gyro.bias / deg_h) for g, u in UNITS.items()}
    assert sizes["navigation"] == pytest.approx((0.05, 0.01))
    assert sizes["tactical"] == pytest.approx((1.0, 1.0))
    assert sizes["industrial"] == pytest.approx((2.0, 7.0))
    assert sizes["mems"] == pytest.approx((5.0, 100.0))


def test_two_receivers_share_four_fifths_of_the_variance() -> None:
    """400 skies, one epoch each: correlation within 0.08 (4 sigma), sigma of level and height within 8 %."""
    rng = np.random.default_rng(9)
    first, second = list[NDArray[np.float64]](), list[NDArray[np.float64]]()
    for _ in range(400):
        sky = draw_satellites(20.0, rng)
        for errors in (first, second):
            errors.append(sky.errors_n(rng)[-1] / sky.sd)
    a, b = np.array(first), np.array(second)
    white = np.mean(WHITE_SD_M**2 / 1.6**2)  # about 0.02 of the variance
    assert np.std(a[:, :2]) == pytest.approx(1.0, rel=0.1)
    assert np.std(a[:, 2]) == pytest.approx(HEIGHT_FACTOR, rel=0.15)
    for axis in range(3):
        assert np.corrcoef(a[:, axis], b[:, axis])[0, 1] == pytest.approx(COMMON_SHARE / (1 + white), abs=0.09)


def test_drawn_skies_lie_in_their_ranges() -> None:
    rng = np.random.default_rng(10)
    skies: list[SatelliteErrors] = [draw_satellites(5.0, rng) for _ in range(200)]
    assert {s.rate_hz for s in skies} == {5.0, 10.0}
    assert 0.7 <= min(s.sd for s in skies) < 0.9 and 2.3 < max(s.sd for s in skies) <= 2.5
    assert 100.0 <= min(s.tau_s for s in skies) < 120.0 and 280.0 < max(s.tau_s for s in skies) <= 300.0


@pytest.mark.parametrize("number", range(10))
def test_terrains_have_their_relief_and_the_map_errs_by_its_sigma(number: int) -> None:
    """4000 points over 200 km: relief within 20 %, error of the map within 10 %; no ground above the peak."""
    ground = terrain(number, (0.8, 0.2), 300.0)
    lat, lon = np.random.default_rng(11).uniform((0.785, 0.18), (0.815, 0.22), (4000, 2)).T
    heights = ground.elevation(lat, lon)
    assert np.std(heights) == pytest.approx(RELIEF_SD_M[number], rel=0.2, abs=1e-9)
    assert heights.max() <= ground.peak
