"""Errors of inertial units by grade.

Source: Groves, 2nd edition (2013), section 4.4 and tables 4.1, 4.2 for the classes (biases; in-run variation about a
tenth of the constant part); IEEE Std 952 for angle random walk.  Where a class is a range, the values lie inside it
and equal the specification of the study (navigation 0.01 deg/h, 0.002 deg/sqrt(h), 50 ug; tactical
1 deg/h, 0.1 deg/sqrt(h), 1 mg; industrial 7 deg/h, 2 mg; MEMS 100 deg/h).  Random walks of industrial and MEMS units,
velocity random walks, scale factors and misalignments are chosen here as typical of each class.
Deflection and anomaly of gravity: 2e-4 m/s^2 (20 mGal, about 4 arc seconds) over 40 km, as in Jordan,
Self-consistent statistical models for the gravity anomaly (1972), and Groves, section 2.4.7, for gentle terrain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fti.arrays import Array, Rng
from fti.constants import STANDARD_GRAVITY
from fti.hil.sensors.errors import gauss_markov_n
from fti.study.faults.trajectory import TrueMotion, angular_rate_b, specific_force_b

RATE_HZ = 25
IN_RUN_SHARE = 0.1
IN_RUN_TAU_S = (100.0, 1000.0)
GRAVITY_SD, GRAVITY_LENGTH_M = 2e-4, 40_000.0
_MG, _UG, _PPM = 1e-3 * STANDARD_GRAVITY, 1e-6 * STANDARD_GRAVITY, 1e-6
_DEG_H = float(np.deg2rad(1.0)) / 3600.0
_DEG_ROOT_H = float(np.deg2rad(1.0)) / 60.0


@dataclass(frozen=True, slots=True)
class TriadErrors:
    """Three sensors, one sigma each.

    bias : constant part [unit];  walk : white noise density [unit / sqrt(Hz)];  scale : scale factor and
    cross-coupling [1].  The unit is m/s^2 or rad/s.
    """

    bias: float
    walk: float
    scale: float


@dataclass(frozen=True, slots=True)
class InertialUnit:
    """Accelerometers and gyroscopes of one grade."""

    accel: TriadErrors
    gyro: TriadErrors


UNITS = {
    "navigation": InertialUnit(
        TriadErrors(0.05 * _MG, 20.0 * _UG, 50.0 * _PPM), TriadErrors(0.01 * _DEG_H, 0.002 * _DEG_ROOT_H, 5.0 * _PPM)
    ),
    "tactical": InertialUnit(
        TriadErrors(1.0 * _MG, 100.0 * _UG, 300.0 * _PPM), TriadErrors(1.0 * _DEG_H, 0.1 * _DEG_ROOT_H, 150.0 * _PPM)
    ),
    "industrial": InertialUnit(
        TriadErrors(2.0 * _MG, 150.0 * _UG, 1000.0 * _PPM), TriadErrors(7.0 * _DEG_H, 0.3 * _DEG_ROOT_H, 1000.0 * _PPM)
    ),
    "mems": InertialUnit(
        TriadErrors(5.0 * _MG, 300.0 * _UG, 3000.0 * _PPM),
        TriadErrors(100.0 * _DEG_H, 0.6 * _DEG_ROOT_H, 3000.0 * _PPM),
    ),
}


@dataclass(frozen=True, eq=False)
class InertialSamples:
    """Samples at t (n,) [s]: accel_b (n, 3) [m/s^2] and gyro_b (n, 3) [rad/s]."""

    t: Array
    accel_b: Array
    gyro_b: Array


def ideal_samples(m: TrueMotion) -> InertialSamples:
    """Without any error, in normal gravity."""
    return InertialSamples(m.t, specific_force_b(m), angular_rate_b(m))


def measure_inertial(m: TrueMotion, unit: InertialUnit, rng: Rng, rate_hz: int = RATE_HZ) -> InertialSamples:
    """Measurements of a unit drawn from its grade on a motion, at a rate."""
    speed = float(np.mean(np.linalg.norm(m.vel_n, axis=1)))
    sds = (GRAVITY_SD,) * 3
    disturbance_n = gauss_markov_n(len(m.t), 1.0 / rate_hz, GRAVITY_LENGTH_M / speed, sds, rng)
    true = replace(ideal_samples(m), accel_b=specific_force_b(m, disturbance_n))
    accel_b = triad_output(true.accel_b, unit.accel, rng, rate_hz)
    return InertialSamples(m.t, accel_b, triad_output(true.gyro_b, unit.gyro, rng, rate_hz))


def triad_output(true_b: Array, triad: TriadErrors, rng: Rng, rate_hz: int = RATE_HZ) -> Array:
    """(I + M) x + constant bias + in-run bias + white noise of density walk over one sample."""
    matrix = np.eye(3) + rng.normal(0.0, triad.scale, (3, 3))
    constant = rng.normal(0.0, triad.bias, 3)
    tau_s = rng.uniform(*IN_RUN_TAU_S)
    in_run = gauss_markov_n(len(true_b), 1.0 / rate_hz, tau_s, (IN_RUN_SHARE * triad.bias,) * 3, rng)
    white = rng.normal(0.0, triad.walk * np.sqrt(rate_hz), true_b.shape)
    return true_b @ matrix.T + constant + in_run + white
