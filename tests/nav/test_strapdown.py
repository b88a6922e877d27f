"""The strapdown: closed forms, another integrator with other equations, order of convergence, effect of errors."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fti.geodesy.formulas import EARTH_RATE
from fti.geodesy.gravity import normal_gravity, transport_rate
from fti.geodesy.quaternions import mat_from_quat, quat_from_mat
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef, radii
from fti.nav.inertial.strapdown import Motion, integrate, midpoints

Array = NDArray[np.float64]

LAT, LON, ALT = np.deg2rad(48.0), np.deg2rad(11.0), 500.0
EARTH_E = np.array([0.0, 0.0, EARTH_RATE])
STEP = 0.01


def still(lat: float, mat_nb: Array, seconds: float) -> tuple[Motion, Array, Array]:
    """Who stands on the Earth: the start, and what the sensors feel."""
    mat = mat_en(lat, LON)
    start = Motion(ecef_from_geodetic(lat, LON, ALT), np.zeros(3), quat_from_mat((mat @ mat_nb)[None])[0])
    n = round(seconds / STEP) + 1
    accel_b = mat_nb.T @ np.array([0.0, 0.0, -float(normal_gravity(lat, ALT))])
    gyro_b = mat_nb.T @ mat.T @ EARTH_E
    return start, np.tile(accel_b, (n, 1)), np.tile(gyro_b, (n, 1))


@pytest.mark.parametrize("lat_deg", [-90.0, -33.0, 0.0, 48.0, 90.0])
def test_who_stands_still_stays(lat_deg: float) -> None:
    """Ten minutes at any latitude, the poles included, in any attitude."""
    start, accel_b, gyro_b = still(np.deg2rad(lat_deg), mat_from_rpy(0.5, -0.9, 2.0), 600.0)
    motion = integrate(start, accel_b, gyro_b, STEP, every=100)
    assert np.abs(motion.pos_e - start.pos_e).max() < 1e-8
    assert np.abs(motion.vel_e).max() < 1e-10
    assert np.abs(motion.quat_eb - start.quat_eb).max() < 1e-13


def test_a_height_error_grows_as_the_vertical_channel_does() -> None:
    """cosh(t sqrt(2 g / R)) of a centimetre, with the local gradient of normal gravity."""
    start, accel_b, gyro_b = still(LAT, np.eye(3), 1200.0)
    higher = Motion(ecef_from_geodetic(LAT, LON, ALT + 0.01), start.vel_e, start.quat_eb)
    motion = integrate(higher, accel_b, gyro_b, STEP, every=10_000)
    _, _, alt = geodetic_from_ecef(motion.pos_e)
    t = np.arange(len(alt)) * 100.0
    # free air, less what rotation adds outwards, and the lean of the vertical
    np.testing.assert_allclose(alt - ALT, 0.01 * np.cosh(t * np.sqrt(3.086e-6)), rtol=2e-3)


def test_a_level_error_swings_with_schulers_period() -> None:
    """A metre per second on the level is back after 84.4 min: zero displacement rate change sign at half of it."""
    start, accel_b, gyro_b = still(0.0, np.eye(3), 2700.0)
    north = Motion(start.pos_e, mat_en(0.0, LON)[:, 0] * 0.001, start.quat_eb)
    moved = integrate(north, accel_b, gyro_b, STEP, every=100).pos_e - start.pos_e
    along = moved @ mat_en(0.0, LON)[:, 0]
    quarter = int(np.argmax(along))
    r_meridian, _ = radii(0.0)
    period = 2.0 * np.pi * np.sqrt(float(r_meridian) / float(normal_gravity(0.0, ALT)))
    assert quarter == pytest.approx(period / 4.0, rel=0.02)


def swaying(t: Array) -> tuple[Array, Array]:
    """What sensors feel of something that sways, turns and bumps, shape (n, 3) each."""
    accel_b = np.stack([1.0 * np.sin(1.3 * t), 0.7 * np.cos(0.9 * t), -9.8 + 0.5 * np.sin(2.1 * t)], axis=-1)
    gyro_b = np.stack([0.2 * np.sin(1.1 * t), 0.1 * np.cos(1.7 * t), 0.15 * np.sin(0.7 * t)], axis=-1)
    return accel_b, gyro_b


def in_n(t: float, y: Array) -> Array:
    """Eq. 7.2 and 7.3 in latitude, longitude, height, north, east, down, and a matrix: the other mechanisation."""
    (lat, lon, alt), vel_n, mat_nb = y[:3], y[3:6], y[6:].reshape(3, 3)
    accel_b, gyro_b = swaying(np.array(t))
    r_meridian, r_normal = radii(lat)
    earth_n = mat_en(lat, lon).T @ EARTH_E
    turn_n = transport_rate(np.array([lat]), np.array([alt]), vel_n[None])[0]
    gravity_n = np.array([0.0, 0.0, float(normal_gravity(lat, alt))])
    vel_rate = mat_nb @ accel_b + gravity_n - np.cross(2.0 * earth_n + turn_n, vel_n)
    mat_rate = mat_nb @ _skew(gyro_b) - _skew(earth_n + turn_n) @ mat_nb
    place_rate = [vel_n[0] / (r_meridian + alt), vel_n[1] / (r_normal + alt) / np.cos(lat), -vel_n[2]]
    return np.concatenate((place_rate, vel_rate, mat_rate.ravel()))


def _skew(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@pytest.fixture(scope="module")
def other() -> Array:
    """The end of a minute as DOP853 on the equations in n has it."""
    first = np.concatenate(([LAT, LON, ALT, 60.0, -20.0, 3.0], mat_from_rpy(0.2, 0.1, -0.3).ravel()))
    solved = solve_ivp(in_n, (0.0, 60.0), first, method="DOP853", rtol=1e-13, atol=1e-15)
    return np.asarray(solved.y[:, -1])


def closed(step: float, gyro_bias: float = 0.0, accel_bias: float = 0.0) -> Array:
    """The same minute by the strapdown: position, velocity [e], matrix of the attitude, in one row."""
    t = step * np.arange(round(60.0 / step) + 1, dtype=np.float64)
    mat = mat_en(LAT, LON)
    quat = quat_from_mat((mat @ mat_from_rpy(0.2, 0.1, -0.3))[None])[0]
    start = Motion(ecef_from_geodetic(LAT, LON, ALT), mat @ [60.0, -20.0, 3.0], quat)
    accel_b, gyro_b = swaying(t)
    motion = integrate(start, accel_b + accel_bias, gyro_b + gyro_bias, step, every=len(t) - 1)
    last = motion.quat_eb[-1] / np.linalg.norm(motion.quat_eb[-1])
    return np.concatenate((motion.pos_e[-1], motion.vel_e[-1], mat_from_quat(last).ravel()))


def in_e(other: Array) -> Array:
    mat = mat_en(other[0], other[1])
    attitude = mat @ other[6:].reshape(3, 3)
    return np.concatenate((ecef_from_geodetic(*other[:3]), mat @ other[3:6], attitude.ravel()))


def errors(other: Array, step: float, **biases: float) -> tuple[float, float, float]:
    off = np.abs(closed(step, **biases) - in_e(other))
    return float(off[:3].max()), float(off[3:6].max()), float(off[6:].max())


def test_agrees_with_another_integrator_on_other_equations(other: Array) -> None:
    """A minute of swaying: DOP853 on latitude, longitude and a matrix in n."""
    position, velocity, attitude = errors(other, 0.01)
    assert position < 5e-8
    assert velocity < 2e-9
    assert attitude < 1e-11


def test_the_error_falls_by_the_order_of_the_method(other: Array) -> None:
    """Sixteenfold, or more, for each halving of the step."""
    values = np.array([errors(other, step)[0] for step in (0.2, 0.1, 0.05)])
    assert (values[:-1] / values[1:]).min() > 12.0


@pytest.mark.parametrize(
    ("biases", "min_error"), [({"gyro_bias": 1e-9}, 1e-6), ({"accel_bias": 1e-9}, 1e-6)], ids=["gyro", "accelerometer"]
)
def test_a_bias_of_a_billionth_is_seen(other: Array, biases: dict[str, float], min_error: float) -> None:
    assert errors(other, 0.01, **biases)[0] > min_error


def test_compensation_keeps_what_rounding_would_lose() -> None:
    """An hour on the ground: 360 000 steps, each of nothing but rounding."""
    start, accel_b, gyro_b = still(LAT, mat_from_rpy(0.1, 0.2, 0.3), 3600.0)
    motion = integrate(start, accel_b, gyro_b, STEP, every=360_000)
    assert np.abs(motion.pos_e[-1] - start.pos_e).max() < 1e-6


def test_midpoints_are_those_of_a_polynomial_up_to_the_ends() -> None:
    t = np.arange(9.0)
    samples = np.stack([t**5 - 3 * t**2, 7.0 - t], axis=1)
    half = t[:-1] + 0.5
    np.testing.assert_allclose(midpoints(samples), np.stack([half**5 - 3 * half**2, 7.0 - half], axis=1), atol=1e-10)
    spike = np.zeros((9, 1))
    spike[4] = 256.0
    np.testing.assert_allclose(midpoints(spike)[2:6, 0], [-25.0, 150.0, 150.0, -25.0])


def test_every_so_many_samples_are_returned_and_others_are_the_same() -> None:
    start, accel_b, gyro_b = still(LAT, np.eye(3), 1.0)
    every = integrate(start, accel_b, gyro_b, STEP)
    assert every.pos_e.shape == (101, 3)
    np.testing.assert_array_equal(integrate(start, accel_b, gyro_b, STEP, every=25).pos_e, every.pos_e[::25])


def test_refuses_too_few_samples_and_other_shapes() -> None:
    start, accel_b, gyro_b = still(LAT, np.eye(3), 1.0)
    with pytest.raises(ValueError, match="with n >= 6, not"):
        integrate(start, accel_b[:5], gyro_b[:5], STEP)
    with pytest.raises(ValueError, match=r"not \(101, 2\) and"):
        integrate(start, accel_b[:, :2], gyro_b, STEP)
