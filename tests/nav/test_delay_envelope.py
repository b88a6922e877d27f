"""The lower envelope of delays: its interval is correct for every supported kind of delay."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.arrays import Array
from fti.nav.device_time.delay_envelope import MIN_SAMPLES, fit_line, student_95

SECOND = 1e9
MS = 1e6
N = 1200
Delays = Callable[[np.random.Generator], np.ndarray]


def seconds(n: int) -> Array:
    """One message a second [ns]."""
    return np.asarray(np.arange(n) * SECOND, np.float64)


#: Delays [ms], one a second.
CLOUDS: dict[str, Delays] = {
    "jitter of both signs": lambda rng: rng.normal(0.0, 1.0, N),
    "jitter and late ones": lambda rng: (
        rng.normal(0.0, 1.0, N) + np.where(rng.random(N) < 0.2, rng.uniform(0, 25, N), 0)
    ),
    "jitter and bursts": lambda rng: (
        rng.normal(0.0, 1.0, N) + np.where(np.arange(N) % 100 < 20, rng.uniform(0, 25, N), 0)
    ),
    "half of them late": lambda rng: rng.normal(0.0, 1.0, N) + np.where(rng.random(N) < 0.5, rng.uniform(0, 25, N), 0),
    "hard edge": lambda rng: np.abs(rng.normal(0.0, 1.0, N)),
    "all late": lambda rng: rng.uniform(0.0, 25.0, N),
    "exponential": lambda rng: rng.exponential(8.0, N),
}


@pytest.mark.parametrize("name", CLOUDS)
def test_the_slope_is_inside_its_interval_in_nine_of_ten(name: str, scale: int) -> None:
    """Of 20 clouds at least 16, of 400 at least 364: with a true 95 % one test in 400 fails, in 4000 with more."""
    runs = 20 * scale
    x = seconds(N)
    inside = 0
    for seed in range(runs):
        line = fit_line(x, 1.1e-6 * x + MS * CLOUDS[name](np.random.default_rng(seed)))
        assert line
        inside += abs(line.slope - 1.1e-6) <= line.slope_95
    assert inside >= (16 if scale == 1 else 0.91 * runs)


@pytest.mark.parametrize(("name", "method"), [("jitter of both signs", "core"), ("all late", "edge")])
def test_the_better_estimator_is_taken(name: str, method: str) -> None:
    x = seconds(N)
    envelope_lines = [fit_line(x, MS * CLOUDS[name](np.random.default_rng(seed))) for seed in range(10)]
    assert sum(line is not None and line.method == method for line in envelope_lines) >= 9


@given(
    slope=st.floats(-1e-3, 1e-3),
    offset=st.floats(-1e12, 1e12),
    factor=st.floats(0.1, 100.0),
    seed=st.integers(0, 1000),
)
def test_offset_slope_and_unit_carry_through(slope: float, offset: float, factor: float, seed: int) -> None:
    """A tilted, shifted cloud has the same line, tilted and shifted."""
    rng = np.random.default_rng(seed)
    x = np.asarray(np.sort(rng.uniform(0.0, 600.0, 150)) * SECOND, np.float64)
    y = factor * MS * rng.exponential(1.0, 150)
    plain, moved = fit_line(x, y), fit_line(x, y + offset + slope * x)
    assert plain
    assert moved
    assert moved.slope - slope == pytest.approx(plain.slope, abs=1e-9 * factor + 1e-12)
    assert moved.at(3e11) - offset - slope * 3e11 == pytest.approx(plain.at(3e11), abs=0.02 * factor * MS)


def test_no_message_is_far_below_the_line() -> None:
    rng = np.random.default_rng(3)
    x = seconds(N)
    y = MS * CLOUDS["all late"](rng)
    line = fit_line(x, y)
    assert line
    below = line.at(x) - y
    assert np.count_nonzero(below > 0) <= 0.025 * N
    assert below.max() < 1.5 * MS
    assert line.spread == pytest.approx(12 * MS, abs=1.5 * MS)


@pytest.mark.parametrize("n", [0, 1, MIN_SAMPLES - 1])
def test_few_samples_give_no_line(n: int) -> None:
    assert fit_line(seconds(n), np.zeros(n)) is None


def test_equal_delays_are_a_line_too() -> None:
    x = seconds(60)
    line = fit_line(x, 5e-6 * x + 7.0)
    assert line
    assert line.slope == pytest.approx(5e-6, abs=1e-12)
    assert line.at(0.0) == pytest.approx(7.0, abs=1.0)
    assert line.slope_95 < 1e-7


def test_a_coarse_clock_is_not_known_finely() -> None:
    """Steps of 1 ms over a minute may hide 17 ppm."""
    x = seconds(60)
    fine, coarse = fit_line(x, 0 * x), fit_line(x, 0 * x, 1e6)
    assert fine
    assert coarse
    assert coarse.slope_95 == pytest.approx(1e6 / 59e9, rel=0.05)
    assert coarse.level_sd > fine.level_sd


@pytest.mark.parametrize(("freedom", "expected"), [(22, 2.0739), (10, 2.2281), (6, 2.4469)])
def test_student_quantiles_are_those_of_the_tables(freedom: int, expected: float) -> None:
    assert student_95(freedom) == pytest.approx(expected, abs=2e-3)
