"""Free inertial navigation: errors as theory has them, in closed form, and a height that is held."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.formulas import EARTH_RATE
from fti.geodesy.gravity import normal_gravity
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import radii
from fti.hil.sensors.free_inertial import SCHULER, TAU_S, DriftSigmas, InertialSolution, drift_sd, run_free

Array = NDArray[np.float64]
STEP_S = 2.0
PERIOD_S = 2.0 * math.pi / SCHULER
MICRO_G, DEG_H = 9.80665e-6, math.radians(1.0) / 3600.0


def resting(
    lat_deg: float,
    duration_s: float,
    accel: tuple[float, float, float] = (0.0, 0.0, 0.0),
    gyro: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tilt: float = 0.0,
    velocity: float = 0.0,
    step_s: float = STEP_S,
) -> tuple[Array, Array, InertialSolution]:
    """Times [s], the error northwards [m] and what a system says that stands level, nose to the north.

    accel, gyro : constant errors, forward, right, down; tilt : of the pitch; velocity : northwards, at the start
    """
    lat = math.radians(lat_deg)
    t = np.arange(0.0, duration_s, step_s)
    force = np.array([0.0, 0.0, -float(normal_gravity(lat, 0.0))]) + np.array(accel)
    rate = mat_en(lat, 0.0).T @ np.array([0.0, 0.0, EARTH_RATE]) + np.array(gyro)
    start = InertialSolution(
        np.array([lat]), np.zeros(1), np.zeros(1), np.array([[velocity, 0.0, 0.0]]), np.array([[0.0, tilt, 0.0]])
    )
    solution = run_free(
        start, np.tile(force, (len(t), 1)), np.tile(rate, (len(t), 1)), step=step_s, baro=np.zeros(len(t))
    )
    return t, np.asarray((solution.lat - lat) * radii(np.asarray(lat))[0]), solution


def test_without_errors_it_stays() -> None:
    _, north, solution = resting(48.0, 1.5 * PERIOD_S)
    assert np.abs(north).max() < 1e-3
    assert np.abs(solution.alt).max() < 1e-3
    assert np.abs(solution.rpy[:, :2]).max() < 1e-9


def test_schulers_period_is_84_minutes() -> None:
    assert pytest.approx(84.4, abs=0.1) == PERIOD_S / 60.0


# At the equator the meridian's plane does not turn: nothing but Schuler.


def test_a_constant_accelerometer_bias_swings_between_zero_and_two_b_over_w_squared() -> None:
    """50 ug: 637 m at most.  b / w^2 (1 - cos w t) within 1 % of its size, over one and a half periods."""
    bias = 50.0 * MICRO_G
    t, north, _ = resting(0.0, 1.5 * PERIOD_S, accel=(bias, 0.0, 0.0))
    expected = bias / SCHULER**2 * (1.0 - np.cos(SCHULER * t))
    np.testing.assert_allclose(north, expected, atol=0.015 * expected.max())
    peak, trough = (
        t[np.argmax(north[t < PERIOD_S])],
        t[t > 0.7 * PERIOD_S][np.argmin(north[(t > 0.7 * PERIOD_S)][:2000])],
    )
    assert 2.0 * (trough - peak) / 60.0 == pytest.approx(84.4, rel=0.01)


def test_a_gyro_drift_is_a_ramp_with_an_oscillation() -> None:
    """0.01 deg/h about the right axis, some 1100 m/h: the nose seems to rise, it runs back.

    The Earth turns the axis out of the horizontal, by 25 deg in 100 minutes: sin(W t) / W instead of t.
    """
    drift = 0.01 * DEG_H
    t, north, _ = resting(0.0, 1.2 * PERIOD_S, gyro=(0.0, drift, 0.0))
    expected = -6.371e6 * drift * (np.sin(EARTH_RATE * t) / EARTH_RATE - np.sin(SCHULER * t) / SCHULER)
    np.testing.assert_allclose(north, expected, atol=0.02 * np.abs(expected).max())


def test_a_velocity_error_and_a_tilt_swing_about_zero_and_about_their_size() -> None:
    t, by_velocity, _ = resting(0.0, PERIOD_S, velocity=0.5)
    np.testing.assert_allclose(by_velocity, 0.5 / SCHULER * np.sin(SCHULER * t), atol=0.02 * 0.5 / SCHULER)
    t, by_tilt, _ = resting(0.0, PERIOD_S, tilt=1e-4)
    expected = -6.371e6 * 1e-4 * (1.0 - np.cos(SCHULER * t))
    np.testing.assert_allclose(by_tilt, expected, atol=0.04 * np.abs(expected).max())


def test_elsewhere_the_plane_of_the_swing_turns_as_foucaults_does() -> None:
    """At 48 N by 11.1 deg/h: after a period the swing that was northwards is 15.7 deg aside."""
    bias = 50.0 * MICRO_G
    t, north, solution = resting(48.0, PERIOD_S, accel=(bias, 0.0, 0.0))
    expected = bias / SCHULER**2 * (1.0 - np.cos(SCHULER * t) * np.cos(EARTH_RATE * math.sin(math.radians(48.0)) * t))
    np.testing.assert_allclose(north, expected, atol=0.03 * expected.max())
    east = solution.lon * radii(np.asarray(math.radians(48.0)))[1] * math.cos(math.radians(48.0))
    assert np.abs(east).max() > 0.1 * expected.max()


# ---------------------------------------------------------------------------------------------------- the height


def test_the_height_is_held_and_learns_the_bias_of_the_vertical_accelerometer() -> None:
    """1 mg upwards: b t^2 / 2 e^(-t / tau), at most 26.5 m at 2 tau.  It is held once a second: 1 % of tau late."""
    t, _, solution = resting(48.0, 10.0 * TAU_S, accel=(0.0, 0.0, -1e3 * MICRO_G), step_s=0.2)
    expected = 0.5 * 1e3 * MICRO_G * t**2 * np.exp(-t / TAU_S)
    np.testing.assert_allclose(solution.alt, expected, atol=0.03 * expected.max())
    assert abs(solution.alt[-1]) < 0.5


def test_a_bias_that_was_known_before_does_no_harm() -> None:
    lat = math.radians(48.0)
    force = np.tile([0.0, 0.0, -float(normal_gravity(lat, 0.0)) - 0.01], (200, 1))
    rate = np.tile(mat_en(lat, 0.0).T @ np.array([0.0, 0.0, EARTH_RATE]), (200, 1))
    start = InertialSolution(np.array([lat]), np.zeros(1), np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3)))
    solution = run_free(start, force, rate, step=STEP_S, baro=np.zeros(200), known=-0.01)
    assert np.abs(solution.alt).max() < 0.05


def test_the_height_follows_the_air_after_minutes() -> None:
    lat = math.radians(48.0)
    n = 1500
    force = np.tile([0.0, 0.0, -float(normal_gravity(lat, 0.0))], (n, 1))
    rate = np.tile(mat_en(lat, 0.0).T @ np.array([0.0, 0.0, EARTH_RATE]), (n, 1))
    start = InertialSolution(np.array([lat]), np.zeros(1), np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3)))
    solution = run_free(start, force, rate, step=STEP_S, baro=np.full(n, 30.0))
    assert solution.alt[10] < 10.0
    assert solution.alt[-1] == pytest.approx(30.0, abs=0.3)


# ------------------------------------------------------------------------------------------------------- doubts


def test_what_it_says_of_its_drift_is_the_closed_form() -> None:
    t = np.array([0.0, 0.25 * PERIOD_S, 0.5 * PERIOD_S])
    sigmas = DriftSigmas(
        50.0 * MICRO_G, in_run=0.0, gyro=0.0, tilt=0.0, heading=0.0, velocity=0.0, position=3.0, height=0.0
    )
    position, velocity = drift_sd(t, sigmas)
    size = 50.0 * MICRO_G / SCHULER**2
    np.testing.assert_allclose(position, np.hypot(3.0, size * np.array([0.0, 1.0, 2.0])), rtol=1e-9)
    np.testing.assert_allclose(velocity, size * SCHULER * np.array([0.0, 1.0, 0.0]), atol=1e-9)
