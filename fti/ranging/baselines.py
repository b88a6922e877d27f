"""Three antennas across the aircraft: look angle from their phase differences, with ambiguity resolution.

The antennas L, A, R lie along +y of the sensor (to the right), A between the others.  A wave from the look angle theta
(positive to the right) has a path to L that is B sin(theta) longer than to an antenna at B to the right, so

    phi_ij = 2 pi B_ij sin(theta) / lambda - 2 pi n_ij,          ij = LA, AR, LR,    B_LR = B_LA + B_AR        (4)

with unknown integers n_ij.  With the correct integers every baseline gives the same sin(theta); the result is their
mean, weighted by length:

    sin(theta) = (B_LA s_LA + B_AR s_AR + B_LR s_LR) / (B_LA + B_AR + B_LR)                       (3, as corrected)

The integers are those of the minimum error  e = (B_AR psi_LA - B_LA psi_AR) / B_LR,  psi_ij = phi_ij + 2 pi n_ij,  by
which the short baselines disagree; with them the weighted mean equals the result of the long baseline.  The waves are
assumed plane: a point at the distance rho adds B^2 cos^2(theta) / (2 rho) to a path (1 mm at 1 m and 500 m).

Source: Park, section II.A, eq. 3, 4, as corrected in docs/errata.md.  Neither wavelength nor baselines are published.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array, Codes
from fti.ranging.sensor import Validity

#: Limit of the error e [sigmas]: exceeded once in a thousand.
MAX_ERROR_SIGMAS = 3.29
_EXACT = 1e-9  # [rad] phases without noise fit to rounding
_TURN = 2.0 * np.pi


@dataclass(frozen=True, slots=True)
class Baselines:
    """Three antennas and the noise of their phases.

    wavelength  : [m]
    la, ar      : from L to A and from A to R [m]
    phase_sd    : of the phase of each antenna [rad]; the difference of two has sqrt(2) of it
    look_limit  : look angles lie within +- this [rad], in (0, pi/2); integers beyond are excluded
    Raises ValueError for values out of range.
    """

    wavelength: float
    la: float
    ar: float
    phase_sd: float = 0.0
    look_limit: float = math.radians(45.0)

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and (value > 0.0 or (field.name == "phase_sd" and value == 0.0))):
                raise ValueError(f"{field.name} is {value}, must be positive")
        if self.look_limit >= 0.5 * math.pi:
            raise ValueError(f"look_limit is {self.look_limit} rad, must be below pi/2")

    @property
    def lr(self) -> float:
        """From L to R [m]."""
        return self.la + self.ar

    @property
    def error_sd(self) -> float:
        """One sigma of the error e with the correct integers [rad]."""
        return self.phase_sd * math.sqrt(2.0 * (self.la**2 + self.ar**2 + self.la * self.ar)) / self.lr

    def look_angle_sd(self, look_angle: ArrayLike) -> Array:
        """One sigma of the look angle with the correct integers [rad]: sqrt(2) phase_sd lambda / (2 pi B_LR cos)."""
        return np.asarray(math.sqrt(2.0) * self.phase_sd * self.wavelength / (_TURN * self.lr * np.cos(look_angle)))

    def phases(self, look_angle: ArrayLike, rng: np.random.Generator | None = None) -> Array:
        """Differences of phase of LA, AR, LR, shape (..., 3), in [-pi, pi) [rad]; ``rng`` None: without noise."""
        sine = np.sin(np.asarray(look_angle, dtype=np.float64))
        at = np.stack((np.zeros_like(sine), self.la * sine, self.lr * sine), axis=-1) * (_TURN / self.wavelength)
        if rng is not None:
            at += self.phase_sd * rng.standard_normal(at.shape)
        left, middle, right = np.moveaxis(at, -1, 0)
        return _wrap(np.stack((middle - left, right - middle, right - left), axis=-1))

    def resolve(self, phases: ArrayLike) -> tuple[Array, Codes]:
        """Look angle [rad] by the integers of minimum error, and its validity.

        phases   : (..., 3) [rad] differences of LA, AR, LR
        Validity : AMBIGUOUS when a second candidate fits within 3.29 sigma of the noise, WEAK when none does, and
                   UNKNOWN (NaN) for phases that are not finite or give no look angle within the limit
        """
        measured = np.asarray(phases, dtype=np.float64)
        sines, errors = self._candidates(measured[..., 0], measured[..., 1], measured[..., 2])
        order = np.argsort(errors, axis=-1)[..., :2]
        (first, second), (sine, _) = (np.moveaxis(np.take_along_axis(of, order, -1), -1, 0) for of in (errors, sines))
        fits = MAX_ERROR_SIGMAS * self.error_sd + _EXACT
        validity = np.where(first > fits, Validity.WEAK, np.where(second <= fits, Validity.AMBIGUOUS, Validity.VALID))
        validity = np.where(np.isinf(first), Validity.UNKNOWN, validity).astype(np.uint8)
        return np.arcsin(np.where(np.isinf(first), np.nan, sine)), validity

    def _candidates(self, la: Array, ar: Array, lr: Array) -> tuple[Array, Array]:
        """sin(theta) of eq. 3 and |e| [rad] of each choice of integers, (..., k); infinite beyond the limit."""
        max_turns = math.ceil(self.la * math.sin(self.look_limit) / self.wavelength) + 1
        turns_la = np.repeat(np.arange(-max_turns, max_turns + 1), 2)
        upper = np.tile([0.0, 1.0], 2 * max_turns + 1)
        psi_la = la[..., None] + _TURN * turns_la
        psi_ar = ar[..., None] + _TURN * (np.floor((psi_la * self.ar / self.la - ar[..., None]) / _TURN) + upper)
        psi_lr = lr[..., None] + _TURN * np.rint((psi_la + psi_ar - lr[..., None]) / _TURN)
        sines = (psi_la + psi_ar + psi_lr) * self.wavelength / (_TURN * (self.la + self.ar + self.lr))
        errors = np.abs(self.ar * psi_la - self.la * psi_ar) / self.lr
        return sines, np.where(np.abs(sines) <= math.sin(self.look_limit), errors, np.inf)

    def wrong_integer_probability(self, look_angle: float) -> float:
        """Probability that noise gives wrong integers the minimum error, at a look angle [rad] inside the limit.

        Other integers shift e by  d = 2 pi (B_AR m - B_LA k) / B_LR  and sin(theta) by  lambda (m + k) / B_LR.  The
        nearest one above and the nearest one below that stay inside the limit decide: Q(d / 2 sigma_e) of each.
        """
        shifts = self._shifts(math.sin(look_angle))
        nearest = min(shifts[shifts > 0.0], default=math.inf), min(-shifts[shifts < 0.0], default=math.inf)
        if self.phase_sd == 0.0:
            return 0.0
        return sum(0.5 * math.erfc(d / (2.0 * math.sqrt(2.0) * self.error_sd)) for d in nearest)

    def _shifts(self, sine: float) -> Array:
        """Shifts of e [rad] of all other integers whose look angle stays inside the limit."""
        limit = math.sin(self.look_limit)
        max_turns = math.ceil(2.0 * limit * self.lr / self.wavelength) + 1
        m, k = np.meshgrid(np.arange(-max_turns, max_turns + 1), np.arange(-max_turns, max_turns + 1))
        inside = np.abs(sine + self.wavelength * (m + k) / self.lr) <= limit
        others = inside & ((m != 0) | (k != 0))
        return np.asarray(_TURN * (self.ar * m - self.la * k)[others] / self.lr)


def _wrap(phase: Array) -> Array:
    """The same phase in [-pi, pi)."""
    return np.asarray((phase + np.pi) % _TURN - np.pi)
