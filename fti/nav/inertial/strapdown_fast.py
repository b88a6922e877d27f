"""Fast strapdown for live use: one evaluation per step, with any step lengths.

With w and f at the ends of a step T, second derivatives w'' and f'' from the sample before, and linear interpolation
in the terms of second order,

    turn      theta = T (w1 + w2) / 2 - T^3 w'' / 12 + T^2 (w1 x w2) / 12                        coning
    velocity  dv_b  = T (f1 + f2) / 2 - T^3 f'' / 12 + integral of alpha x f + T^3 w x (w x f) / 6   sculling
    earth     q_eb <- q(-omega_ie T) q_eb q(theta)
              v_e  <- v_e + (1 - omega_ie T / 2 x) mat_eb dv_b + T (g_e - 2 omega_ie x v_e) in the middle of the step

Position is integrated by the trapezoidal rule.  Unlike ``fti.nav.inertial.strapdown`` it needs no samples after the
step, and takes a fifth of the time; for an hour without aiding use the other one.

Source: Savage 1998, J. Guid. Control Dyn. 21, parts 1 and 2 (coning and sculling of rates that are straight lines);
Groves 2013, section 5.3 (earth frame).  Checked against: the high-order strapdown and flights that are splines
(``fti study strapdown``), tests/nav/test_strapdown_fast.py.
"""

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import EARTH_RATE, SEMI_MAJOR, cross, normalised, quat_from_turn, quat_product, rotate_by_quat
from fti.kernel import kernel
from fti.nav.inertial.strapdown import Motion, gravity_e


def integrate_fast(start: Motion, accel_b: Array, gyro_b: Array, step: float, every: int = 1) -> Motion:
    """Free inertial navigation like ``fti.nav.inertial.strapdown.integrate``, in the fast form.

    start   : at the first sample
    accel_b : ndarray, shape (n, 3) [m/s^2];  gyro_b : ndarray, shape (n, 3) [rad/s], at the samples
    step    : between two samples [s];  every : one of so many samples is returned
    Raises ValueError for arrays of other shapes.
    """
    sensors = np.concatenate((accel_b, gyro_b), axis=1)
    if accel_b.shape != gyro_b.shape or sensors.shape[1] != 6:
        raise ValueError(f"shapes must be (n, 3), not {accel_b.shape} and {gyro_b.shape}")
    result = _integrate(np.concatenate((start.pos_e, start.vel_e, start.quat_eb)), sensors, step, every)
    return Motion(result[:, :3], result[:, 3:6], result[:, 6:])


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    still, here = np.zeros((2, 3)), np.array([SEMI_MAJOR, 0.0, 0.0])
    integrate_fast(Motion(here, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])), still, still, 0.01)


@kernel
def _integrate(first: Array, sensors: Array, step: float, every: int) -> Array:
    n = len(sensors) - 1
    result = np.empty((n // every + 1, 10))
    y, bend = first.copy(), np.zeros(6)
    result[0] = y
    for k in range(n):
        middle = min(max(k, 1), n - 1)
        if middle:
            bend[:] = (sensors[middle + 1] - 2.0 * sensors[middle] + sensors[middle - 1]) / step**2
        move(y, sensors[k], sensors[k + 1], bend, step)
        if (k + 1) % every == 0:
            result[(k + 1) // every] = y
    return result


@kernel
def move(y: Array, first: Array, last: Array, bend: Array, step: float) -> None:
    """One step, in place.

    y           : ndarray, shape (>= 10,)   pos_e [m], vel_e [m/s], quat_eb; further values are unchanged
    first, last : ndarray, shape (6,)       accel_b [m/s^2] and gyro_b [rad/s] at the beginning and end of the step
    bend        : ndarray, shape (6,)       their second derivatives [1/s^2], zeros where unknown
    step        : [s]
    """
    ax, ay, az = _increment(first, last, bend, step)
    ex, ey, ez = rotate_by_quat((y[6], y[7], y[8], y[9]), (ax, ay, az))
    lean = 0.5 * EARTH_RATE * step
    ex, ey = ex + lean * ey, ey - lean * ex
    gx, gy, gz = gravity_e(y[0] + 0.5 * step * y[3], y[1] + 0.5 * step * y[4], y[2] + 0.5 * step * y[5])
    coriolis = 2.0 * EARTH_RATE
    mx = y[3] + 0.5 * (ex + step * (gx + coriolis * y[4]))
    my = y[4] + 0.5 * (ey + step * (gy - coriolis * y[3]))
    dx, dy, dz = ex + step * (gx + coriolis * my), ey + step * (gy - coriolis * mx), ez + step * gz
    y[0] += step * (y[3] + 0.5 * dx)
    y[1] += step * (y[4] + 0.5 * dy)
    y[2] += step * (y[5] + 0.5 * dz)
    y[3] += dx
    y[4] += dy
    y[5] += dz
    _turn(y, first, last, bend, step)


@kernel
def _increment(first: Array, last: Array, bend: Array, step: float) -> tuple[float, float, float]:
    """Integral of the specific force over the step, in body axes at its beginning [m/s]."""
    force, turn = (first[0], first[1], first[2]), (first[3], first[4], first[5])
    more_force = last[0] - first[0], last[1] - first[1], last[2] - first[2]
    more_turn = last[3] - first[3], last[4] - first[4], last[5] - first[5]
    mean_force = 0.5 * (first[0] + last[0]), 0.5 * (first[1] + last[1]), 0.5 * (first[2] + last[2])
    mean_turn = 0.5 * (first[3] + last[3]), 0.5 * (first[4] + last[4]), 0.5 * (first[5] + last[5])
    # alpha = w1 t + dw t^2 / 2T, f = f1 + df t / T: the integral of alpha x f term by term
    a, b = cross(turn, force), cross(turn, more_force)
    c, d = cross(more_turn, force), cross(more_turn, more_force)
    e = cross(mean_turn, cross(mean_turn, mean_force))
    s2, s3 = step * step, step * step * step / 6.0
    return (
        step * mean_force[0] + s2 * (a[0] / 2.0 + b[0] / 3.0 + c[0] / 6.0 + d[0] / 8.0) + s3 * (e[0] - 0.5 * bend[0]),
        step * mean_force[1] + s2 * (a[1] / 2.0 + b[1] / 3.0 + c[1] / 6.0 + d[1] / 8.0) + s3 * (e[1] - 0.5 * bend[1]),
        step * mean_force[2] + s2 * (a[2] / 2.0 + b[2] / 3.0 + c[2] / 6.0 + d[2] / 8.0) + s3 * (e[2] - 0.5 * bend[2]),
    )


@kernel
def _turn(y: Array, first: Array, last: Array, bend: Array, step: float) -> None:
    """q(-omega_ie T) q_eb q(theta), normalised."""
    c0, c1, c2 = cross((first[3], first[4], first[5]), (last[3], last[4], last[5]))
    t0 = 0.5 * step * (first[3] + last[3]) + step * step * (c0 - step * bend[3]) / 12.0
    t1 = 0.5 * step * (first[4] + last[4]) + step * step * (c1 - step * bend[4]) / 12.0
    t2 = 0.5 * step * (first[5] + last[5]) + step * step * (c2 - step * bend[5]) / 12.0
    w, x, v, z = quat_product((y[6], y[7], y[8], y[9]), quat_from_turn(t0, t1, t2))
    e, h = math.cos(0.5 * EARTH_RATE * step), math.sin(0.5 * EARTH_RATE * step)
    y[6], y[7], y[8], y[9] = normalised(e * w + h * z, e * x + h * v, e * v - h * x, e * z - h * w)
