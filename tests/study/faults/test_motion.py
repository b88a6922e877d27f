"""Truth and ideal inertial samples, against an integration in the Earth-fixed frame with another form of gravity."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.wgs84 import displace
from fti.study.faults.course import draw_course
from fti.study.faults.inertial_unit import ideal_samples
from fti.study.faults.trajectory import Course, SmoothProfile, Trajectory, gravity_n

Array = NDArray[np.float64]

A, B, E2 = 6378137.0, 6356752.314245, 0.00669437999014
GM, OMEGA = 3.986004418e14, 7.292115e-5
#: Zonal coefficients of the normal field (NIMA TR8350.2, 3rd edition; Heiskanen and Moritz 1967, equation 2-92).
ZONAL = {2: 1.082629821313e-3, 4: -2.37091120e-6, 6: 6.08346498e-9}
RATE_E = np.array([0.0, 0.0, OMEGA])


def ecef(lat: float, lon: float, alt: float) -> Array:
    n = A / math.sqrt(1.0 - E2 * math.sin(lat) ** 2)
    across = (n + alt) * math.cos(lat)
    return np.array([across * math.cos(lon), across * math.sin(lon), (n * (1.0 - E2) + alt) * math.sin(lat)])


def axes(lat: float, lon: float) -> Array:
    """Columns: north, east, down in the Earth-fixed frame."""
    s, c, sl, cl = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    return np.array([[-s * cl, -sl, -c * cl], [-s * sl, cl, -c * sl], [c, 0.0, -s]])


def body_axes(roll: float, pitch: float, heading: float) -> Array:
    """Body to local axes as three elementary rotations."""

    def turn(axis: int, angle: float) -> Array:
        i, j = (axis + 1) % 3, (axis + 2) % 3
        m = np.eye(3)
        m[i, i] = m[j, j] = math.cos(angle)
        m[i, j], m[j, i] = -math.sin(angle), math.sin(angle)
        return m

    return turn(2, heading) @ turn(1, pitch) @ turn(0, roll)


COEFFICIENTS = {n: np.polynomial.legendre.leg2poly([0.0] * n + [1.0]) for n in ZONAL}
SLOPES = {n: np.polynomial.polynomial.polyder(c) for n, c in COEFFICIENTS.items()}


def gravitation(r: Array) -> Array:
    """Gradient of GM / r (1 - sum J_n (a/r)^n P_n(sin phi))."""
    length = math.sqrt(r @ r)
    s = r[2] / length
    up = r / length
    radial, along = 1.0, 0.0
    for n, j in ZONAL.items():
        p = sum(c * s**k for k, c in enumerate(COEFFICIENTS[n].tolist()))
        dp = sum(c * s**k for k, c in enumerate(SLOPES[n].tolist()))
        radial -= (n + 1) * j * (A / length) ** n * p
        along -= j * (A / length) ** n * dp
    pole = np.array([0.0, 0.0, 1.0]) - s * up  # length times the gradient of sin phi
    return np.asarray(GM / length**2 * (-radial * up + along * pole))


def cross(a: Array, b: Array) -> Array:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def slope(y: Array, force_b: Array, rate_b: Array) -> Array:
    """Of position, velocity and the columns of the attitude, all in the Earth-fixed frame."""
    r, v, c = y[:3], y[3:6], y[6:].reshape(3, 3)
    dv = c @ force_b + gravitation(r) - cross(RATE_E, cross(RATE_E, r)) - 2.0 * cross(RATE_E, v)
    wx, wy, wz = (rate_b - c.T @ RATE_E).tolist()
    dc = c @ np.array([[0.0, -wz, wy], [wz, 0.0, -wx], [-wy, wx, 0.0]])
    return np.concatenate((v, dv, dc.ravel()))


def stepped(y: Array, force_b: Array, rate_b: Array, step_s: float) -> Array:
    """One step of the classical Runge-Kutta method; samples (3, 3) at its begin, middle and end."""
    k1 = slope(y, force_b[0], rate_b[0])
    k2 = slope(y + 0.5 * step_s * k1, force_b[1], rate_b[1])
    k3 = slope(y + 0.5 * step_s * k2, force_b[1], rate_b[1])
    k4 = slope(y + step_s * k3, force_b[2], rate_b[2])
    return y + step_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def integrate(trajectory: Trajectory, end_s: float, step_s: float) -> Array:
    """The state at the end, from ideal samples."""
    count = round(end_s / step_s)
    inertial_samples = ideal_samples(trajectory.at(np.arange(2.0 * count + 1.0) * np.float64(0.5 * step_s)))
    y = initial(trajectory)
    for k in range(0, 2 * count, 2):
        y = stepped(y, inertial_samples.accel_b[k : k + 3], inertial_samples.gyro_b[k : k + 3], step_s)
    return y


def initial(trajectory: Trajectory) -> Array:
    m = trajectory.at(np.zeros(1))
    to_e = axes(m.lat[0], m.lon[0])
    attitude = to_e @ body_axes(*m.rpy[0].tolist())
    return np.concatenate((ecef(m.lat[0], m.lon[0], m.alt[0]), to_e @ m.vel_n[0], attitude.ravel()))


def test_gravity_is_that_of_the_normal_field() -> None:
    """Zonal harmonics and centrifugal part, 0 to 5 km: within 2e-6 m/s^2, 0.2 mGal."""
    for lat in np.deg2rad([-80.0, -35.0, 0.0, 20.0, 45.0, 60.0]):
        for alt in (0.0, 1500.0, 5000.0):
            r = ecef(lat, 0.7, alt)
            expected = axes(lat, 0.7).T @ (gravitation(r) - cross(RATE_E, cross(RATE_E, r)))
            assert gravity_n(np.array([lat]), np.array([alt]))[0] == pytest.approx(expected, abs=2e-6)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_ideal_samples_integrate_to_the_true_motion(seed: int) -> None:
    """Legs, climbs and turns, 400 s: position within 5 cm, velocity within 1 mm/s, attitude within 1e-6 rad."""
    rng = np.random.default_rng(seed)
    place = tuple(np.deg2rad(rng.uniform((-60.0, -150.0), (60.0, 150.0))).tolist())
    trajectory = Trajectory(draw_course(rng, place, (300.0, 3000.0), (130.0, 450.0)), 450.0)
    end_s = 400.0
    y = integrate(trajectory, end_s, 0.04)
    m = trajectory.at(np.array([end_s]))
    motion = trajectory.at(np.arange(0.0, end_s))
    assert np.ptp(motion.rpy[:, 0]) > 0.4 and np.ptp(motion.vel_n[:, 2]) > 1.0
    to_e = axes(m.lat[0], m.lon[0])
    assert np.linalg.norm(y[:3] - ecef(m.lat[0], m.lon[0], m.alt[0])) < 0.05
    assert np.linalg.norm(to_e.T @ y[3:6] - m.vel_n[0]) < 1e-3
    assert np.abs(y[6:].reshape(3, 3) - to_e @ body_axes(*m.rpy[0].tolist())).max() < 1e-6


def straight(lat: float, speed: float) -> Course:
    level = SmoothProfile([0.0, 1.0], [0.0, 0.0])
    return Course(SmoothProfile([0.0, 1.0], [speed, speed]), level, level, (lat, 0.2, 1000.0), 0.6, 0.05, 0.02)


def test_a_bias_of_an_accelerometer_makes_a_schuler_oscillation() -> None:
    """East error b / w^2 (1 - cos w t), w^2 = g / R: the peak within 5 %, near zero again after 84.4 min."""
    period_s, step_s, bias = 2.0 * math.pi * math.sqrt(6_371_000.0 / 9.8), 4.0, 1e-3
    trajectory = Trajectory(straight(0.0, 1.0), period_s + 10.0)
    m0 = trajectory.at(np.zeros(1))
    bias_b = body_axes(*m0.rpy[0].tolist()).T @ np.array([0.0, bias, 0.0])
    lengths = distances_with_held_height(trajectory, period_s, step_s, bias_b)
    peak = 2.0 * bias * 6_371_000.0 / 9.8
    assert max(lengths) == pytest.approx(peak, rel=0.05)
    assert np.argmax(lengths) * step_s == pytest.approx(0.5 * period_s, rel=0.05)
    assert lengths[-1] < 0.15 * peak


def distances_with_held_height(trajectory: Trajectory, end_s: float, step_s: float, bias_b: Array) -> list[float]:
    """Horizontal distance from the truth; the height is held at the true one, for alone it diverges."""
    count = round(end_s / step_s)
    inertial_samples = ideal_samples(trajectory.at(np.arange(2.0 * count + 1.0) * np.float64(0.5 * step_s)))
    truth = trajectory.at(np.arange(count + 1.0) * np.float64(step_s))
    force, y, distances = inertial_samples.accel_b + bias_b, initial(trajectory), []
    for k in range(count):
        y = stepped(y, force[2 * k : 2 * k + 3], inertial_samples.gyro_b[2 * k : 2 * k + 3], step_s)
        true = ecef(truth.lat[k + 1], truth.lon[k + 1], truth.alt[k + 1])
        up = true / np.linalg.norm(true)
        direction = y[:3] / np.linalg.norm(y[:3])
        y[:3] = direction * np.linalg.norm(true)
        y[3:6] -= direction * (direction @ y[3:6])
        distances.append(float(np.linalg.norm(true) * np.linalg.norm(direction - up)))
    return distances


def test_position_between_grid_points_moves_with_the_velocity() -> None:
    """Central differences over 2 ms off the grid: within 2 mm/s of the velocity."""
    trajectory = Trajectory(draw_course(np.random.default_rng(5), (0.8, 0.2), (300.0, 900.0), (130.0, 300.0)), 300.0)
    t = np.random.default_rng(6).uniform(1.0, 290.0, 200)
    before, after, m = trajectory.at(t - 0.001), trajectory.at(t + 0.001), trajectory.at(t)
    for k in range(len(t)):
        moved = ecef(after.lat[k], after.lon[k], after.alt[k]) - ecef(before.lat[k], before.lon[k], before.alt[k])
        assert axes(m.lat[k], m.lon[k]).T @ moved / 0.002 == pytest.approx(m.vel_n[k], abs=2e-3)


def test_displacement_is_in_metres() -> None:
    """100 m north, -50 m east, 7 m down at 55 deg and 3000 m: within 5 mm of the Earth-fixed difference."""
    by = np.array([[100.0, -50.0, 7.0]])
    lat, lon, alt = displace(np.array([0.96]), np.array([1.2]), np.array([3000.0]), by)
    moved = ecef(lat[0], lon[0], alt[0]) - ecef(0.96, 1.2, 3000.0)
    assert axes(0.96, 1.2).T @ moved == pytest.approx(by[0], abs=5e-3)
