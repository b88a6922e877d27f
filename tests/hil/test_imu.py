"""Inertial measurement units: what is stated of a grade comes out of its signal again."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.constants import STANDARD_GRAVITY
from fti.hil.sensors.errors import backlash, flicker_noise, gauss_markov_noise, quantize, recursion
from fti.hil.sensors.imu import Imu, Instrument, TriadSpec, mat_of
from fti.hil.sensors.imu_grades import DEG, DEG_H, DEG_ROOT_H, GRADES, MICRO_G, GradeName

Array = NDArray[np.float64]
PERFECT = TriadSpec(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, resolution=1e-15, limit=1e9)


def still(instrument: Instrument, duration_s: float, step_s: float, seed: int = 1) -> Array:
    """What three axes say that feel nothing, shape (n, 3)."""
    t = np.arange(0.0, duration_s, step_s)
    return instrument.measure(t, np.zeros((len(t), 3)), np.random.default_rng(seed))


def allan(values: Array, step_s: float, tau_s: float) -> float:
    """Overlapping Allan deviation of signals of shape (n, 3), root mean square over the axes.

    IEEE Std 952-1997, annex C: from the second differences of the integral.
    """
    m = round(tau_s / step_s)
    integral = np.cumsum(values - values.mean(axis=0), axis=0) * step_s
    second = integral[2 * m :] - 2.0 * integral[m:-m] + integral[: -2 * m]
    return float(np.sqrt(np.mean(second**2) / 2.0) / (m * step_s))


# Where the noise is white, and where the floor is: (step, duration, times of the floor) [s].
SEEN: dict[tuple[GradeName, str], tuple[float, float, tuple[float, ...]]] = {
    ("navigation", "gyro"): (20.0, 600_000.0, (3000.0, 5000.0, 8000.0)),
    ("navigation", "accel"): (0.1, 20_000.0, (30.0, 80.0, 200.0)),
    ("tactical", "gyro"): (2.0, 100_000.0, (500.0, 800.0, 1500.0)),
    ("tactical", "accel"): (0.02, 8_000.0, (20.0, 40.0, 80.0)),
    ("mems", "gyro"): (0.1, 20_000.0, (30.0, 80.0, 200.0)),
    ("mems", "accel"): (0.1, 20_000.0, (30.0, 80.0, 200.0)),
}


@pytest.mark.parametrize(("grade", "which"), sorted(SEEN))
def test_random_walk_and_floor_of_the_allan_deviation_are_those_of_the_data_sheet(grade: GradeName, which: str) -> None:
    triad: TriadSpec = getattr(GRADES[grade], which)
    step_s, duration_s, floor_s = SEEN[grade, which]
    output = still(Instrument(triad, np.zeros(3), np.eye(3)), duration_s, step_s)
    walk = allan(output, step_s, step_s) * math.sqrt(step_s)
    floor = np.sqrt(np.mean([allan(output, step_s, tau) ** 2 - triad.white**2 / tau for tau in floor_s]))
    assert walk == pytest.approx(triad.white, rel=0.2)
    assert floor == pytest.approx(triad.in_run, rel=0.2)


def test_the_bias_of_one_start_is_as_large_as_stated() -> None:
    for grade in GRADES.values():
        draw = [Imu(grade, np.random.default_rng(seed)) for seed in range(100)]
        assert np.std([imu.gyro.bias for imu in draw]) == pytest.approx(grade.gyro.turn_on, rel=0.15)
        assert np.std([imu.accel.bias for imu in draw]) == pytest.approx(grade.accel.turn_on, rel=0.15)


def turned(instrument: Instrument, rate: float) -> Array:
    """The matrix that a rate table finds: columns are what the axes say when the table turns about x, y, z."""
    t = np.arange(0.0, 1.0, 0.5)
    columns = []
    for axis in np.eye(3):
        forth, back = (
            instrument.measure(t, np.tile(s * rate * axis, (2, 1)), np.random.default_rng(1)) for s in (1, -1)
        )
        columns.append((forth - back).mean(axis=0) / (2.0 * rate))
    return np.stack(columns, axis=1)


def test_a_rate_table_finds_scale_misalignment_and_skew() -> None:
    """Axes turned by yaw see a rotation about x as -yaw on y, one about y as +yaw on x; a bias cancels."""
    scale, angles, skew = np.array([0.01, 0.0, -0.02]), np.array([0.0, 0.0, 0.001]), np.array([0.0, 0.0, 0.003])
    values = turned(Instrument(PERFECT, np.array([0.1, 0.2, 0.3]), mat_of(scale, angles, skew)), math.radians(50.0))
    expected = [[1.01, 0.00101, 0.0], [-0.001, 1.0, 0.0], [0.0, 0.003 * 0.98, 0.98]]
    np.testing.assert_allclose(values, expected, atol=4e-6)


def test_drawn_matrices_are_as_large_as_stated() -> None:
    triad = GRADES["tactical"].gyro
    draw = [Instrument.draw(triad, np.random.default_rng(seed)).mat - np.eye(3) for seed in range(200)]
    assert np.std([np.diag(m) for m in draw]) == pytest.approx(triad.scale, rel=0.15)
    upper = [m[i, j] for m in draw for i, j in ((0, 1), (0, 2), (1, 2))]
    lower = [m[i, j] + m[j, i] for m in draw for i, j in ((0, 1), (0, 2), (1, 2))]  # the rotation cancels
    assert np.std(upper) == pytest.approx(triad.misalignment, rel=0.15)
    assert np.std(lower) == pytest.approx(triad.skew, rel=0.15)


def test_a_unit_steps_and_ends_where_its_range_does() -> None:
    triad = GRADES["mems"].accel
    feels = np.tile(np.linspace(-8.0 * STANDARD_GRAVITY, 8.0 * STANDARD_GRAVITY, 300), (3, 1)).T
    output = Instrument.draw(triad, np.random.default_rng(1)).measure(
        0.01 * np.arange(300.0), feels, np.random.default_rng(1)
    )
    assert np.abs(output).max() == pytest.approx(5.0 * STANDARD_GRAVITY)
    inside = output[np.abs(output) < 4.9 * STANDARD_GRAVITY] / (0.25e-3 * STANDARD_GRAVITY)
    np.testing.assert_allclose(inside, np.rint(inside), atol=1e-6)


def test_one_seed_is_one_unit() -> None:
    t, feels = np.arange(0.0, 1.0, 0.01), np.zeros((100, 3))
    first, again, other = (
        Imu(GRADES["tactical"], np.random.default_rng(s)).measure(t, feels, feels) for s in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert np.abs(first[1] - other[1]).max() > 0.0


def test_grades_are_as_their_documents_say_in_their_units() -> None:
    nav, tactical, mems = (GRADES[g] for g in ("navigation", "tactical", "mems"))
    assert nav.gyro.turn_on / DEG_H == pytest.approx(0.0035)
    assert nav.accel.turn_on / MICRO_G == pytest.approx(25.0)
    assert tactical.gyro.white == pytest.approx(3.6361e-5, rel=1e-4)  # rad/sqrt(s), as the NavToolkit has it
    assert tactical.accel.white == pytest.approx(3.302e-4, rel=1e-3)  # m/s/sqrt(s)
    assert mems.gyro.white / DEG_ROOT_H == pytest.approx(0.17)
    assert mems.gyro.limit / DEG == pytest.approx(100.0)


# --------------------------------------------------------------------------------------------------------- processes


def test_sweeps_are_the_recursion() -> None:
    kicks, at = np.random.default_rng(1).normal(size=1000), 0.0
    for keep in (0.0, 0.5, 0.999):
        expected = [at := keep * at + kick for kick in kicks]
        np.testing.assert_allclose(recursion(kicks, keep), expected, rtol=1e-12)
        at = 0.0


def test_a_gauss_markov_process_forgets_in_its_time() -> None:
    """Its Allan deviation is 0.437 sqrt(2) sd at 1.89 correlation times (IEEE Std 952-1997, C.1.7)."""
    t = np.arange(0.0, 100_000.0, 1.0)
    values = np.stack([gauss_markov_noise(t, 2.0, 100.0, np.random.default_rng(seed)) for seed in range(3)], axis=1)
    assert values.std() == pytest.approx(2.0, rel=0.05)
    assert allan(values, 1.0, 189.0) == pytest.approx(0.437 * math.sqrt(2.0) * 2.0, rel=0.1)


def test_flicker_has_a_floor_over_three_decades() -> None:
    t = np.arange(0.0, 300_000.0, 2.0)
    values = np.stack([flicker_noise(t, 3.0, np.random.default_rng(seed)) for seed in range(3)], axis=1)
    floor = [allan(values, 2.0, tau) for tau in (10.0, 100.0, 1000.0, 8000.0)]
    np.testing.assert_allclose(floor, 3.0, rtol=0.2)


def test_play_follows_only_when_it_is_pushed() -> None:
    pushed = backlash(np.array([0.0, 0.4, 1.0, 0.8, 0.2, -2.0]), 1.0)
    np.testing.assert_allclose(pushed, [0.0, 0.0, 0.5, 0.5, 0.5, -1.5])


def test_steps_are_whole_multiples() -> None:
    np.testing.assert_allclose(quantize(np.array([-0.26, 0.12, 0.13]), 0.25), [-0.25, 0.0, 0.25])
