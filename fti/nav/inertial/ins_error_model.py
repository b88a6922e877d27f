"""Error dynamics of inertial navigation in the earth frame, and error model of the inertial unit.

The error is truth minus estimate; the attitude's is a small turn in e: mat_eb = (1 + psi x) mat_eb_estimated.

    d(pos)/dt = vel
    d(vel)/dt = G pos - 2 omega_ie x vel - f_e x psi - mat_eb (bias_a + noise_a)
    d(psi)/dt =                          - omega_ie x psi - mat_eb (bias_g + noise_g)
    d(bias)/dt = -bias / period + noise,          G = g / R (3 d d^T - 1),  d down

The e frame has no singularities at the poles or the date line.  G neglects rotation and flattening in the gradient
(0.5 %).  Scale and alignment errors are not states: they are treated as noise of density (scale |w|)^2
``MANOEUVRE_S``, because the effect of one turn cancels in the opposite turn.  Of the force, only the part beyond
straight and level flight is treated so: the constant part is a bias.  With nine states the biases are noise, too, of
density bias_sd^2 ``MANOEUVRE_S``: position fixes must come more often than that.

Source: Groves 2013, section 14.2.3 (earth frame); the turn is that of the true frame, so the signs of psi differ.
Checked against: differences of two strapdowns, tests/nav/test_ins_error_model.py.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.constants import FOOT, STANDARD_GRAVITY
from fti.geodesy.formulas import EARTH_RATE
from fti.kernel import kernel

#: Duration of a turn, in which a scale error accumulates [s].
MANOEUVRE_S = 20.0
#: Rows and columns of the errors: position, velocity, turn, accelerometer biases, gyro biases.
POS, VEL, TURN, ACCEL, GYRO, BIASED = 0, 3, 6, 9, 12, 15
GRAVITY, RADIUS = 9.8, 6.371e6


@dataclass(frozen=True, slots=True)
class TriadErrorModel:
    """Three like axes.  unit : m/s^2 or rad/s.

    white     : density of the white noise [unit / sqrt(Hz)]
    bias_sd   : steady-state sigma of the bias [unit];  period_s : its correlation time [s]
    scale     : error of scale and alignment together, relative to the measured value [1]
    """

    white: float
    bias_sd: float
    period_s: float = 3600.0
    scale: float = 0.0


@dataclass(frozen=True)
class ImuErrorModel:
    """One inertial measurement unit: data sheet values of accelerometers and gyros."""

    accel: TriadErrorModel
    gyro: TriadErrorModel

    @functools.cached_property
    def table(self) -> Array:
        """For the kernels: rows accelerometers and gyros; columns white, bias_sd, period_s, scale."""
        return np.array([[t.white, t.bias_sd, t.period_s, t.scale] for t in (self.accel, self.gyro)])


_DEG = np.pi / 180.0
_DEG_H, _ROOT_H = _DEG / 3600.0, 1.0 / 60.0
_MILLI_G = 1e-3 * STANDARD_GRAVITY

#: Filter models of the grades of ``fti.hil.sensors.imu_grades``: turn-on bias, in-run bias and scale x g combined.
IMU_ERROR_MODELS: dict[str, ImuErrorModel] = {
    "navigation": ImuErrorModel(
        accel=TriadErrorModel(white=0.003 * _ROOT_H, bias_sd=0.11 * _MILLI_G, scale=105e-6),
        gyro=TriadErrorModel(white=0.002 * _DEG * _ROOT_H, bias_sd=0.0046 * _DEG_H, scale=23e-6),
    ),
    "tactical": ImuErrorModel(
        accel=TriadErrorModel(white=0.065 * FOOT * _ROOT_H, bias_sd=1.2 * _MILLI_G, scale=0.6e-3),
        gyro=TriadErrorModel(white=0.125 * _DEG * _ROOT_H, bias_sd=1.2 * _DEG_H, scale=0.54e-3),
    ),
    "mems": ImuErrorModel(
        accel=TriadErrorModel(white=0.09 * _ROOT_H, bias_sd=25.0 * _MILLI_G, scale=0.02),
        gyro=TriadErrorModel(white=0.17 * _DEG * _ROOT_H, bias_sd=0.5 * _DEG, scale=0.02),
    ),
}


@kernel
def rates(mat_eb: Array, force_e: Array, down_e: Array, biased: bool) -> Array:
    """F of the equations above but for the decay of the biases: shape (9, 15), or (9, 9) when not ``biased``.

    mat_eb : (3, 3);  force_e : specific force (3,) [m/s^2];  down_e : unit vector (3,)
    """
    result = np.zeros((9, BIASED if biased else ACCEL))
    for i in range(3):
        result[POS + i, VEL + i] = 1.0
        for j in range(3):
            result[VEL + i, POS + j] = GRAVITY / RADIUS * 3.0 * down_e[i] * down_e[j]
            if biased:
                result[VEL + i, ACCEL + j] = -mat_eb[i, j]
                result[TURN + i, GYRO + j] = -mat_eb[i, j]
        result[VEL + i, POS + i] -= GRAVITY / RADIUS
    result[VEL, VEL + 1], result[VEL + 1, VEL] = 2.0 * EARTH_RATE, -2.0 * EARTH_RATE
    result[TURN, TURN + 1], result[TURN + 1, TURN] = EARTH_RATE, -EARTH_RATE
    x, y, z = force_e[0], force_e[1], force_e[2]
    result[VEL, TURN + 1], result[VEL, TURN + 2] = z, -y
    result[VEL + 1, TURN], result[VEL + 1, TURN + 2] = -z, x
    result[VEL + 2, TURN], result[VEL + 2, TURN + 1] = y, -x
    return result


@kernel
def transition(F: Array, step: float) -> Array:
    """1 + F T + (F T)^2 / 2, of the same shape: its first nine rows."""
    n, m = F.shape
    result, twice = np.zeros((n, m)), np.zeros((n, m))
    for i in range(n):
        for k in range(n):  # along the rows, so that it is vectorised
            for j in range(m):
                twice[i, j] += F[i, k] * F[k, j]
    for i in range(n):
        result[i, i] = 1.0
        for j in range(m):
            result[i, j] += step * F[i, j] + 0.5 * step * step * twice[i, j]
    return result


@kernel
def noise(unit: Array, force_b: Array, rate_b: Array, biased: bool) -> tuple[float, float]:
    """Noise densities of velocity, turn [m^2/s^3, rad^2/s].  unit : ``ImuErrorModel.table``; force_b, rate_b : (3,)"""
    force = force_b[0] ** 2 + force_b[1] ** 2 + (force_b[2] + GRAVITY) ** 2
    rate = rate_b[0] ** 2 + rate_b[1] ** 2 + rate_b[2] ** 2
    accel = unit[0, 0] ** 2 + unit[0, 3] ** 2 * force * MANOEUVRE_S
    gyro = unit[1, 0] ** 2 + unit[1, 3] ** 2 * rate * MANOEUVRE_S
    if not biased:
        accel += unit[0, 1] ** 2 * MANOEUVRE_S
        gyro += unit[1, 1] ** 2 * MANOEUVRE_S
    return accel, gyro
