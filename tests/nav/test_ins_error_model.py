"""Growth of errors, against the difference of two strapdowns with slightly different starts."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.quaternions import mat_from_quat, quat_from_mat
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.hil.sensors.errors import flicker_noise
from fti.nav.inertial.ins_error_model import (
    FLICKER_MATCH,
    HEADING_S,
    IMU_ERROR_MODELS,
    MANOEUVRE_S,
    ImuErrorModel,
    TriadErrorModel,
    noise,
    rates,
    transition,
)
from fti.nav.inertial.strapdown import Motion
from fti.nav.inertial.strapdown_fast import integrate_fast

Array = NDArray[np.float64]

LAT, LON, STEP, SECONDS = 0.8, 0.2, 0.01, 2.0
MAT_EB = mat_en(LAT, LON) @ mat_from_rpy(0.3, -0.2, 1.0)
FORCE_B, RATE_B = np.array([2.0, -1.0, -11.0]), np.array([1e-4, -2e-4, 5e-5])


def end(error: Array) -> tuple[Array, Array, Array]:
    """Position, velocity and attitude after two seconds, of a start and sensors that are wrong by an error (15,)."""
    n = round(SECONDS / STEP) + 1
    x, y, z = error[6:9]
    turn = np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])
    quat = quat_from_mat((turn @ MAT_EB)[None])[0]
    start = Motion(ecef_from_geodetic(LAT, LON, 900.0) + error[:3], np.array([30.0, -40.0, 20.0]) + error[3:6], quat)
    imu = np.tile(FORCE_B - error[9:12], (n, 1)), np.tile(RATE_B - error[12:15], (n, 1))
    motion = integrate_fast(start, *imu, STEP, every=n - 1)
    return motion.pos_e[-1], motion.vel_e[-1], mat_from_quat(motion.quat_eb[-1])


@pytest.mark.parametrize("state", range(15))
def test_each_error_grows_as_the_equations_say(state: int) -> None:
    size = [1.0, 1e-2, 1e-4, 1e-2, 1e-4][state // 3]
    error = np.zeros(15)
    error[state] = size
    (pos, vel, mat), (pos0, vel0, mat0) = end(error), end(np.zeros(15))
    turn = mat @ mat0.T
    grown = np.concatenate((pos - pos0, vel - vel0, [turn[2, 1], turn[0, 2], turn[1, 0]]))
    down_e = mat_en(LAT, LON)[:, 2]
    phi = np.eye(15)
    one = np.eye(15)
    one[:9] = transition(rates(MAT_EB, MAT_EB @ FORCE_B, down_e, True), STEP)
    for _ in range(round(SECONDS / STEP)):
        phi = one @ phi
    expected = (phi @ error)[:9]
    scale = np.abs(expected).max()
    assert np.abs(grown - expected).max() < 3e-3 * scale  # the body turns by 0.5 mrad, and G is good to 0.5 %


def test_nine_states_are_the_first_nine_columns() -> None:
    down_e = mat_en(LAT, LON)[:, 2]
    whole, nine = (rates(MAT_EB, MAT_EB @ FORCE_B, down_e, biased) for biased in (True, False))
    np.testing.assert_array_equal(whole[:, :9], nine)


def test_scale_counts_as_noise_in_turns_and_not_in_level_flight() -> None:
    unit = ImuErrorModel(TriadErrorModel(0.01, 1.0, scale=1e-3), TriadErrorModel(1e-4, 1.0, scale=1e-3)).table
    level, still = np.array([0.0, 0.0, -9.8]), np.zeros(3)
    assert noise(unit, level, still, True) == pytest.approx((1e-4, 1e-8))
    accel, gyro = noise(unit, np.array([0.0, 0.0, -19.6]), np.array([0.0, 0.3, 0.4]), True)
    assert accel == pytest.approx(1e-4 + 9.8**2 * 1e-6 * MANOEUVRE_S)
    assert gyro == pytest.approx(1e-8 + 0.25e-6 * MANOEUVRE_S)


def test_without_states_of_their_own_biases_count_as_noise() -> None:
    unit = IMU_ERROR_MODELS["tactical"]
    with_states, without = (noise(unit.table, np.array([0.0, 0.0, -9.8]), np.zeros(3), b) for b in (True, False))
    assert without[0] - with_states[0] == pytest.approx(unit.accel.bias_sd**2 * MANOEUVRE_S)
    assert without[1] - with_states[1] == pytest.approx(unit.gyro.bias_sd**2 * MANOEUVRE_S)


def test_the_grades_are_those_of_the_emulated_units() -> None:
    from fti.hil.sensors.imu_grades import GRADES

    for name, unit in IMU_ERROR_MODELS.items():
        for known, drawn in ((unit.accel, GRADES[name].accel), (unit.gyro, GRADES[name].gyro)):  # type: ignore[index]
            assert known.in_run == pytest.approx(drawn.in_run, rel=1e-6)
            assert known.white == pytest.approx(drawn.white, rel=1e-6)
            assert known.bias_sd >= 0.99 * np.hypot(drawn.turn_on, drawn.in_run)
            assert known.scale >= 0.95 * np.hypot(drawn.scale, drawn.misalignment)
        gyro, drawn = unit.gyro, GRADES[name].gyro  # type: ignore[index]
        assert gyro.factor == pytest.approx(np.hypot(drawn.scale, drawn.skew), rel=0.05)
        assert gyro.alignment == pytest.approx(drawn.misalignment, rel=0.05)


def test_a_constant_bias_with_flicker_noise_is_what_an_emulated_gyro_has() -> None:
    """Heading of a gyro at rest without its mean over 150 s: error over the sigma of white noise and walk, 50 to 500 s.

    The oracle is the noise of the emulated unit.  The ratio of 400 draws has a sigma of 3.5 %.  The change within
    an hour that the model for flights with fixes has is more than ten times as large.
    """
    rate, known_s = 0.25, 150.0
    t = np.arange(0.0, known_s + 500.0, rate)
    errors = np.array([flicker_noise(t, 1.0, np.random.default_rng(seed)) for seed in range(400)])
    first = round(known_s / rate)
    headings = np.cumsum(errors[:, first:] - errors[:, :first].mean(axis=1, keepdims=True), axis=1) * rate
    model = TriadErrorModel(1e-9, 1e3, in_run=1.0).with_constant_bias(HEADING_S)
    walk = 2.0 * model.bias_sd**2 / model.period_s
    for after in (50.0, 100.0, 200.0, 350.0, 500.0):
        # white noise and walk after the time, and those of the mean before it
        variance = model.white**2 * (after + after**2 / known_s) + walk * (after**3 + after**2 * known_s) / 3.0
        found = float(np.sqrt(np.mean(headings[:, round(after / rate) - 1] ** 2)))
        assert 0.85 < found / np.sqrt(variance) < 1.15, after
        hour = TriadErrorModel(1e-9, 1e3)
        assert 2.0 * hour.bias_sd**2 / hour.period_s * after**3 / 3.0 > 100.0 * found**2


def test_white_noise_and_walk_have_their_lowest_allan_deviation_at_the_time_for_which_a_bias_acts() -> None:
    model = TriadErrorModel(1e-9, 1e3, in_run=0.3).with_constant_bias(80.0)
    tau = np.geomspace(1.0, 1e4, 2001)
    deviation = np.sqrt(model.white**2 / tau + 2.0 * model.bias_sd**2 / model.period_s * tau / 3.0)
    assert deviation.min() == pytest.approx(0.3 * np.sqrt(FLICKER_MATCH), rel=1e-4)
    assert tau[deviation.argmin()] == pytest.approx(80.0, rel=0.01)
    assert TriadErrorModel(0.1, 1.0).with_constant_bias(80.0) == TriadErrorModel(0.1, 1.0)
