"""Errors of an inertial measurement unit: three accelerometers and three gyros with random constant and noise terms.

    measured = clip(round(mat x + bias + in-run + walk + white))
    mat      = (I + scale) (I + skew) rotation

turn-on bias and ``mat`` are constant from one start to the next; the in-run bias is flicker noise, a sum of first-order
Gauss-Markov processes; the walk is rate (or acceleration) random walk; white noise of density N integrates to an angle
(or velocity) random walk N sqrt(t).  Source: IEEE Std 952-1997, annex C; Groves 2013, section 4.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.sensors.errors import flicker_noise, noise_of_density, quantize, random_walk


@dataclass(frozen=True, slots=True)
class TriadSpec:
    """Errors of three equal axes, one sigma; unit : of the quantity, m/s^2 or rad/s.

    turn_on       : bias repeatability [unit]
    in_run        : floor of the Allan deviation [unit], called in-run bias stability in data sheets
    white         : density of the white noise [unit / sqrt(Hz)]: velocity or angle random walk
    walk          : random walk of the bias [unit / sqrt(s)]
    scale         : error of the scale factor
    misalignment  : of the three axes together against the case [rad, each angle]
    skew          : non-orthogonality of the axes [rad]
    resolution    : step of the output [unit];  limit : of the range, on both sides [unit]
    """

    turn_on: float
    in_run: float
    white: float
    walk: float
    scale: float
    misalignment: float
    skew: float
    resolution: float
    limit: float


@dataclass(frozen=True, slots=True)
class Grade:
    """Grade of a unit: its accelerometers [m/s^2] and its gyros [rad/s]."""

    accel: TriadSpec
    gyro: TriadSpec


@dataclass(frozen=True, slots=True)
class Instrument:
    """Three axes of one unit.  bias : turn-on bias, shape (3,); mat : case to axes, with scales, shape (3, 3)."""

    triad: TriadSpec
    bias: Array
    mat: Array

    @classmethod
    def draw(cls, triad: TriadSpec, rng: np.random.Generator) -> Instrument:
        """An instrument with random constant errors."""
        bias, scale, angles, skew = (
            rng.normal(0.0, sd, 3) for sd in (triad.turn_on, triad.scale, triad.misalignment, triad.skew)
        )
        return cls(triad, bias, mat_of(scale, angles, skew))

    def measure(self, t: Array, true_b: Array, rng: np.random.Generator) -> Array:
        """Output for the true values true_b, shape (n, 3), at t, shape (n,) [s, evenly spaced]."""
        noise = np.stack([self._noise(t, rng) for _ in range(3)], axis=1)
        values = true_b @ self.mat.T + self.bias + noise
        return np.clip(quantize(values, self.triad.resolution), -self.triad.limit, self.triad.limit)

    def constant_error(self, true_b: Array) -> Array:
        """Constant part of the error at this true value, shape (3,)."""
        return np.asarray(self.mat @ true_b - true_b + self.bias)

    def _noise(self, t: Array, rng: np.random.Generator) -> Array:
        triad = self.triad
        return (
            flicker_noise(t, triad.in_run, rng)
            + random_walk(t, triad.walk, rng)
            + noise_of_density(t, triad.white, rng)
        )


def mat_of(scale: Array, angles: Array, skew: Array) -> Array:
    """Case to axes: rotated by small angles (roll, pitch, yaw of the axes in the case), skewed, scaled; shape (3, 3).

    skew : deviation from the right angle of y to x, z to x, z to y [rad]
    """
    mat_skew = np.eye(3)
    mat_skew[1, 0], mat_skew[2, 0], mat_skew[2, 1] = skew
    return np.asarray(np.diag(1.0 + scale) @ mat_skew @ mat_from_rpy(*angles).T)


class Imu:
    """One unit of a grade.  rng : exclusive generator of its errors, for reproducibility"""

    def __init__(self, grade: Grade, rng: np.random.Generator) -> None:
        self._rng = rng
        self.accel, self.gyro = Instrument.draw(grade.accel, rng), Instrument.draw(grade.gyro, rng)

    def measure(self, t: Array, force_b: Array, rate_b: Array) -> tuple[Array, Array]:
        """Measured specific force [m/s^2] and angular rate [rad/s], shape (n, 3), for the true ones."""
        return self.accel.measure(t, force_b, self._rng), self.gyro.measure(t, rate_b, self._rng)
