"""The profile of an approach: terrain measured by the sensor, its sigma, and the correlation length of residuals.

    profile   z_ref, s_ref = mean and sigma over draws of receiver, track, height, attitude and elevation error, or
              over recorded approaches (``recorded_approaches``); sigma at least 0.5 m, multiplied by
              sqrt((n - 1) / chi2_0.05(n - 1)) because of the small number of draws
    l_c       integral scale of the residuals of nominal approaches, between ds and L / 8

Sources: Spiegel 2018, 7.2.2 (profile from the sensor model); Wilson and Hilferty 1931 (chi-square quantile).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.errors import ConfigError
from fti.hil.approach_reference.approaches import ApproachGround, SimulatedApproach, draw_profile, simulate
from fti.hil.approach_reference.options import WINDOW_M, Progress, ReferenceOptions, TaskRunner, run_serially
from fti.nav.integrity.reference import MIN_CORRELATIONS, grid

DS_M = 5.0
SD_FLOOR_M = 0.5


@dataclass(frozen=True, eq=False)
class Surface:
    """Terrain measured by the sensor, on the reference grid [m]: mean and sigma of the draws, sigma of a sample."""

    s: Array
    z_ref: Array
    s_ref: Array
    s_alt: Array


def make_surface(
    ground: ApproachGround, plan: ReferenceOptions, progress: Progress, run_all: TaskRunner = run_serially
) -> Surface:
    """Mean and sigma of the terrain measured by the sensor.  Raises ConfigError if a place has no return."""
    s = grid(DS_M, plan.s_max)
    task = functools.partial(_draw, ground, plan, s)
    z = np.array(run_all(task, range(plan.draws), functools.partial(progress, "profile")))
    blind = ~np.isfinite(z).all(axis=0)
    if blind.any():
        raise ConfigError(
            f"{ground.path.airfield.name}: no return from {plan.surface!r} between {s[blind][0]:.0f} and "
            f"{s[blind][-1]:.0f} m before the intercept point; the profile (s_max = {plan.s_max:.0f} m) must be shorter"
        )
    return surface_of(ground, s, z)


def _draw(ground: ApproachGround, plan: ReferenceOptions, s: Array, n: int) -> Array:
    return draw_profile(ground, s, plan.rng(1, n), plan.spread)


def surface_of(ground: ApproachGround, s: Array, z: Array, mean: Array | None = None) -> Surface:
    """Surface of draws or recorded approaches z, shape (n, len(s)), n >= 5; NaN where an approach has no height.

    mean : the profile, shape (len(s),); None: the mean of z at each place
    Each place needs two heights or more.
    """
    z_ref = z.mean(axis=0) if mean is None else mean
    count = np.isfinite(z).sum(axis=0)
    spread = np.sqrt(np.nansum((z - z_ref) ** 2, axis=0) / (count - 1))
    sd = np.maximum(spread, SD_FLOOR_M) * few_draws_factor(count)
    rounded = (np.round(values, 3) for values in (z_ref, sd, ground.altimeter.sd(ground.path.alt_path(s) - z_ref)))
    return Surface(s, *rounded)


def few_draws_factor(n: ArrayLike) -> Array:
    """sqrt((n - 1) / chi2_0.05(n - 1)): 1.65 for 10 draws (Wilson and Hilferty 1931).

    Within 1.6 % from n = 5; too large by 4 % for 4 and by 14 % for 3.
    """
    degrees = np.asarray(n) - 1.0
    spread = 2.0 / (9.0 * degrees)
    return np.asarray((1.0 - spread - 1.6448536 * np.sqrt(spread)) ** -1.5)


def correlation_length(covariance: Array) -> float:
    """Integral scale [m], within ds and L / 8: l_c = ds (1 + 2 sum rho) up to the first rho <= 0."""
    rho = covariance[1:] / covariance[0]
    negative = np.flatnonzero(rho <= 0.0)
    until = int(negative[0]) if len(negative) else len(rho)
    scale = DS_M * (1.0 + 2.0 * float(rho[:until].sum()))
    return min(max(scale, DS_M), WINDOW_M / MIN_CORRELATIONS)


def residual_covariance(ground: ApproachGround, plan: ReferenceOptions, surface: Surface, run: int) -> Array:
    """Covariance of the normalised residuals of an approach, by lag in bins up to a window."""
    residual = _binned_residual(
        surface, plan.nav_noise, simulate(ground, plan.s_max, plan.rng(2, run), spread=plan.spread)
    )
    return lagged_products(residual[np.isfinite(residual)])


def lagged_products(residual: Array) -> Array:
    """Mean product of residuals at each lag in bins, up to a window."""
    lags = range(round(WINDOW_M / DS_M))
    return np.array([float(np.mean(residual[lag:] * residual[: len(residual) - lag])) for lag in lags])


def bin_means(s: Array, sample_s: Array, z: Array) -> Array:
    """Means of z in bins centred on s; NaN in empty bins."""
    at = np.rint((sample_s - s[0]) / DS_M).astype(np.intp)
    inside = (at >= 0) & (at < len(s))
    count = np.bincount(at[inside], minlength=len(s))
    total = np.bincount(at[inside], z[inside], minlength=len(s))
    with np.errstate(invalid="ignore"):
        return np.asarray(total / count)


def _binned_residual(surface: Surface, nav_noise: float, approach: SimulatedApproach) -> Array:
    """(z - z_ref) / sigma in bins, minus its mean over a window; NaN in empty bins."""
    z = bin_means(surface.s, approach.nav_s, approach.nav_alt - approach.agl)
    residual = (z - surface.z_ref) / np.sqrt(surface.s_ref**2 + surface.s_alt**2 + nav_noise**2)
    flat = np.ones(round(WINDOW_M / DS_M) + 1)
    known = np.isfinite(residual)
    mean = np.convolve(np.where(known, residual, 0.0), flat, "same") / np.maximum(
        np.convolve(known.astype(float), flat, "same"), 1.0
    )
    return np.asarray(residual - mean)
