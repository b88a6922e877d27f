"""Linear-Gaussian errors of the navigated position and height.

    state  x = (shift east, shift north, height error, velocity error east, velocity error north)

    shift_k+1    = shift_k + dt velocity_k + noise        noise variance  position_walk^2 dt
    height_k+1   = height_k + noise                                       height_walk^2 dt
    velocity_k+1 = velocity_k + noise                                     velocity_walk^2 dt

The velocity error is true minus navigated velocity, like the shift.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fti.arrays import Array

STATES = 5
SHIFT, HEIGHT, VELOCITY = slice(0, 2), 2, slice(3, 5)


@dataclass(frozen=True)
class DriftModel:
    """One sigma of the errors, of each horizontal axis.

    position_sd, height_sd, velocity_sd : at the start [m, m, m/s]
    position_walk, height_walk          : growth of position and height error [m/sqrt(s)]
    velocity_walk                       : growth of the velocity error [m/s/sqrt(s)]
    Raises ValueError if position_sd or height_sd is not positive, or another one is negative.
    """

    position_sd: float
    height_sd: float
    position_walk: float = 0.0
    height_walk: float = 0.0
    velocity_sd: float = 0.0
    velocity_walk: float = 0.0

    def __post_init__(self) -> None:
        if not min(self.position_sd, self.height_sd) > 0.0:
            raise ValueError(f"position_sd is {self.position_sd}, height_sd {self.height_sd}: must be positive")
        if not min(self.position_walk, self.height_walk, self.velocity_sd, self.velocity_walk) >= 0.0:
            raise ValueError(f"{self}: a sigma is negative")

    @property
    def has_velocity(self) -> bool:
        """Whether there is a velocity error."""
        return max(self.velocity_sd, self.velocity_walk) > 0.0

    @property
    def start_cov(self) -> Array:
        """Covariance of the state at the start, shape (5, 5)."""
        sds = (self.position_sd, self.position_sd, self.height_sd, self.velocity_sd, self.velocity_sd)
        return np.diag(np.square(sds))

    def transition(self, seconds: float) -> tuple[Array, Array]:
        """Transition matrix of the state over a time [s], and the covariance of its noise, shape (5, 5) each."""
        matrix = np.eye(STATES)
        matrix[SHIFT, VELOCITY] = seconds * np.eye(2)
        walks = (self.position_walk, self.position_walk, self.height_walk, self.velocity_walk, self.velocity_walk)
        return matrix, np.diag(seconds * np.square(walks))

    def after(self, seconds: float) -> DriftModel:
        """The model of a start after a time [s] without samples; its errors are not correlated."""
        position_2 = self.position_walk**2 * seconds + self.velocity_walk**2 * seconds**3 / 3.0
        return replace(
            self,
            position_sd=math.hypot(self.position_sd, self.velocity_sd * seconds, math.sqrt(position_2)),
            height_sd=math.hypot(self.height_sd, self.height_walk * math.sqrt(seconds)),
            velocity_sd=math.hypot(self.velocity_sd, self.velocity_walk * math.sqrt(seconds)),
        )

    def propagate(self, cov: Array, seconds: float) -> Array:
        """Covariance of the state after a time [s] without samples, shape (5, 5)."""
        matrix, noise = self.transition(seconds)
        return np.asarray(matrix @ cov @ matrix.T + noise)


@dataclass(frozen=True, eq=False)
class ShiftEstimate:
    """Mean and covariance of the probability of a filter.

    shift : true minus navigated position, east and north [m];  cov : its covariance [m^2]
    height_error : navigated minus true height [m];  height_sd : one sigma of it [m]
    """

    shift: Array
    cov: Array
    height_error: float
    height_sd: float
