"""The filter of thirteen errors: closed forms, and the scatter of simulated errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.constants import STANDARD_GRAVITY
from fti.geodesy.local import MAT_ENU_NED, LocalFrame
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.inertial.ins_error_model import ImuErrorModel, TriadErrorModel
from fti.nav.interferometric.correction_filter import (
    ACCEL_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    STATES,
    VELOCITY,
    CorrectionFilter,
    StartErrors,
    process_noise,
    start_cov,
    transition,
)

FRAME = LocalFrame(math.radians(40.0), math.radians(10.0), 0.0)
UNIT = ImuErrorModel(TriadErrorModel(white=1e-4, bias_sd=5e-4), TriadErrorModel(white=2e-6, bias_sd=3e-8))
START = StartErrors(position=30.0, velocity=0.1, tilt=5e-5, heading=1e-3)
#: Level flight to the east.
MAT_LB = MAT_ENU_NED @ mat_from_rpy(0.0, 0.0, math.radians(90.0))
LIFT_B = np.array([0.0, 0.0, -STANDARD_GRAVITY])


def propagate(x: np.ndarray, seconds: int) -> np.ndarray:
    phi = transition(FRAME, MAT_LB, LIFT_B, 1.0)
    for _ in range(seconds):
        x = phi @ x
    return x


def test_a_velocity_error_moves_the_position() -> None:
    x = np.zeros(STATES)
    x[VELOCITY] = 0.1, -0.2
    after = propagate(x, 60)
    assert after[POSITION] == pytest.approx([6.0, -12.0], rel=0.01)  # Schuler and Coriolis: 0.2 % and 0.3 %


def test_a_forward_bias_accelerates_along_the_heading_and_to_estimate_from_truth() -> None:
    """A measured force that is too large: the truth falls behind the estimate by b t^2 / 2."""
    x = np.zeros(STATES)
    x[ACCEL_BIAS] = 1e-3, 0.0, 0.0  # forward is east
    after = propagate(x, 60)
    assert after[POSITION] == pytest.approx([-1e-3 * 60.0**2 / 2.0, 0.0], rel=0.01, abs=0.01)


def test_a_tilt_accelerates_by_gravity_across_its_axis() -> None:
    """True turned by psi about north against the estimate: the true force leans to the east, g psi."""
    x = np.zeros(STATES)
    x[ATTITUDE] = 0.0, 1e-4, 0.0
    after = propagate(x, 60)
    assert after[POSITION] == pytest.approx([STANDARD_GRAVITY * 1e-4 * 60.0**2 / 2.0, 0.0], rel=0.01, abs=0.02)


def test_a_gyro_bias_tilts() -> None:
    x = np.zeros(STATES)
    x[GYRO_BIAS] = 0.0, 1e-6, 0.0  # right is south
    after = propagate(x, 100)
    assert after[ATTITUDE] == pytest.approx([0.0, 1e-4, 0.0], abs=3e-6)


def test_errors_are_within_the_stated_sigma() -> None:
    """400 flights of 200 s with a fix every 40 s: squares of the errors over their variance, within 4 sigma of 1."""
    rng, runs, phi, Q = np.random.default_rng(8), 400, transition(FRAME, MAT_LB, LIFT_B, 1.0), process_noise(UNIT, 1.0)
    squares = []
    for _ in range(runs):
        tracked = CorrectionFilter(UNIT, START)
        true = np.sqrt(np.diag(start_cov(START, UNIT))) * rng.standard_normal(STATES)
        past = []
        for second in range(200):
            true = phi @ true + np.sqrt(np.diag(Q)) * rng.standard_normal(STATES)
            tracked.predict(phi, Q)
            past.append((true - tracked.x)[POSITION])
            if second % 40 == 39:
                tracked.update(past[-20] + 10.0 * rng.standard_normal(2), sd=10.0, age=19.0)
        left = true - tracked.x
        squares.append(left[:4] ** 2 / np.diag(tracked.P)[:4])
    assert np.mean(squares, axis=0) == pytest.approx(np.ones(4), abs=4.0 * math.sqrt(2.0 / runs))


def test_the_age_of_a_shift_counts() -> None:
    """A known velocity error and a shift that is 20 s old: the position has moved on since."""
    tracked = CorrectionFilter(UNIT, START)
    tracked.x[VELOCITY] = 0.0
    tracked.P = np.diag([1e6, 1e6, 1.0, 1.0, *[1e-18] * 9])
    tracked.P[0, 2] = tracked.P[2, 0] = 20.0 * 1.0  # position error 20 s times the velocity error
    tracked.update(np.array([100.0, 0.0]), sd=1.0, age=20.0)
    assert tracked.x[POSITION][0] == pytest.approx(100.0, rel=1e-3)
    assert np.sqrt(tracked.P[0, 0]) == pytest.approx(20.0, rel=0.05)  # 20 s of 1 m/s
