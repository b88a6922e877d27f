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

Without fixes for minutes (``for_outages``) the bias is that of the last start, with flicker noise of floor F, Allan
deviation.  White noise N and a random walk K stand for it, whose Allan variance is lowest at an averaging time t:

    N^2 / tau + K^2 tau / 3 >= m F^2:    N^2 = m F^2 t / 2,    K^2 = 3 m F^2 / (2 t)

t is the time for which a bias acts before other measurements correct its effect: ``HEADING_S`` for gyros,
``VELOCITY_S`` for accelerometers.  With m = 1 the integral has too large a variance at all times but t.

Scale and alignment of the gyros are states then (``error_states.outage_model``).

Source: Groves 2013, section 14.2.3 (earth frame); the turn is that of the true frame, so the signs of psi differ;
IEEE Std 952-1997, annex C (Allan deviation of the three noises).
Checked against: differences of two strapdowns, tests/nav/test_ins_error_model.py.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np

from fti.arrays import Array
from fti.constants import FOOT, STANDARD_GRAVITY
from fti.geodesy.formulas import EARTH_RATE
from fti.kernel import kernel

#: Duration of a turn, in which a scale error accumulates [s].
MANOEUVRE_S = 20.0
#: Time for which a bias acts [s]: of a gyro on the heading, which nothing corrects in 500 s without satellites, in the
#: geometric mean of 50 s and the whole; of an accelerometer on the velocity, which looks at the ground correct.
HEADING_S, VELOCITY_S = 150.0, 20.0
#: m: the integral over 50 to 500 s then has the sigma of that of flicker noise to 7 %.
FLICKER_MATCH = 0.83
#: Rows and columns of the errors: position, velocity, turn, accelerometer biases, gyro biases.
POS, VEL, TURN, ACCEL, GYRO, BIASED = 0, 3, 6, 9, 12, 15
GRAVITY, RADIUS = 9.8, 6.371e6


@dataclass(frozen=True, slots=True)
class TriadErrorModel:
    """Three like axes.  unit : m/s^2 or rad/s.

    white     : density of the white noise [unit / sqrt(Hz)]
    bias_sd   : steady-state sigma of the bias [unit];  period_s : its correlation time [s]
    scale     : error of scale and alignment together, relative to the measured value [1]
    in_run    : floor of the Allan deviation of the bias [unit]
    factor    : error of a scale factor alone [1]
    """

    white: float
    bias_sd: float
    period_s: float = 3600.0
    scale: float = 0.0
    in_run: float = 0.0
    factor: float = 0.0

    @property
    def alignment(self) -> float:
        """Error of the alignment alone [1]."""
        return math.sqrt(self.scale**2 - self.factor**2)

    def with_constant_bias(self, acting_s: float) -> TriadErrorModel:
        """The bias of the last start with flicker noise, which acts for so long [s].  Unchanged without ``in_run``."""
        if not self.in_run:
            return self
        floor = self.in_run * math.sqrt(FLICKER_MATCH)
        white, walk = math.hypot(self.white, floor * math.sqrt(acting_s / 2.0)), floor * math.sqrt(1.5 / acting_s)
        return replace(self, white=white, period_s=2.0 * (self.bias_sd / walk) ** 2)


@dataclass(frozen=True)
class ImuErrorModel:
    """One inertial measurement unit: data sheet values of accelerometers and gyros."""

    accel: TriadErrorModel
    gyro: TriadErrorModel

    @functools.cached_property
    def table(self) -> Array:
        """For the kernels: rows accelerometers and gyros; columns white, bias_sd, period_s, scale."""
        return np.array([[t.white, t.bias_sd, t.period_s, t.scale] for t in (self.accel, self.gyro)])

    def for_outages(self) -> ImuErrorModel:
        """The unit for minutes without fixes; scale and alignment of the gyros must be states."""
        gyro = replace(self.gyro.with_constant_bias(HEADING_S), scale=0.0)
        return ImuErrorModel(self.accel.with_constant_bias(VELOCITY_S), gyro)


_DEG = np.pi / 180.0
_DEG_H, _ROOT_H = _DEG / 3600.0, 1.0 / 60.0
_MILLI_G = 1e-3 * STANDARD_GRAVITY

#: Filter models of the grades of ``fti.hil.sensors.imu_grades``: turn-on bias, in-run bias and scale x g combined.
IMU_ERROR_MODELS: dict[str, ImuErrorModel] = {
    "navigation": ImuErrorModel(
        accel=TriadErrorModel(white=0.003 * _ROOT_H, bias_sd=0.11 * _MILLI_G, scale=105e-6, in_run=5e-3 * _MILLI_G),
        gyro=TriadErrorModel(
            white=0.002 * _DEG * _ROOT_H, bias_sd=0.0046 * _DEG_H, scale=23e-6, in_run=0.003 * _DEG_H, factor=11e-6
        ),
    ),
    "tactical": ImuErrorModel(
        accel=TriadErrorModel(
            white=0.065 * FOOT * _ROOT_H, bias_sd=1.2 * _MILLI_G, scale=0.6e-3, in_run=0.1 * _MILLI_G
        ),
        gyro=TriadErrorModel(
            white=0.125 * _DEG * _ROOT_H, bias_sd=1.2 * _DEG_H, scale=0.54e-3, in_run=0.5 * _DEG_H, factor=0.18e-3
        ),
    ),
    "mems": ImuErrorModel(
        accel=TriadErrorModel(white=0.09 * _ROOT_H, bias_sd=25.0 * _MILLI_G, scale=0.02, in_run=0.2 * _MILLI_G),
        gyro=TriadErrorModel(
            white=0.17 * _DEG * _ROOT_H, bias_sd=0.5 * _DEG, scale=0.02, in_run=8.0 * _DEG_H, factor=0.01
        ),
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
