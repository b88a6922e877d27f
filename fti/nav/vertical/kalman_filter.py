"""Indirect Kalman filter of the vertical channel, optimal or robust, of one flight or of many at once.

    optimal   every measurement is used (gate = inf)
    robust    a measurement outside the confidence region |nu| <= gate sigma_nu is not used: x and P stay as predicted
              (Hajiyev, eq. 21 to 24, p = 0 or 1)

The source does not define the region.  ``GATE`` = 3: 0.27 % of sound measurements are refused, and 2.4 % of those with
a hundred times the noise pass by chance.

If refusals never ended, a filter with an error larger than its sigma would stay wrong.  So refusals are bounded: when
no measurement was accepted for a time T of ``lockout_s``, the median m of the last ``REFUSED_HISTORY`` refused
innovations is added to the sigma of the height, m / T to that of the climb, and the scatter s to the noise,

    P_HH + m^2,    P_WW + (m / T)^2,    R + s^2

and the measurement is tested again.  Innovations cannot show whether the inertial channel or the altimeter is wrong;
the channel is assumed to be, because it drifts.  The filter is not trusted until ``MIN_ACCEPTED_IN_ROW`` further
measurements in a row are accepted: a source with random values passes once and is refused again.

P is updated in Joseph's form.  Measurements that are not finite are neither used nor counted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array, Mask
from fti.nav.vertical.error_model import CLIMB, HEIGHT, STATES

#: Confidence region of the normalised innovation [sigma].
GATE = 3.0
#: Number of stored refused innovations, and of measurements in a row that restore trust.
REFUSED_HISTORY = 9
MIN_ACCEPTED_IN_ROW = 5
#: Median absolute deviation to one sigma of a normal distribution.
MAD_TO_SD = 1.4826


@dataclass(frozen=True, slots=True, eq=False)
class Innovation:
    """Measured minus predicted [m], its predicted sigma [m], and whether it was accepted; shape (...)."""

    value: Array
    sd: Array
    accepted: Mask


class ErrorFilter:
    """Error states and their covariance.

    x         : ndarray, shape (..., 5)      estimated errors
    P         : ndarray, shape (..., 5, 5)   their covariance
    gate      : half the confidence region [sigma]; inf for the optimal filter
    lockout_s : time without accepted measurements after which the region is opened; inf: never
    """

    def __init__(self, x: ArrayLike, P: ArrayLike, gate: float = GATE, lockout_s: float = math.inf) -> None:
        self.x = np.array(x, dtype=np.float64)
        self.P = np.array(P, dtype=np.float64)
        self._gate, self._lockout_s = gate, lockout_s
        runs = self.x.shape[:-1]
        self._unaided_s = np.zeros(runs)
        self._refused = np.zeros((*runs, REFUSED_HISTORY))
        self._count = np.zeros(runs, dtype=np.int64)
        self._in_row = np.full(runs, MIN_ACCEPTED_IN_ROW)

    @property
    def is_trusted(self) -> Mask:
        """Whether the region was not opened, or ``MIN_ACCEPTED_IN_ROW`` measurements were accepted since."""
        return np.asarray(self._in_row >= MIN_ACCEPTED_IN_ROW)

    def predict(self, phi: Array, Q: Array, dt: float) -> None:
        """Propagate by dt [s] (eq. 17, 19)."""
        self.x = self.x @ phi.T
        self.P = phi @ self.P @ phi.T + Q
        self._unaided_s = self._unaided_s + dt

    def update(self, z: ArrayLike, h: Array, r: float) -> Innovation:
        """Update with a measurement z = h x + v (eq. 14 to 18), if it is accepted.

        z : float or ndarray, shape (...) [m];  h : shape (5,);  r : variance of v [m^2], >= 0
        """
        nu = np.asarray(np.asarray(z, dtype=np.float64) - self.x @ h)
        known = np.isfinite(nu)
        accepted = self._passes(nu, h, np.asarray(r))
        is_opened = known & ~accepted & (self._unaided_s >= self._lockout_s) & (self._count >= REFUSED_HISTORY)
        noise = np.full(nu.shape, float(r))
        if is_opened.any():
            noise = self._open(is_opened, noise)
            accepted = accepted | (is_opened & self._passes(nu, h, noise))
        self._remember(nu, known & ~accepted, accepted)
        sd = np.sqrt(self._variance(h) + noise)
        self._correct(np.where(accepted, nu, 0.0), h, noise, accepted)
        return Innovation(nu, sd, accepted)

    def _variance(self, h: Array) -> Array:
        return np.asarray((self.P @ h) @ h)

    def _passes(self, nu: Array, h: Array, noise: Array) -> Mask:
        return np.asarray(np.isfinite(nu) & (np.abs(nu) <= self._gate * np.sqrt(self._variance(h) + noise)))

    def _open(self, is_opened: Mask, noise: Array) -> Array:
        """Enlarge the variances of height and climb by the refused innovations; return the noise with their scatter."""
        middle = np.median(self._refused, axis=-1)
        scatter = MAD_TO_SD * np.median(np.abs(self._refused - middle[..., None]), axis=-1)
        self.P[..., HEIGHT, HEIGHT] += np.where(is_opened, middle**2, 0.0)
        self.P[..., CLIMB, CLIMB] += np.where(is_opened, (middle / np.maximum(self._unaided_s, 1.0)) ** 2, 0.0)
        self._in_row = np.where(is_opened, 0, self._in_row)
        self._unaided_s = np.where(is_opened, 0.0, self._unaided_s)
        return np.asarray(noise + np.where(is_opened, scatter**2, 0.0))

    def _remember(self, nu: Array, refused: Mask, accepted: Mask) -> None:
        if refused.any():
            shifted = np.concatenate([self._refused[..., 1:], np.where(refused, nu, 0.0)[..., None]], axis=-1)
            self._refused = np.where(refused[..., None], shifted, self._refused)
        self._count = np.where(accepted, 0, self._count + refused)
        self._unaided_s = np.where(accepted, 0.0, self._unaided_s)
        self._in_row = np.where(accepted, self._in_row + 1, np.where(refused & ~self.is_trusted, 0, self._in_row))

    def _correct(self, nu: Array, h: Array, noise: Array, accepted: Mask) -> None:
        """Joseph's form; the gain is zero if the measurement is not accepted."""
        Ph = self.P @ h
        K = np.where(accepted, 1.0 / (Ph @ h + noise), 0.0)[..., None] * Ph
        A = np.eye(STATES) - K[..., :, None] * h
        self.x = self.x + K * nu[..., None]
        P = A @ self.P @ np.swapaxes(A, -1, -2) + noise[..., None, None] * K[..., :, None] * K[..., None, :]
        self.P = 0.5 * (P + np.swapaxes(P, -1, -2))
