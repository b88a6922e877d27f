"""Thirteen errors of an inertial system, corrected by shifts from the terrain.

    0-1 position east, north [m]   2-3 velocity east, north [m/s]   4-6 turn east, north, up [rad]
    7-9 accelerometer bias b [m/s^2]   10-12 gyro bias b [rad/s]

The source gives the number of the states, not their names.  These are the fifteen of ``fti.nav.inertial`` without
height and vertical velocity, which its inertial system gets from satellites or the barometer.  The error is truth minus
estimate; the biases are constant.  The errors are in the local frame, which does not turn with the aircraft:

    F_l = T F_e T',   T = diag(mat_le, mat_le, mat_le, 1, 1)          F_e : ``ins_error_model.rates``

A shift refers to the middle of its batch, an age a before the update: H = (1, -a) on position and velocity.

Source: Oh 2019, section 4.3 and table 2; Groves 2013, section 14.2.3 (dynamics).  Checked against: covariance of
simulated errors, and a closed form; tests/nav/interferometric/test_correction_filter.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.geodesy.local import LocalFrame
from fti.nav.inertial.ins_error_model import ACCEL, BIASED, POS, TURN, VEL, ImuErrorModel, rates

POSITION, VELOCITY, ATTITUDE, ACCEL_BIAS, GYRO_BIAS = slice(0, 2), slice(2, 4), slice(4, 7), slice(7, 10), slice(10, 13)
STATES = 13
#: The states among the fifteen: without up and its rate.
_KEPT = np.array([*range(POS, POS + 2), *range(VEL, VEL + 2), *range(TURN, BIASED)])


@dataclass(frozen=True)
class StartErrors:
    """One sigma at the start, of each axis: position [m], velocity [m/s], tilt, heading [rad]."""

    position: float
    velocity: float
    tilt: float
    heading: float


def start_cov(start: StartErrors, unit: ImuErrorModel) -> Array:
    """Covariance of the states at the start, shape (13, 13)."""
    sds = [start.position] * 2 + [start.velocity] * 2 + [start.tilt] * 2 + [start.heading]
    return np.diag(np.square([*sds, *[unit.accel.bias_sd] * 3, *[unit.gyro.bias_sd] * 3]))


def transition(frame: LocalFrame, mat_lb: Array, accel_b: Array, seconds: float) -> Array:
    """Transition matrix over a step, shape (13, 13).

    mat_lb : body to local frame (3, 3);  accel_b : specific force (3,) [m/s^2];  seconds : one at most
    """
    mat_le, force_l = frame.mat_le, mat_lb @ accel_b
    down_e = mat_le.T @ np.array([0.0, 0.0, -1.0])
    F_e = np.zeros((BIASED, BIASED))
    F_e[:ACCEL] = rates(np.ascontiguousarray(mat_le.T @ mat_lb), mat_le.T @ force_l, down_e, True)
    turned = np.eye(BIASED)
    for first in (POS, VEL, TURN):
        turned[first : first + 3, first : first + 3] = mat_le
    F = (turned @ F_e @ turned.T)[np.ix_(_KEPT, _KEPT)] * seconds
    return np.asarray(np.eye(STATES) + F + 0.5 * F @ F)


def process_noise(unit: ImuErrorModel, seconds: float) -> Array:
    """Covariance of the noise over a step, shape (13, 13): white noise of accelerometers and gyros."""
    density = np.zeros(STATES)
    density[VELOCITY], density[ATTITUDE] = unit.accel.white**2, unit.gyro.white**2
    return np.diag(density * seconds)


class CorrectionFilter:
    """On one flight.

    x : ndarray, shape (13,)      estimated errors
    P : ndarray, shape (13, 13)   their covariance
    """

    def __init__(self, unit: ImuErrorModel, start: StartErrors) -> None:
        self.x, self.P = np.zeros(STATES), start_cov(start, unit)

    def predict(self, phi: Array, Q: Array) -> None:
        """Time update.  phi, Q : of ``transition`` and ``process_noise``"""
        self.x = phi @ self.x
        self.P = phi @ self.P @ phi.T + Q

    def update(self, shift: Array, sd: float, age: float) -> None:
        """A shift of the corrected position, at a time before now.

        shift : true minus corrected position, shape (2,) [m];  sd : one sigma of each axis [m];  age [s]
        """
        H = np.zeros((2, STATES))
        H[:, POSITION], H[:, VELOCITY] = np.eye(2), -age * np.eye(2)
        R = sd**2 * np.eye(2)
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + R)
        keep = np.eye(STATES) - K @ H
        self.x = self.x + K @ shift
        self.P = keep @ self.P @ keep.T + K @ R @ K.T
