"""Cells that an ideal test detects with a margin: the bound of the generalised likelihood ratio, times 1.5.

One axis, sampled once a second.  States: position, velocity, acceleration error (tilt and accelerometer bias, which are
indistinguishable in straight flight), its rate (g times the gyro bias, or the bias's own change), slow error of the
fix, error of the velocity, and vertically the offset of the barometer.  The filter is the optimal one (steady state of
the Riccati equation).  A fault adds s(t) to a measurement from its onset on, and with it rho_k to the innovation k,
whose covariance is S_k.  The likelihood ratio of "this fault, this onset" against "none" after a time T is Gaussian
with the distance

    delta^2(T) = sum over k <= T of rho_k^T S_k^-1 rho_k

No test on these measurements does better.  A fault that a test with a false alarm at k_fa = 5.3 sigma
misses with 1e-3 (k_md = 3.09) has delta = 8.39; it is in the table when two thirds of it reach that:

    delta(T) >= 1.5 x 8.39

T: age of the oldest copy (tactical 28 s, navigation 60 s, industrial and MEMS 8 s; of several receivers with the same
fault 12, 36 and 4 s), within which the protection levels must hold; where position and velocity of one receiver
contradict each other (tests of one source) 60 s.

Numbers: the grade of the product's configuration (``fti.nav.inertial.ins_error_model``: a test must allow for the
configured unit), a turn with 25 deg of bank, and the mean of the draws of ``receiver``; set before any simulation.
Not in the table, because the bound does not cover them: a stated sigma that is too small (no signature in the mean),
faults of the inertial unit (they contradict every aid at once; docs/safety.md lists them as not covered).
Source: Willsky, Jones 1976 (GLR); Basseville, Nikiforov 1993, section 7.2.
Checked against: tests/study/test_faults_study.py.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.constants import STANDARD_GRAVITY
from fti.nav.inertial.ins_error_model import IMU_ERROR_MODELS
from fti.study.faults.cells import BARO_KINDS, INERTIAL_KINDS, Cell, SensorFault
from fti.study.faults.flight import BARO_WHITE_M, M_PER_HPA, WEATHER_S, WEATHER_SD_M
from fti.study.faults.product import UNIT_OF_GRADE
from fti.study.faults.receiver import HEIGHT_FACTOR, SD_M, TAU_S, VELOCITY_SD_M_S, VELOCITY_TAU_S, WHITE_SD_M
from fti.study.faults.shapes import ramp

MARGIN = 1.5
K_FA, K_MD, K_MD_RADIAL = 5.3, 3.09, 3.72
#: Ages of the oldest copy [s] (decision 41), with one receiver and with several; look-back time of tests of one source.
AGE_S = {"navigation": 60, "tactical": 28, "industrial": 8, "mems": 8}
AGE_OF_SEVERAL_S = {"navigation": 36, "tactical": 12, "industrial": 4, "mems": 4}
ONE_SOURCE_S = 60
SPEED_M_S = 53.0  # minimum speed of the flights: 88 % of 60 m/s
#: A turn with 25 deg of bank [m/s^2], and how long it lasts [s].
TURN_M_S2, TURN_S = 4.6, 20.0
UNDULATION_M = 20.0  # minimum of the draws
STEADY_S = 600
#: Sigma of the barometer offset before the filter estimates it [m].
OFFSET_SD_M = 15.0


class _Axis(NamedTuple):
    """x' = F x + w of covariance Q, z = H x + v of covariance R."""

    F: Array
    Q: Array
    H: Array
    R: Array


@cache
def distance(cell: Cell) -> float:
    """delta of the fault of a cell at T; 0 where the bound does not apply."""
    if cell.kind in {SensorFault.NONE, SensorFault.SIGMA} or cell.kind in INERTIAL_KINDS:
        return 0.0
    is_vertical = cell.kind in BARO_KINDS | {SensorFault.UNDULATION_ZERO, SensorFault.MSL_HEIGHT, SensorFault.HEIGHT}
    is_of_one = cell.kind is SensorFault.RAMP and not cell.with_velocity
    end_s = max(oldest_age_s(cell), ONE_SOURCE_S if is_of_one or is_vertical else 0)
    t = np.arange(end_s + 1, dtype=np.float64)
    return _distance(_signature(cell, t), *_steady(cell.grade, is_vertical))


def oldest_age_s(cell: Cell) -> int:
    """Age of the oldest copy; for a fault of one of two receivers at least that of one receiver."""
    return (AGE_OF_SEVERAL_S if cell.faulty_receivers > 1 else AGE_S)[cell.grade]


def is_detectable(cell: Cell) -> bool:
    """Whether the cell is in the table."""
    return distance(cell) >= MARGIN * (K_FA + K_MD)


def separation_sds(grade: str, ages_s: int) -> Array:
    """Sigma of d on a horizontal axis, position [m] and velocity [m/s], at ages 1, 2, ... of a copy, shape (n, 2).

    Cov(d) = P_i - P_0, where the copy starts from a filter with ten minutes of aiding and gets no fixes.
    """
    axis, P = _steady(grade, is_vertical=False)
    copied, found = P.copy(), np.empty((ages_s, 2))
    for row in found:
        copied = axis.F @ copied @ axis.F.T + axis.Q
        row[:] = np.sqrt(np.maximum(np.diag(copied - P)[:2], 0.0))
    return found


def level_ratio(grade: str, age_s: int) -> float:
    """HPL of a filter equal to a copy of that age, in sigmas of the filter: 3.72 sigma of the copy."""
    _, P = _steady(grade, is_vertical=False)
    return float(K_MD_RADIAL * np.hypot(1.0, separation_sds(grade, age_s)[-1, 0] / np.sqrt(P[0, 0])))


def filter_response(grade: str, added: Array) -> Array:
    """Response of the filter to a fault on a horizontal axis, position [m] and velocity [m/s], shape (n, 2).

    added : to position and velocity of the fixes at 0, 1, ... s since its onset, shape (n, 2)
    """
    axis, P = _steady(grade, is_vertical=False)
    shift, found = np.zeros(len(P)), np.empty((len(added), 2))
    for k, fault in enumerate(np.pad(added, ((0, 0), (0, 1)))):
        P = axis.F @ P @ axis.F.T + axis.Q
        shift = axis.F @ shift
        K = P @ axis.H.T @ np.linalg.inv(axis.H @ P @ axis.H.T + axis.R)
        shift = shift + K @ (fault - axis.H @ shift)
        P = P - K @ axis.H @ P
        found[k] = shift[:2]
    return found


def _signature(cell: Cell, t: Array) -> Array:
    """Errors that the fault adds to position, velocity and barometer, at times since its onset, shape (n, 3)."""
    found, size = np.zeros((len(t), 3)), cell.magnitude
    match cell.kind:
        case SensorFault.RAMP:
            found[:, 0], rate = ramp(t, size, cell.onset_m_s2)
            found[:, 1] = rate if cell.with_velocity else 0.0
        case SensorFault.FROZEN | SensorFault.FROZEN_POSITION:
            found[:, 0] = SPEED_M_S * t
        case SensorFault.JUMP | SensorFault.HEIGHT:
            found[:, 0] = size
        case SensorFault.SWAPPED:
            found[:, 0] = 1e6
        case SensorFault.TIME_STEP:
            found[:, 0] = SPEED_M_S * size
        case SensorFault.UNDULATION_ZERO | SensorFault.MSL_HEIGHT:
            found[:, 0] = UNDULATION_M
        case SensorFault.BARO_STEP | SensorFault.QNH:
            found[:, 2] = size * (M_PER_HPA if cell.kind is SensorFault.QNH else 1.0)
        case SensorFault.BARO_RAMP:
            found[:, 2] = size * t
    return found


@cache
def _steady(grade: str, is_vertical: bool) -> tuple[_Axis, Array]:
    """The axis and the covariance of its filter after ten minutes of aiding."""
    axis = _axis(grade, is_vertical)
    P = np.diag([10.0, 1.0, 0.1, 1e-3, 3.0, 0.1, OFFSET_SD_M]) ** 2
    for _ in range(STEADY_S):
        P = axis.F @ P @ axis.F.T + axis.Q
        K = P @ axis.H.T @ np.linalg.inv(axis.H @ P @ axis.H.T + axis.R)
        P = P - K @ axis.H @ P
    return axis, P


def _axis(grade: str, is_vertical: bool) -> _Axis:
    """States: position, velocity, acceleration error, its rate, slow error, velocity error, offset; steps of 1 s.

    Densities of velocity and acceleration error: white noise; scale x acceleration of a turn, for the time of a turn;
    level also turn rate x g.  Bias errors are Gauss-Markov processes of the grade.
    """
    unit, factor = IMU_ERROR_MODELS[UNIT_OF_GRADE.get(grade, grade)], HEIGHT_FACTOR if is_vertical else 1.0
    accel, gyro, level = unit.accel, unit.gyro, 0.0 if is_vertical else STANDARD_GRAVITY
    tau = np.array([np.inf, np.inf, accel.period_s, gyro.period_s, np.mean(TAU_S), VELOCITY_TAU_S, WEATHER_S])
    F = np.diag(np.exp(-1.0 / tau))
    F[0, 1] = F[1, 2] = F[2, 3] = 1.0
    F[0, 2] = F[1, 3] = 0.5
    velocity_noise = accel.white**2 + (accel.scale * TURN_M_S2) ** 2 * TURN_S
    turn_noise = level**2 * (gyro.white**2 + (gyro.scale * TURN_M_S2 / SPEED_M_S) ** 2 * TURN_S)
    sds = np.array([
        accel.bias_sd, level * gyro.bias_sd, factor * np.mean(SD_M), np.mean(VELOCITY_SD_M_S), WEATHER_SD_M
    ])  # fmt: skip
    stationary = np.concatenate((np.zeros(2), sds**2))
    Q = np.diag(stationary * (1.0 - np.diag(F) ** 2) + [0.0, velocity_noise, turn_noise, 0.0, 0.0, 0.0, 0.0])
    H = np.zeros((3, 7))
    H[0, 0] = H[0, 4] = H[1, 1] = H[1, 5] = H[2, 0] = H[2, 6] = 1.0
    R = np.diag([WHITE_SD_M**2, 1e-4, BARO_WHITE_M**2 if is_vertical else 1e12])  # horizontal: no barometer
    return _Axis(F, Q, H, R)


def _distance(signature: Array, axis: _Axis, P: Array) -> float:
    """delta: the signature through the filter, innovation by innovation."""
    shift, total = np.zeros(len(P)), 0.0
    for added in signature:
        P = axis.F @ P @ axis.F.T + axis.Q
        shift = axis.F @ shift
        S = axis.H @ P @ axis.H.T + axis.R
        rho = added - axis.H @ shift
        total += float(rho @ np.linalg.solve(S, rho))
        K = P @ axis.H.T @ np.linalg.inv(S)
        shift = shift + K @ rho
        P = P - K @ axis.H @ P
    return float(np.sqrt(total))
