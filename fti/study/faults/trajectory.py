"""True motion of the aircraft, and ideal inertial measurements on it.

Speed, climb angle and rate of the track are profiles in time; velocity, its derivative and the attitude follow in
closed form, and the position by integration on a grid of 25 Hz.  Bank is that of a coordinated turn.
Source: Groves, 2nd edition, equations 2.111 (rates of latitude, longitude, height), 5.53 (velocity), 2.50, 5.43
(attitude), solved for specific force and angular rate.  Axes of the body: forward, right, down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.constants import STANDARD_GRAVITY
from fti.geodesy.formulas import EARTH_RATE, ECC_SQ, FLATTENING, SEMI_MAJOR, SEMI_MINOR
from fti.geodesy.gravity import transport_rate
from fti.geodesy.rotations import mat_from_rpy
from fti.geodesy.wgs84 import metres_per_radian, radii

GRID_S = 0.04
#: The latitude's radii depend on the latitude itself: an iteration reduces the error by a factor of 100 or more.
ITERATIONS = 5


class SmoothProfile:
    """Values at ascending times [s], joined by quintic steps S(x) = x^3 (10 - 15 x + 6 x^2); constant outside."""

    def __init__(self, times: list[float], values: list[float]) -> None:
        self._times, self._values = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
        self._spans, self._steps = np.diff(self._times), np.diff(self._values)
        areas = self._spans * (self._values[:-1] + 0.5 * self._steps)
        self._areas = np.concatenate(([0.0], np.cumsum(areas)))

    def _locate(self, t: Array) -> tuple[NDArray[np.intp], Array]:
        """Index of the span of each time, and the elapsed share of it."""
        k = np.clip(np.searchsorted(self._times, t, side="right") - 1, 0, len(self._spans) - 1)
        return k, np.clip((t - self._times[k]) / self._spans[k], 0.0, 1.0)

    def value(self, t: Array) -> Array:
        """At times (n,) [s]."""
        k, x = self._locate(t)
        return np.asarray(self._values[k] + self._steps[k] * x**3 * (10.0 + x * (6.0 * x - 15.0)))

    def slope(self, t: Array) -> Array:
        """Derivative by time."""
        k, x = self._locate(t)
        return np.asarray(self._steps[k] / self._spans[k] * 30.0 * (x * (1.0 - x)) ** 2)

    def integral(self, t: Array) -> Array:
        """Integral from the first time on; earlier times are not allowed."""
        k, x = self._locate(t)
        inside = self._values[k] * x + self._steps[k] * x**4 * (2.5 + x * (x - 3.0))
        beyond = np.maximum(t - self._times[-1], 0.0) * self._values[-1]
        return np.asarray(self._areas[k] + self._spans[k] * inside + beyond)


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """True state at times t (n,) [s].

    lat, lon [rad], alt above WGS 84 [m]; vel_n, accel_n (n, 3): north, east, down and its derivative;
    rpy, rpy_rate (n, 3): roll, pitch, heading [rad] and their derivatives
    """

    t: Array
    lat: Array
    lon: Array
    alt: Array
    vel_n: Array
    accel_n: Array
    rpy: Array
    rpy_rate: Array


@dataclass(frozen=True, eq=False)
class Course:
    """Definition of a flight.  speed [m/s], climb angle [rad], track_rate [rad/s] over time; start: lat, lon, alt.

    track: at the start [rad]; angle_of_attack, drift_angle (heading minus track): constant [rad]
    """

    speed: SmoothProfile
    climb: SmoothProfile
    track_rate: SmoothProfile
    start: tuple[float, float, float]
    track: float
    angle_of_attack: float
    drift_angle: float


class Trajectory:
    """True motion from 0 s to duration_s."""

    def __init__(self, course: Course, duration_s: float) -> None:
        self._course = course
        t: Array = GRID_S * np.arange(int(np.ceil(duration_s / GRID_S)) + 2, dtype=np.float64)
        vel_n, _ = self._velocity(t)
        lat0, lon0, alt0 = course.start
        alt = alt0 + _cumulative(-vel_n[:, 2])
        lat = np.full(len(t), lat0)
        for _ in range(ITERATIONS):
            lat = lat0 + _cumulative(vel_n[:, 0] / (radii(lat)[0] + alt))
        per_lat, per_lon = metres_per_radian(lat, alt)
        rates = np.stack((vel_n[:, 0] / per_lat, vel_n[:, 1] / per_lon, -vel_n[:, 2]), axis=1)
        self._position = np.stack((lat, lon0 + _cumulative(rates[:, 1]), alt), axis=1)
        self._rates = rates

    def _velocity(self, t: Array) -> tuple[Array, Array]:
        """Velocity and its derivative, north, east, down."""
        c = self._course
        speed, climb, track = c.speed.value(t), c.climb.value(t), c.track + c.track_rate.integral(t)
        dspeed, dclimb, dtrack = c.speed.slope(t), c.climb.slope(t), c.track_rate.value(t)
        level, dlevel = speed * np.cos(climb), dspeed * np.cos(climb) - speed * np.sin(climb) * dclimb
        vel = np.stack((level * np.cos(track), level * np.sin(track), -speed * np.sin(climb)), axis=1)
        accel = np.stack(
            (
                dlevel * np.cos(track) - vel[:, 1] * dtrack,
                dlevel * np.sin(track) + vel[:, 0] * dtrack,
                -dspeed * np.sin(climb) - level * dclimb,
            ),
            axis=1,
        )
        return vel, accel

    def _attitude(self, t: Array) -> tuple[Array, Array]:
        """Roll, pitch, heading and their derivatives: tan(roll) = level speed x track rate / g."""
        c = self._course
        speed, climb = c.speed.value(t), c.climb.value(t)
        dclimb, dtrack = c.climb.slope(t), c.track_rate.value(t)
        level = speed * np.cos(climb)
        dlevel = c.speed.slope(t) * np.cos(climb) - speed * np.sin(climb) * dclimb
        tan_roll = level * dtrack / STANDARD_GRAVITY
        droll = (dlevel * dtrack + level * c.track_rate.slope(t)) / STANDARD_GRAVITY / (1.0 + tan_roll**2)
        heading = c.track + c.drift_angle + c.track_rate.integral(t)
        rpy = np.stack((np.arctan(tan_roll), climb + c.angle_of_attack, heading), axis=1)
        return rpy, np.stack((droll, dclimb, dtrack), axis=1)

    def at(self, t: Array) -> TrueMotion:
        """True state at times (n,) [s] of the flight, in any order; the position by cubic Hermite interpolation."""
        t = np.asarray(t, dtype=float)
        k = np.clip((t / GRID_S).astype(int), 0, len(self._position) - 2)
        x = (t / GRID_S - k)[:, None]
        p0, p1 = self._position[k], self._position[k + 1]
        d0, d1 = GRID_S * self._rates[k], GRID_S * self._rates[k + 1]
        # differences before products: a longitude times a polynomial would lose digits
        place = p0 + (p1 - p0) * x**2 * (3.0 - 2.0 * x) + d0 * x * (1.0 - x) ** 2 + d1 * x**2 * (x - 1.0)
        vel_n, accel_n = self._velocity(t)
        rpy, rpy_rate = self._attitude(t)
        return TrueMotion(t, place[:, 0], place[:, 1], place[:, 2], vel_n, accel_n, rpy, rpy_rate)


def _cumulative(rate: Array) -> Array:
    """Integral over the grid by the trapezoidal rule: of a velocity within 1.4e-4 s^2 of its change of acceleration."""
    return np.concatenate(([0.0], np.cumsum(0.5 * GRID_S * (rate[:-1] + rate[1:]))))


def specific_force_b(m: TrueMotion, disturbance_n: Array | float = 0.0) -> Array:
    """Specific force (n, 3) [m/s^2]; disturbance_n: true gravity minus normal gravity."""
    rate_n = 2.0 * earth_rate_n(m.lat) + transport_rate(m.lat, m.alt, m.vel_n)
    force_n = m.accel_n + np.cross(rate_n, m.vel_n) - gravity_n(m.lat, m.alt) - disturbance_n
    return np.asarray(np.einsum("nij,ni->nj", mat_from_rpy(*m.rpy.T), force_n))


def angular_rate_b(m: TrueMotion) -> Array:
    """Angular rate against inertial space (n, 3) [rad/s]."""
    (roll, pitch, _), (droll, dpitch, dheading) = m.rpy.T, m.rpy_rate.T
    level = np.cos(pitch) * dheading
    against_n = np.stack(
        (
            droll - np.sin(pitch) * dheading,
            np.cos(roll) * dpitch + np.sin(roll) * level,
            np.cos(roll) * level - np.sin(roll) * dpitch,
        ),
        axis=1,
    )
    frame_n = earth_rate_n(m.lat) + transport_rate(m.lat, m.alt, m.vel_n)
    return np.asarray(against_n + np.einsum("nij,ni->nj", mat_from_rpy(*m.rpy.T), frame_n))


GM_M3_S2 = 3.986004418e14


def gravity_n(lat: Array, alt: Array) -> Array:
    """Normal gravity with the centrifugal part, north, east, down (n, 3) [m/s^2]; the product uses another form.

    Source: Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd edition (2013),
    equations 2.134, 2.139, 2.140.
    """
    sin2 = np.sin(lat) ** 2
    surface = 9.7803253359 * (1.0 + 0.001931853 * sin2) / np.sqrt(1.0 - ECC_SQ * sin2)
    m = EARTH_RATE**2 * SEMI_MAJOR**2 * SEMI_MINOR / GM_M3_S2
    linear = 2.0 / SEMI_MAJOR * (1.0 + FLATTENING * (1.0 - 2.0 * sin2) + m)
    down = surface * (1.0 - linear * alt + 3.0 / SEMI_MAJOR**2 * alt**2)
    return np.stack((-8.08e-9 * alt * np.sin(2.0 * lat), np.zeros_like(lat), down), axis=-1)


def earth_rate_n(lat: Array) -> Array:
    """Rotation of the Earth, north, east, down (n, 3) [rad/s]: equation 2.122 of Groves."""
    return EARTH_RATE * np.stack((np.cos(lat), np.zeros_like(lat), -np.sin(lat)), axis=-1)
