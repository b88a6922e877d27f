"""Strapdown navigation: from specific force and turn rate to attitude, velocity and position, in the earth frame.

    dq_eb/dt = 1/2 q_eb (0, omega_ib_b) - 1/2 (0, omega_ie_e) q_eb
    dv_e/dt  = mat_eb f_b + g_e(x_e) - 2 omega_ie_e x v_e
    dx_e/dt  = v_e

    g_e   normal gravity: Somigliana's formula and the free-air gradient, down along the ellipsoid's normal

The earth frame has no singularity at the poles and needs no transport rate.

The integration is classic Runge-Kutta of fourth order.  For the half step the sensors are interpolated with six samples
(fifth order).  Increments are added with compensated summation (Kahan 1965), because an hour at 100 Hz is 360 000
additions of millimetres to 6.4e6 m, with a rounding of 1e-9 m each.  The attitude quaternion is never normalised; its
length cancels in the matrix.

Free inertial navigation: the vertical channel is unstable, an error of height grows e-fold in 9.5 min (sqrt(R / 2 g)),
280-fold in an hour.  Ideal sensors are assumed: sensor errors are corrected elsewhere.

Source: Spiegel 2018, eq. 7.2 and 7.3, in e; Titterton and Weston 2004, section 3.5.2 (earth frame mechanisation).
Checked against: the flights of ``fti.hil.flight``, which are splines (``fti study trajectory``, T12); scipy's DOP853 on
the equations in n; tests/nav/test_strapdown.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import EARTH_RATE, SEMI_MAJOR, normal_at, normal_gravity, rotate_by_quat
from fti.kernel import kernel

#: Steps of Bowring's iteration for the latitude: 1e-9 m between sea and 20 km.
BOWRING_STEPS = 2
#: Samples of the interpolation to half a step; fewer cannot be integrated.
POINTS = 6
#: Rows of the memory of a step.
MEMORY = 7


@dataclass(frozen=True, eq=False)
class Motion:
    """Position, velocity and attitude, at one time or at many.

    pos_e   : ndarray, shape (..., 3) [m]     position, e frame
    vel_e   : ndarray, shape (..., 3) [m/s]   velocity against the Earth, e frame
    quat_eb : ndarray, shape (..., 4)         from b to e, w first, approximately of unit length
    """

    pos_e: Array
    vel_e: Array
    quat_eb: Array


def integrate(start: Motion, accel_b: Array, gyro_b: Array, step: float, every: int = 1) -> Motion:
    """Free inertial navigation from samples of ideal sensors.

    start   : at the first sample
    accel_b : ndarray, shape (n, 3) [m/s^2]   specific force at the samples (not its increments)
    gyro_b  : ndarray, shape (n, 3) [rad/s]   turn rate against inertial space at the samples
    step    : between two samples [s]
    every   : one of so many samples is returned
    Returns : at samples 0, every, 2 every ..., shapes (m, 3), (m, 3), (m, 4)
    Raises ValueError for fewer than six samples, or arrays of other shapes.
    """
    sensors = np.concatenate((accel_b, gyro_b), axis=1)
    if accel_b.shape != gyro_b.shape or sensors.shape[1] != 6 or len(sensors) < POINTS:
        raise ValueError(f"shapes must be (n, 3) with n >= {POINTS}, not {accel_b.shape} and {gyro_b.shape}")
    halves = np.empty((2 * len(sensors) - 1, 6))
    halves[::2], halves[1::2] = sensors, midpoints(sensors)
    result = _integrate(np.concatenate((start.pos_e, start.vel_e, start.quat_eb)), halves, step, every)
    return Motion(result[:, :3], result[:, 3:6], result[:, 6:])


def warm_up() -> None:
    """Compile the kernels, or load them from the cache (seconds on the first start)."""
    still = np.zeros((POINTS, 3))
    integrate(Motion(np.array([SEMI_MAJOR, 0.0, 0.0]), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])), still, still, 0.01)


def midpoints(samples: Array) -> Array:
    """Values half way between samples, shape (n - 1, d), of samples at equal steps, shape (n, d), n >= 6.

    The polynomial of degree 5 through the six nearest samples: 3 -25 150 150 -25 3 / 256, and one-sided at the ends.
    """
    n = len(samples)
    interval = np.arange(n - 1)
    first = np.clip(interval - POINTS // 2 + 1, 0, n - POINTS)
    weights = _lagrange()[interval - first]
    return np.asarray(sum(weights[:, j, None] * samples[first + j] for j in range(POINTS)))


def _lagrange() -> Array:
    """Row k: weights of the samples 0 to 5 at k + 1/2."""
    rows = np.ones((POINTS - 1, POINTS))
    for k in range(POINTS - 1):
        for j in range(POINTS):
            for i in range(POINTS):
                if i != j:
                    rows[k, j] *= (k + 0.5 - i) / (j - i)
    return rows


@kernel
def _integrate(first: Array, halves: Array, step: float, every: int) -> Array:
    n = len(halves) // 2
    result = np.empty((n // every + 1, 10))
    memory = np.zeros((MEMORY, 10))
    memory[0] = result[0] = first
    for k in range(n):
        advance(memory, halves[2 * k : 2 * k + 3], step)
        if (k + 1) % every == 0:
            result[(k + 1) // every] = memory[0]
    return result


@kernel
def advance(memory: Array, sensors: Array, step: float) -> None:
    """One step, in place.

    memory  : ndarray, shape (MEMORY, 10)   row 0: pos_e [m], vel_e [m/s], quat_eb; row 1: accumulated rounding error,
              zeros at the start; the others: work space with any content
    sensors : ndarray, shape (3, 6)   accel_b [m/s^2] and gyro_b [rad/s] at the start, middle and end of the step
    step    : [s]
    """
    y, rounding, stage = memory[0], memory[1], memory[2]
    k1, k2, k3, k4 = memory[3], memory[4], memory[5], memory[6]
    _rates(y, sensors[0], k1)
    _extrapolate(y, 0.5 * step, k1, stage)
    _rates(stage, sensors[1], k2)
    _extrapolate(y, 0.5 * step, k2, stage)
    _rates(stage, sensors[1], k3)
    _extrapolate(y, step, k3, stage)
    _rates(stage, sensors[2], k4)
    for i in range(10):
        added = step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) - rounding[i]
        after = y[i] + added
        rounding[i] = (after - y[i]) - added
        y[i] = after


@kernel
def _extrapolate(y: Array, step: float, rates: Array, into: Array) -> None:
    for i in range(10):
        into[i] = y[i] + step * rates[i]


@kernel
def _rates(y: Array, sensors: Array, rates: Array) -> None:
    """The three differential equations."""
    vx, vy = y[3], y[4]
    w, x, y_, z = y[6], y[7], y[8], y[9]
    fx, fy, fz = rotate_by_quat((w, x, y_, z), (sensors[0], sensors[1], sensors[2]))
    gx, gy, gz = gravity_e(y[0], y[1], y[2])
    rates[0], rates[1], rates[2] = y[3], y[4], y[5]
    rates[3] = fx + gx + 2.0 * EARTH_RATE * vy
    rates[4] = fy + gy - 2.0 * EARTH_RATE * vx
    rates[5] = fz + gz
    p, q, r = sensors[3], sensors[4], sensors[5]
    rates[6] = 0.5 * (-x * p - y_ * q - z * r + EARTH_RATE * z)
    rates[7] = 0.5 * (w * p + y_ * r - z * q + EARTH_RATE * y_)
    rates[8] = 0.5 * (w * q - x * r + z * p - EARTH_RATE * x)
    rates[9] = 0.5 * (w * r + x * q - y_ * p - EARTH_RATE * w)


@kernel
def gravity_e(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Normal gravity at x_e [m], e frame [m/s^2]."""
    across = np.hypot(x, y)
    sin_lat, cos_lat, alt = normal_at(across, z, BOWRING_STEPS)
    gravity = normal_gravity(sin_lat, alt)
    outwards = -gravity * cos_lat / across if across > 0.0 else 0.0
    return outwards * x, outwards * y, -gravity * sin_lat
