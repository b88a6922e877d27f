"""Growth of errors, against the difference of two strapdowns with slightly different starts."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.quaternions import mat_from_quat, quat_from_mat
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.nav.inertial.ins_error_model import (
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
            assert known.white == pytest.approx(drawn.white, rel=1e-6)
            assert known.bias_sd >= 0.99 * np.hypot(drawn.turn_on, drawn.in_run)
            assert known.scale >= 0.95 * np.hypot(drawn.scale, drawn.misalignment)
