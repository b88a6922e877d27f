"""Bias, shift and lag of the measured ground against one elevation model.

    r_i = up_i(t_i - lag) - H(x_i(t_i - lag) + shift) - bias

up, x : measured point;  H : elevation.  bias is measured minus map: of altimeter, navigated height, datum and map
together.  shift is the place of the map relative to the position source: the map has each hill that much too far east
and north.  lag is how late the ranges are, in addition to the configured latency.

A lattice of shifts and lags gives the start, Gauss-Newton steps with Huber weights the end.  The covariance is that of
a bootstrap of groups of samples, because errors of elevation and position are correlated from sample to sample.
Sources: Huber 1964 (weights); Kuensch 1989 (blocks); Cameron, Gelbach and Miller 2011 (groups of two kinds).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Ints, Rng
from fti.post.terrain_judge.samples import MAX_LAG_S, MIN_GROUPS, RangeSamples
from fti.post.terrain_judge.surfaces import MeasuredSurface

#: Order of the parameters; shift and lag may be fixed to 0.
BIAS, EAST, NORTH, LAG = range(4)
ALL = (BIAS, EAST, NORTH, LAG)
WITHOUT_SHIFT, WITHOUT_LAG = (BIAS, LAG), (BIAS, EAST, NORTH)
#: The search: largest shift, each axis, and the steps of its lattice [m], [s]; samples that it uses.
REACH_M, STEP_M, STEP_S, LATTICE_SAMPLES = 150.0, 15.0, 0.5, 300
#: A shift of the lattice needs this share of its samples over known ground.
MIN_KNOWN = 0.5
#: Gauss-Newton: steps, largest step in steps of the lattice, convergence [m], [s].
MAX_STEPS, MAX_STRIDE, CONVERGED = 25, 1.0, np.array([1e-3, 1e-3, 1e-3, 1e-5])
#: Half the interval of the derivative by the lag [s].
LAG_STEP_S = 0.05
#: Limit of Huber's weights in sigma: 95 % efficiency with Gaussian errors.
HUBER = 1.345
#: Median absolute deviation to one sigma of Gaussian errors.
MAD_TO_SD = 1.4826
RESAMPLINGS = 2000
#: Smallest sigma of a residual [m]; an exact map has none.
MIN_SD_M = 1e-3


@dataclass(frozen=True, eq=False)
class MapFit:
    """The parameters of one elevation model.

    free   : parameters that were estimated; the others are 0
    values, cov : shape (4,), (4, 4) [m], [s], in the order bias, east, north, lag; cov is 0 where they are fixed
    residuals   : measured minus map minus bias (n,) [m]; NaN over unknown ground
    weights     : Huber's (n,); 0 over unknown ground
    by_lag      : derivative of the residuals by the lag (n,) [m/s]
    """

    free: tuple[int, ...]
    values: Array
    cov: Array
    residuals: Array
    weights: Array
    by_lag: Array

    @property
    def sds(self) -> Array:
        """One sigma of each parameter (4,)."""
        return np.asarray(np.sqrt(np.diag(self.cov)))

    @property
    def spread_m(self) -> float:
        """Robust sigma of the residuals [m]."""
        return robust_sd(self.residuals)

    @property
    def is_inside(self) -> bool:
        """Whether the solution is inside the search."""
        return bool(np.abs(self.values[[EAST, NORTH]]).max() < REACH_M and abs(self.values[LAG]) < MAX_LAG_S)

    @property
    def lag_correlation(self) -> float:
        """Largest absolute correlation of the lag with the shift in any direction."""
        shift, lag = self.cov[1:3, 1:3], self.cov[LAG, LAG]
        common = self.cov[1:3, LAG]
        return math.sqrt(max(float(common @ np.linalg.solve(shift, common)) / float(lag), 0.0))


def robust_sd(values: Array) -> float:
    """One sigma by the median absolute deviation; NaN values are left out, NaN of none."""
    known = values[np.isfinite(values)]
    return MAD_TO_SD * float(np.median(np.abs(known - np.median(known)))) if len(known) else math.nan


def fit_map(samples: RangeSamples, surface: MeasuredSurface, free: tuple[int, ...], rng: Rng) -> MapFit:
    """Estimate the free parameters.  Raises ValueError where no ground is known below the samples."""
    misfit = _Misfit(samples, surface)
    values = _refine(misfit, _search(misfit, free), free)
    residuals, jacobian = misfit.residuals(values), misfit.jacobian(values)
    weights = _huber(residuals)
    cov = np.zeros((4, 4))
    cov[np.ix_(free, free)] = _covariance(samples, residuals, jacobian[:, free], weights, rng)
    return MapFit(free, values, cov, residuals, weights, np.where(weights > 0.0, jacobian[:, LAG], 0.0))


@dataclass(frozen=True, eq=False)
class _Misfit:
    """Measured minus map, as a function of the parameters."""

    samples: RangeSamples
    surface: MeasuredSurface

    def residuals(self, values: Array) -> Array:
        """Shape (n,) [m]; NaN over unknown ground."""
        east, north, up = self.samples.measured(values[LAG]).T
        every = np.arange(len(self.samples))
        return np.asarray(up - self.surface.up(east + values[EAST], north + values[NORTH], every) - values[BIAS])

    def jacobian(self, values: Array) -> Array:
        """Derivatives of the residuals by the parameters, shape (n, 4)."""
        step = self.surface.step_m()
        columns = [-np.ones(len(self.samples))]
        for parameter, half in ((EAST, step), (NORTH, step), (LAG, LAG_STEP_S)):
            offset = np.zeros(4)
            offset[parameter] = half
            columns.append((self.residuals(values + offset) - self.residuals(values - offset)) / (2.0 * half))
        return np.column_stack(columns)

    def deviations(self, lag: float, shifts: Array, index: Ints) -> Array:
        """Mean absolute deviation for each shift (s, 2) without its mean, of the samples ``index``, shape (s,)."""
        east, north, up = self.samples.measured(lag, index).T
        rows = up - self.surface.up(east + shifts[:, :1], north + shifts[:, 1:], index)
        known = np.isfinite(rows)
        count = known.sum(axis=1)
        rows = np.where(known, rows, 0.0)
        mean = rows.sum(axis=1) / np.maximum(count, 1)
        sums = np.where(known, np.abs(rows - mean[:, None]), 0.0).sum(axis=1)
        return np.where(count >= MIN_KNOWN * max(count.max(), 1), sums / np.maximum(count, 1), np.inf)


def _search(misfit: _Misfit, free: tuple[int, ...]) -> Array:
    """The best node of the lattice."""
    size = len(misfit.samples)
    index = np.unique(np.linspace(0, size - 1, min(size, LATTICE_SAMPLES)).astype(np.int64))
    axis = STEP_M * np.arange(-round(REACH_M / STEP_M), round(REACH_M / STEP_M) + 1) if EAST in free else np.zeros(1)
    lags = STEP_S * np.arange(-round(MAX_LAG_S / STEP_S), round(MAX_LAG_S / STEP_S) + 1) if LAG in free else np.zeros(1)
    shifts = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    cost = np.array([misfit.deviations(float(lag), shifts, index) for lag in lags])
    best_lag, best_shift = np.unravel_index(np.argmin(cost), cost.shape)
    values = np.array([0.0, *shifts[best_shift], lags[best_lag]])
    residuals = misfit.residuals(values)
    if not np.isfinite(residuals).any():
        raise ValueError("no elevation is known below the measured ranges")
    values[BIAS] = np.nanmedian(residuals)
    return values


def _refine(misfit: _Misfit, values: Array, free: tuple[int, ...]) -> Array:
    """Gauss-Newton steps with Huber's weights."""
    limits = MAX_STRIDE * np.array([np.inf, STEP_M, STEP_M, STEP_S])
    columns = list(free)
    for _ in range(MAX_STEPS):
        residuals, jacobian = misfit.residuals(values), misfit.jacobian(values)[:, columns]
        weights = _huber(residuals) * np.isfinite(jacobian).all(axis=1)
        normal, right = _normal_equations(np.nan_to_num(residuals), np.nan_to_num(jacobian), weights)
        step = np.zeros(4)
        step[columns] = -_solve(normal, right)
        step *= min(1.0, float((limits / np.maximum(np.abs(step), 1e-12)).min()))
        values = values + step
        values[1:] = np.clip(values[1:], [-REACH_M, -REACH_M, -MAX_LAG_S], [REACH_M, REACH_M, MAX_LAG_S])
        if (np.abs(step) < CONVERGED).all():
            break
    return values


def _huber(residuals: Array) -> Array:
    """Weights; 0 of unknown residuals."""
    limit = HUBER * max(robust_sd(residuals), MIN_SD_M)
    distance = np.abs(residuals - np.nanmedian(residuals))
    return np.asarray(np.nan_to_num(limit / np.maximum(distance, limit)))


def _normal_equations(residuals: Array, jacobian: Array, weights: Array) -> tuple[Array, Array]:
    weighted = jacobian * weights[:, None]
    return weighted.T @ jacobian, weighted.T @ residuals


def _solve(normal: Array, right: Array) -> Array:
    """Solutions of normal equations (..., p, p), (..., p); a parameter without information keeps 0."""
    scale = np.sqrt(np.maximum(np.diagonal(normal, axis1=-2, axis2=-1), 1e-30))
    scaled = normal / (scale[..., :, None] * scale[..., None, :]) + 1e-9 * np.eye(normal.shape[-1])
    return np.asarray(np.linalg.solve(scaled, (right / scale)[..., None])[..., 0] / scale)


def _covariance(samples: RangeSamples, residuals: Array, jacobian: Array, weights: Array, rng: Rng) -> Array:
    """Covariance (p, p) of the parameters, linear around the solution: errors of the track plus those of the ground.

    Of the blocks of the track, plus what longer blocks add, plus what squares of the ground add (as with clusters of
    two kinds).  Infinite without ``MIN_GROUPS`` groups over known ground.
    """
    known = (weights > 0.0) & np.isfinite(jacobian).all(axis=1)
    size = jacobian.shape[1]
    weighted = jacobian[known] * weights[known, None]
    normals, rights = weighted[:, :, None] * jacobian[known][:, None, :], weighted * residuals[known, None]
    kinds = list[list[Array]]()
    for groups in (samples.time_groups, samples.ground_groups):
        sums = [(sum_groups(each[known], normals), sum_groups(each[known], rights)) for each in groups]
        kinds.append([_bootstrap(left, right, rng) for left, right in sums if len(left) >= MIN_GROUPS])
    if not kinds[0]:
        return np.full((size, size), np.inf)
    finest = kinds[0][0]
    scale = np.sqrt(np.diag(finest))
    unit = np.outer(scale, scale)
    total = finest / unit
    for covs in kinds:
        total = total + _increase(max((cov / unit for cov in covs), key=np.trace, default=finest / unit), finest / unit)
    return np.asarray(total * unit)


def _increase(cov: Array, base: Array) -> Array:
    """Positive part of a difference of covariances."""
    values, axes = np.linalg.eigh(cov - base)
    return np.asarray((axes * np.maximum(values, 0.0)) @ axes.T)


def sum_groups(numbers: Ints, values: Array) -> Array:
    """Sums of values (n, ...) over the samples of each group, (groups, ...)."""
    _, index = np.unique(numbers, return_inverse=True)
    sums = np.zeros((int(index.max(initial=-1)) + 1, *values.shape[1:]))
    np.add.at(sums, index, values)
    return sums


def _bootstrap(normals: Array, rights: Array, rng: Rng) -> Array:
    """Covariance of the solutions with groups that are drawn with replacement.

    With B groups its expectation is (B - p) / B of the covariance; a covariance that is estimated with B - p degrees of
    freedom gives Student's t, whose variance is (B - p) / (B - p - 2) of it.  Both are corrected.
    """
    count, size = rights.shape
    drawn = rng.multinomial(count, np.full(count, 1.0 / count), RESAMPLINGS).astype(np.float64)
    steps = _solve((drawn @ normals.reshape(count, -1)).reshape(-1, size, size), drawn @ rights)
    return np.asarray(np.cov(steps.T) * count / (count - size - 2))
