"""Observation models of position and velocity of an antenna, compiled: z, H and R of ``fti.nav.filter.aiding``.

They are evaluated for the filter and for each of its copies.
Checked against: tests/nav/test_filter_aiding.py.
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import EARTH_RATE, SEMI_MAJOR, Vector, cross, ecef_from_geodetic, rotate, rotate_back
from fti.geodesy.rotations import rows_of
from fti.kernel import kernel
from fti.nav.filter.kernels import EXTRAS, GYRO_BIAS, axes, geodetic, matrix
from fti.nav.inertial.ins_error_model import GYRO, POS, TURN, VEL

Matrices = tuple[Array, Array, Array]


@kernel
def position(y: Array, geodetic_pos: Vector, arm_b: Vector, sds: Vector, rows: int, size: int) -> Matrices:  # noqa: PLR0917
    """z = mat_ne (x_measured - x - mat_eb arm), in north, east, down.

    y     : an estimate's row;  geodetic_pos : measured lat, lon [rad], alt [m];  arm_b : P to the antenna [m]
    sds   : north, east, down [m];  rows : 3, or 2 without the height (the height of the estimate is used)
    size  : number of states
    """
    own_lat, own_lon, own_alt = geodetic(y)
    mat_en = axes(own_lat, own_lon)
    measured_e = ecef_from_geodetic(geodetic_pos[0], geodetic_pos[1], geodetic_pos[2] if rows == 3 else own_alt)
    arm_e = rotate(rows_of(matrix(y)), arm_b)
    z, H, R = np.zeros(rows), np.zeros((rows, size)), np.zeros((rows, rows))
    for i in range(rows):
        for j in range(3):
            z[i] += mat_en[j, i] * (measured_e[j] - y[j] - arm_e[j])
            H[i, POS + j] = mat_en[j, i]
        _enter_cross(H[i], TURN, arm_e, (mat_en[0, i], mat_en[1, i], mat_en[2, i]))
        R[i, i] = sds[i] ** 2
    return z, H, R


@kernel
def velocity(  # noqa: PLR0917
    y: Array, imu: Array, vel_n: Vector, arm_b: Vector, sd: float, rows: int, size: int, biased: bool
) -> Matrices:
    """z = v_measured - mat_ne (v + mat_eb (omega_eb x arm)).

    y, imu  : of an estimate;  vel_n : north, east, down as measured [m/s];  arm_b : P to the antenna [m]
    sd      : of each axis [m/s];  rows : 3, or 2 without the vertical;  size : number of states
    biased  : whether gyro biases are states
    """
    own_lat, own_lon, _ = geodetic(y)
    mat_en, mat_eb = axes(own_lat, own_lon), matrix(y)
    rate_b = _rate_eb_b(y, imu, mat_eb)
    rotation_e = rotate(rows_of(mat_eb), cross(rate_b, arm_b))
    z, H, R = np.zeros(rows), np.zeros((rows, size)), np.zeros((rows, rows))
    for i in range(rows):
        axis_e = (mat_en[0, i], mat_en[1, i], mat_en[2, i])
        z[i] = vel_n[i]
        for j in range(3):
            z[i] -= axis_e[j] * (y[3 + j] + rotation_e[j])
            H[i, VEL + j] = axis_e[j]
        _enter_cross(H[i], TURN, rotation_e, axis_e)
        if biased:
            _enter_cross(H[i], GYRO, rotate_back(rows_of(mat_eb), axis_e), arm_b)
        R[i, i] = sd**2
    return z, H, R


@kernel
def _rate_eb_b(y: Array, imu: Array, mat_eb: Array) -> Vector:
    """Turn rate of the body relative to the Earth [rad/s]."""
    rate = imu[3:] - y[GYRO_BIAS:EXTRAS] - EARTH_RATE * mat_eb[2]
    return rate[0], rate[1], rate[2]


@kernel
def _enter_cross(row: Array, at: int, a: Vector, b: Vector) -> None:
    """A x b into three columns."""
    row[at], row[at + 1], row[at + 2] = cross(a, b)


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    y, v = np.array([SEMI_MAJOR, *np.zeros(15)]), (0.0, 0.0, 0.0)
    position(y, v, v, v, 3, 15)
    velocity(y, np.zeros(6), v, v, 1.0, 3, 15, True)
