"""The error model of the vertical channel against closed forms and scipy's matrix exponential."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from fti.geodesy.formulas import FREE_AIR
from fti.nav.vertical.error_model import ACCEL, ALTIMETER, CLIMB, HEIGHT, VerticalModel, system_matrix


def test_an_error_of_height_grows_e_fold_in_nine_and_a_half_minutes() -> None:
    phi, _ = VerticalModel().step(1.0)
    error = np.linalg.matrix_power(phi, 600) @ np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    assert error[HEIGHT] == pytest.approx(math.cosh(math.sqrt(FREE_AIR) * 600.0), rel=1e-9)
    assert 1.0 / math.sqrt(FREE_AIR) == pytest.approx(9.5 * 60.0, abs=1.0)


def test_an_error_of_acceleration_becomes_height() -> None:
    phi, _ = VerticalModel(accel_tau_s=1e9).step(1.0)
    error = np.linalg.matrix_power(phi, 10) @ np.array([0.0, 0.0, 1e-3, 0.0, 0.0])
    assert error[HEIGHT] == pytest.approx(0.05, rel=1e-3)  # a t^2 / 2
    assert error[CLIMB] == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("dt", [0.0025, 0.1, 1.0])
def test_a_step_is_the_exponential_and_its_integral(dt: float) -> None:
    """Van Loan 1978: exp of one matrix of twice the size holds both."""
    model = VerticalModel()
    phi, Q = model.step(dt)
    F = system_matrix(FREE_AIR, 1 / model.accel_tau_s, 1 / model.gravity_tau_s, 1 / model.altimeter_tau_s)
    sds = np.array([model.accel_sd**2 / model.accel_tau_s, model.gravity_sd**2 / model.gravity_tau_s])
    W = np.diag([0.0, model.accel_noise**2, *(2 * sds), 2 * model.altimeter_sd**2 / model.altimeter_tau_s])
    block = expm(np.block([[-F, W], [np.zeros((5, 5)), F.T]]) * dt)
    assert np.allclose(phi, expm(F * dt), rtol=0.0, atol=1e-9)
    exact = block[5:, 5:].T @ block[:5, 5:]
    sd = np.sqrt(np.diag(exact))
    assert np.all(np.abs(Q - exact) <= 3e-4 * dt**2 * np.outer(sd, sd) + 1e-18)


def test_many_small_steps_are_one() -> None:
    model = VerticalModel()
    P = Q = np.zeros((5, 5))
    small, Q = model.step(0.1)
    for _ in range(10):
        P = small @ P @ small.T + Q
    whole, Q = model.step(1.0)
    assert np.allclose(np.linalg.matrix_power(small, 10), whole, rtol=0.0, atol=1e-9)
    sd = np.sqrt(np.diag(P))
    assert np.all(np.abs(P - Q) <= 3e-4 * np.outer(sd, sd))


def test_what_forgets_keeps_its_size() -> None:
    model = VerticalModel()
    P = model.start(3.0, 0.1)
    phi, Q = model.step(1.0)
    for _ in range(300):
        P = phi @ P @ phi.T + Q
    assert math.sqrt(P[ACCEL, ACCEL]) == pytest.approx(model.accel_sd, rel=1e-6)
    assert P[HEIGHT, HEIGHT] > 100.0**2  # nothing holds it


def test_a_doubtful_ground_makes_the_altimeter_forget_to_that_size() -> None:
    model = VerticalModel()
    P = model.start(3.0, 0.1)
    phi, Q = model.step(1.0, 20.0)
    for _ in range(100):
        P = phi @ P @ phi.T + Q
    assert math.sqrt(P[ALTIMETER, ALTIMETER]) == pytest.approx(math.hypot(model.altimeter_sd, 20.0), rel=1e-3)
    others = np.arange(5) != ALTIMETER
    assert np.array_equal(Q[others], model.step(1.0)[1][others])
