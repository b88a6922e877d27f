"""Weighted least squares of ranges: satellites, DME stations, a height, a receiver's own fix.

    x = (position_e, c b)                            earth frame [m], and the receiver's clock error as a length [m]
    rho_i = |s_i - x| + c b,    d rho_i / dx = (-u_i, 1)      u_i: unit vector to the satellite
    rho_j = |s_j - x|,          d rho_j / dx = (-u_j, 0)      a DME station answers: no clock
    dx = (H^T W H)^-1 H^T W nu,     W = R^-1,     P = (H^T W H)^-1

Every observation gives ``equations``: measured minus predicted and H, both divided by sigma, so that W is the identity.
Gauss and Newton's iteration; arrays of measurements (many runs over one geometry) are solved at once.

The weighted dilution of precision of the source is D_w = P / sigma_G^2, with sigma_G of the satellites; its square root
times sigma_G is the sigma on P's diagonal.

Source: Koo, eq. 1 to 24 (errata: 22 must be diag(I, (sigma_G / sigma_D)^2 I); with W = R^-1, 24 is sigma_G times too
large).  Checked against: Monte Carlo (``fti study wdop``), tests/nav/test_radio_least_squares.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fti.arrays import Array
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import geodetic_from_ecef

#: Convergence limit of the iteration [m], and its maximum number of steps.
CLOSE_M, STEPS = 1e-4, 12
#: A position with a larger sigma in any direction is not valid [m]: ranges are not linear over such a length.
MAX_SD_M = 20_000.0


class FixObservation(Protocol):
    """One kind of observation."""

    def equations(self, x: Array) -> tuple[Array, Array]:
        """(nu, H) at x, shape (..., 4): nu (..., k) measured minus predicted, H (..., k, 4), both over sigma."""


@dataclass(frozen=True, slots=True, eq=False)
class RangeObservation:
    """Ranges to points.

    points_e : ndarray, shape (n, 3) [m]   measured : shape (..., n) [m]   sd : shape (n,) [m]
    clock    : whether they contain the error of the receiver's clock
    """

    points_e: Array
    measured: Array
    sd: Array
    clock: bool

    def equations(self, x: Array) -> tuple[Array, Array]:
        """As ``FixObservation`` has it."""
        line = self.points_e - x[..., None, :3]
        distance = np.linalg.norm(line, axis=-1)
        column = np.full((*distance.shape, 1), float(self.clock))
        H = np.concatenate((-line / distance[..., None], column), axis=-1)
        predicted = distance + (x[..., 3:] if self.clock else 0.0)
        return (self.measured - predicted) / self.sd, H / self.sd[:, None]


@dataclass(frozen=True, slots=True, eq=False)
class AltitudeObservation:
    """A height above the ellipsoid [m], shape (...), and its sigma [m], of the same shape or one for all."""

    measured: Array | float
    sd: Array | float

    def equations(self, x: Array) -> tuple[Array, Array]:
        """As ``FixObservation`` has it."""
        lat, lon, alt = geodetic_from_ecef(x[..., :3])
        up_e = -mat_en(lat, lon)[..., 2]
        H = np.concatenate((up_e, np.zeros((*up_e.shape[:-1], 1))), axis=-1)
        sd = np.asarray(self.sd)
        return ((self.measured - alt) / sd)[..., None], (H / sd[..., None])[..., None, :]


@dataclass(frozen=True, slots=True, eq=False)
class PositionObservation:
    """A position, shape (3,) [m], e frame, and its covariance, shape (3, 3) [m^2]."""

    pos_e: Array
    cov_e: Array

    def equations(self, x: Array) -> tuple[Array, Array]:
        """As ``FixObservation`` has it."""
        white = np.linalg.inv(np.linalg.cholesky(self.cov_e))
        nu = (self.pos_e - x[..., :3]) @ white.T
        return nu, np.broadcast_to(np.concatenate((white, np.zeros((3, 1))), axis=1), (*nu.shape, 4))


@dataclass(frozen=True, slots=True, eq=False)
class LeastSquaresSolution:
    """Solution of observations.

    x     : ndarray, shape (..., 4)      position, e frame, and clock error [m] (0 if no range contains it)
    cov   : ndarray, shape (..., 4, 4)   covariance of that [m^2]
    tests : ndarray, shape (..., k)      residual of each equation over its sigma; NaN without redundancy
    """

    x: Array
    cov: Array
    tests: Array

    def geodetic(self) -> tuple[Array, Array, Array]:
        """lat, lon [rad], alt above the ellipsoid [m]."""
        return geodetic_from_ecef(self.x[..., :3])

    def cov_n(self) -> Array:
        """Covariance of position north, east, down, shape (..., 3, 3) [m^2]."""
        lat, lon, _ = self.geodetic()
        turn = mat_en(lat, lon)
        return np.asarray(np.swapaxes(turn, -1, -2) @ self.cov[..., :3, :3] @ turn)


def solve(observations: Sequence[FixObservation], start_e: Array) -> LeastSquaresSolution | None:
    """The least-squares position near a start, shape (..., 3) [m].

    None if the observations do not determine a position, or the iteration does not converge.  Two stations alone have
    two solutions: it is the nearer one.
    """
    x = np.concatenate((start_e, np.zeros((*start_e.shape[:-1], 1))), axis=-1)
    for _ in range(STEPS):
        nu, H = _stacked(observations, x)
        cov = _covariance(H)
        if cov is None:
            return None
        dx = (cov @ (np.swapaxes(H, -1, -2) @ nu[..., None]))[..., 0]
        x = x + dx
        if np.abs(dx).max() <= CLOSE_M:
            return LeastSquaresSolution(x, cov, _tests(nu, H, dx, cov))
    return None


def covariance(observations: Sequence[FixObservation], pos_e: Array) -> Array | None:
    """P, shape (4, 4), of the observations at a position, independent of the measured values; None as above."""
    return _covariance(_stacked(observations, np.concatenate((pos_e, [0.0])))[1])


def _stacked(observations: Sequence[FixObservation], x: Array) -> tuple[Array, Array]:
    equations = [observation.equations(x) for observation in observations]
    if not equations:
        return np.zeros((*x.shape[:-1], 0)), np.zeros((*x.shape[:-1], 0, 4))
    return np.concatenate([nu for nu, _ in equations], axis=-1), np.concatenate([H for _, H in equations], axis=-2)


def _covariance(H: Array) -> Array | None:
    """(H^T H)^-1; if no equation contains the clock, it is left out and its variance is zero."""
    unknown = 4 if H.shape[-2] and np.any(H[..., 3]) else 3
    normal = np.swapaxes(H, -1, -2)[..., :unknown, :] @ H[..., :unknown]
    if not np.isfinite(normal).all() or np.linalg.eigvalsh(normal).min() < MAX_SD_M**-2:
        return None
    cov = np.zeros((*normal.shape[:-2], 4, 4))
    cov[..., :unknown, :unknown] = np.linalg.inv(normal)
    return cov


def _tests(nu: Array, H: Array, dx: Array, cov: Array) -> Array:
    """Residuals over sqrt(1 - h P h^T); NaN without redundancy (Baarda 1968)."""
    residual = nu - (H @ dx[..., None])[..., 0]
    redundancy = 1.0 - np.einsum("...ki,...ij,...kj->...k", H, cov, H)
    return np.where(redundancy > 1e-6, residual / np.sqrt(np.maximum(redundancy, 1e-6)), np.nan)
