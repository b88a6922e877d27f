"""Indirect Kalman filter of the vertical channel, optimal or robust, of one flight or of many at once.

    optimal   every measurement counts (gate = inf)
    robust    one whose innovation lies outside the confidence region |nu| <= gate sigma_nu does not: x and P stay as
              predicted (Hajiyev, eq. 21 to 24, p = 0 or 1)

The source names no region.  ``GATE`` = 3: of sound measurements 0.27 % are refused, and of those whose noise is a
hundred times too large 2.4 % pass, being by chance too small to tell.

Refusing for ever would leave the filter alone with its own error, once that is larger than its sigma says.  So refusal
is bounded: when nothing has been taken for ``lockout_s``, the height's sigma grows by the median m of the last
``REFUSED_HISTORY`` refused innovations, that of the climb as if m had come in the time T alone, and the scatter s of these is
added to the noise of the measurement,

    P_HH + m^2,    P_WW + (m / T)^2,    R + s^2

and it is tried again.  Whether the inertial channel was wrong or the altimeter, no innovation can tell; the channel is
held to be, because it is the one that drifts.  Until ``MIN_ACCEPTED_IN_ROW`` measurements in a row have been taken after that, the
filter is not trusted: a source that scatters at random passes once and is refused again.

P is kept in Joseph's form.  Not-a-number never enters: such a measurement is not taken and not counted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.nav.vertical.error_model import CLIMB, HEIGHT, STATES

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Confidence region of the normalised innovation [sigma].
GATE = 3.0
#: Refused innovations that are remembered, and measurements in a row that restore trust.
REFUSED_HISTORY = 9
MIN_ACCEPTED_IN_ROW = 5
#: Median absolute deviation to one sigma of a normal distribution.
MAD_TO_SD = 1.4826


@dataclass(frozen=True, slots=True, eq=False)
class Innovation:
    """Measured minus predicted [m], its predicted sigma [m], and whether it was taken; shape (...)."""

    value: Array
    sd: Array
    accepted: Mask


class ErrorFilter:
    """Error states and their covariance.

    x         : ndarray, shape (..., 5)      estimated errors
    P         : ndarray, shape (..., 5, 5)   their covariance
    gate      : half the confidence region [sigma]; inf for the optimal filter
    lockout_s : nothing taken for so long opens the region; inf for never
    """

    def __init__(self, x: ArrayLike, P: ArrayLike, gate: float = GATE, lockout_s: float = math.inf) -> None:
        self.x = np.array(x, dtype=np.float64)
        self.P = np.array(P, dtype=np.float64)
        self._gate, self._lockout_s = gate, lockout_s
        runs = self.x.shape[:-1]
        self._alone_s = np.zeros(runs)
        self._refused = np.zeros((*runs, REFUSED_HISTORY))
        self._count = np.zeros(runs, dtype=np.int64)
        self._in_row = np.full(runs, MIN_ACCEPTED_IN_ROW)

    @property
    def is_trusted(self) -> Mask:
        """Whether the region has not been opened, or enough has been taken since."""
        return np.asarray(self._in_row >= MIN_ACCEPTED_IN_ROW)

    def predict(self, phi: Array, Q: Array, dt: float) -> None:
        """Go on by dt [s] (eq. 17, 19)."""
        self.x = self.x @ phi.T
        self.P = phi @ self.P @ phi.T + Q
        self._alone_s = self._alone_s + dt

    def update(self, z: ArrayLike, h: Array, r: float) -> Innovation:
        """Take a measurement z = h x + v (eq. 14 to 18), or leave it.

        z : float or ndarray, shape (...) [m];  h : shape (5,);  r : variance of v [m^2], >= 0
        """
        nu = np.asarray(np.asarray(z, dtype=np.float64) - self.x @ h)
        known = np.isfinite(nu)
        accepted = self._passes(nu, h, np.asarray(r))
        opened = known & ~accepted & (self._alone_s >= self._lockout_s) & (self._count >= REFUSED_HISTORY)
        noise = np.full(nu.shape, float(r))
        if opened.any():
            noise = self._open(opened, noise)
            accepted = accepted | (opened & self._passes(nu, h, noise))
        self._remember(nu, known & ~accepted, accepted)
        sd = np.sqrt(self._variance(h) + noise)
        self._correct(np.where(accepted, nu, 0.0), h, noise, accepted)
        return Innovation(nu, sd, accepted)

    def _variance(self, h: Array) -> Array:
        return np.asarray((self.P @ h) @ h)

    def _passes(self, nu: Array, h: Array, noise: Array) -> Mask:
        return np.asarray(np.isfinite(nu) & (np.abs(nu) <= self._gate * np.sqrt(self._variance(h) + noise)))

    def _open(self, opened: Mask, noise: Array) -> Array:
        """Let height and climb be as wrong as what was refused says; the noise with the scatter of it."""
        middle = np.median(self._refused, axis=-1)
        scatter = MAD_TO_SD * np.median(np.abs(self._refused - middle[..., None]), axis=-1)
        self.P[..., HEIGHT, HEIGHT] += np.where(opened, middle**2, 0.0)
        self.P[..., CLIMB, CLIMB] += np.where(opened, (middle / np.maximum(self._alone_s, 1.0)) ** 2, 0.0)
        self._in_row = np.where(opened, 0, self._in_row)
        self._alone_s = np.where(opened, 0.0, self._alone_s)
        return np.asarray(noise + np.where(opened, scatter**2, 0.0))

    def _remember(self, nu: Array, refused: Mask, accepted: Mask) -> None:
        if refused.any():
            shifted = np.concatenate([self._refused[..., 1:], np.where(refused, nu, 0.0)[..., None]], axis=-1)
            self._refused = np.where(refused[..., None], shifted, self._refused)
        self._count = np.where(accepted, 0, self._count + refused)
        self._alone_s = np.where(accepted, 0.0, self._alone_s)
        self._in_row = np.where(accepted, self._in_row + 1, np.where(refused & ~self.is_trusted, 0, self._in_row))

    def _correct(self, nu: Array, h: Array, noise: Array, accepted: Mask) -> None:
        """Joseph's form; with a gain of zero nothing changes."""
        Ph = self.P @ h
        K = np.where(accepted, 1.0 / (Ph @ h + noise), 0.0)[..., None] * Ph
        left = np.eye(STATES) - K[..., :, None] * h
        self.x = self.x + K * nu[..., None]
        P = left @ self.P @ np.swapaxes(left, -1, -2) + noise[..., None, None] * K[..., :, None] * K[..., None, :]
        self.P = 0.5 * (P + np.swapaxes(P, -1, -2))
