"""A free inertial navigation system: a strapdown with the samples of its erroneous unit and a baro-aided height.

The horizontal solution is not aided: its errors oscillate with Schuler's period, 84.4 min, and grow as in theory:

    accelerometer bias b    b / w^2 (1 - cos w t)             gyro drift e    R e (t - sin w t / w)
    velocity error v        v / w sin w t                     tilt a          R a (1 - cos w t)          w = sqrt(g / R)

The vertical channel of a free inertial system diverges, by a factor of e in 9.5 min.  A third-order loop with the
barometric height stabilises it, with three poles at 1 / ``TAU_S``:

    dh/dt = v - k1 (h - h_b)    dv/dt = f - g - k2 (h - h_b) - a    da/dt = k3 (h - h_b)
    k1 = 3 / tau    k2 = 3 / tau^2 + 2 g / R    k3 = 1 / tau^3

Source: Titterton and Weston 2004, section 12.3 (propagation of errors); Widnall and Sinha 1980, Optimizing the gains of
the baro-inertial vertical channel, J. Guidance and Control 3, 172-178.  A tau of 100 s is usual.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.geodesy.quaternions import mat_from_quat, quat_from_mat
from fti.geodesy.rotations import mat_en, mat_from_rpy, rpy_from_mat
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.hil.flight.trajectory import FlightState, earth_frame_velocity
from fti.nav.inertial.strapdown import POINTS, Motion, integrate

TAU_S = 100.0
EARTH_RADIUS, GRAVITY = 6.371e6, 9.81
SCHULER = math.sqrt(GRAVITY / EARTH_RADIUS)
K1, K2, K3 = 3.0 / TAU_S, 3.0 / TAU_S**2 + 2.0 * GRAVITY / EARTH_RADIUS, 1.0 / TAU_S**3
#: Interval of the height corrections [s].
HOLD_S = 1.0


@dataclass(frozen=True, eq=False)
class InertialSolution:
    """Solution of a system at n times: lat, lon [rad], alt [m], shape (n,); vel_n [m/s], rpy [rad], shape (n, 3)."""

    lat: Array
    lon: Array
    alt: Array
    vel_n: Array
    rpy: Array

    def at(self, k: int) -> InertialSolution:
        """Sample k, with shapes (1,) and (1, 3)."""
        return InertialSolution(*(values[k : k + 1] for values in (self.lat, self.lon, self.alt, self.vel_n, self.rpy)))

    def motion(self) -> Motion:
        """The first sample in the earth frame."""
        mat = mat_en(self.lat[0], self.lon[0])
        return Motion(
            ecef_from_geodetic(self.lat[0], self.lon[0], self.alt[0]),
            mat @ self.vel_n[0],
            quat_from_mat(mat @ mat_from_rpy(*self.rpy[0])),
        )


def true_motion(state: FlightState) -> Motion:
    """Motion of a flight at its samples."""
    mat_eb = mat_en(state.lat, state.lon) @ mat_from_rpy(state.roll, state.pitch, state.heading)
    return Motion(
        ecef_from_geodetic(state.lat, state.lon, state.alt), earth_frame_velocity(state), quat_from_mat(mat_eb)
    )


def solution_of(motion: Motion) -> InertialSolution:
    """Inverse of ``InertialSolution.motion``, for many samples."""
    lat, lon, alt = geodetic_from_ecef(motion.pos_e)
    mat_ne = np.swapaxes(mat_en(lat, lon), -1, -2)
    quat_eb = motion.quat_eb / np.linalg.norm(motion.quat_eb, axis=1, keepdims=True)
    rpy = np.stack(rpy_from_mat(mat_ne @ mat_from_quat(quat_eb)), axis=1)
    return InertialSolution(lat, lon, alt, np.einsum("nij,nj->ni", mat_ne, motion.vel_e), rpy)


def run_free(
    start: InertialSolution, force_b: Array, rate_b: Array, *, step: float, baro: Array, known: float = 0.0
) -> InertialSolution:
    """Free inertial navigation with baro-aided height.

    start   : solution at the first sample of the unit
    force_b : specific force [m/s^2] and rate_b : turn rate [rad/s] at equal steps [s], shape (n, 3)
    baro    : barometric height above the ellipsoid [m], shape (n,)
    known   : vertical error of the accelerometers, down [m/s^2], that the aided system has estimated
    Returns : solution at all n samples.  Raises ValueError for fewer than six.
    """
    motion, parts, integral, correction = start.motion(), [start.motion()], -known, known
    edges = _edges(len(force_b), max(round(HOLD_S / step), POINTS - 1))
    for begin, end in pairwise(edges):
        here = slice(begin, end + 1)
        piece = integrate(motion, force_b[here] + correction * _up_b(motion), rate_b[here], step)
        parts.append(Motion(piece.pos_e[1:], piece.vel_e[1:], piece.quat_eb[1:]))
        seconds, (up_e, alt) = step * (end - begin), _up_e(piece.pos_e[-1])
        error = alt - float(baro[end])
        integral += K3 * error * seconds
        correction = -K2 * error - integral
        motion = Motion(piece.pos_e[-1] - K1 * error * seconds * up_e, piece.vel_e[-1], piece.quat_eb[-1])
    rows = [(np.atleast_2d(m.pos_e), np.atleast_2d(m.vel_e), np.atleast_2d(m.quat_eb)) for m in parts]
    return solution_of(Motion(*(np.concatenate(columns) for columns in zip(*rows, strict=True))))


def _edges(samples: int, hold: int) -> list[int]:
    """Samples at the edges of the pieces between height corrections; the last piece contains the remainder."""
    return [hold * i for i in range(max((samples - 1) // hold, 1))] + [samples - 1]


def _up_e(pos_e: Array) -> tuple[Array, float]:
    """Unit vector upwards, shape (3,), and height [m] of a position."""
    lat, lon, alt = geodetic_from_ecef(pos_e)
    return -mat_en(lat, lon)[:, 2], float(alt)


def _up_b(motion: Motion) -> Array:
    """Unit vector upwards in body axes, shape (3,)."""
    quat = motion.quat_eb / np.linalg.norm(motion.quat_eb)
    return np.asarray(mat_from_quat(quat).T @ _up_e(motion.pos_e)[0])


class DriftSigmas(NamedTuple):
    """One sigma of the errors at the loss of the last fix: accelerometer bias and its in-run instability [m/s^2], gyro
    bias [rad/s], tilt and heading [rad], velocity [m/s], position and height [m]."""

    accel: float
    in_run: float
    gyro: float
    tilt: float
    heading: float
    velocity: float
    position: float
    height: float


def drift_sd(since: Array, sigmas: DriftSigmas) -> tuple[Array, Array]:
    """One sigma of each horizontal axis, position [m] and velocity [m/s], ``since`` the last fix, shape (n,) [s].

    The four terms of the module docstring; effects of heading errors in turns and of white noise are neglected.
    """
    w, sin, swing = SCHULER, np.sin(SCHULER * since), 1.0 - np.cos(SCHULER * since)
    bias, level, drift = sigmas.accel / w**2, EARTH_RADIUS * sigmas.tilt, EARTH_RADIUS * sigmas.gyro
    position = (sigmas.velocity / w * sin, level * swing, bias * swing, drift * (since - sin / w))
    velocity = (sigmas.velocity * (1.0 - swing), level * w * sin, bias * w * sin, drift * swing)
    return np.hypot(sigmas.position, np.linalg.norm(position, axis=0)), np.asarray(np.linalg.norm(velocity, axis=0))
