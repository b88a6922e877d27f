"""Making a reference: the profile of an approach, and the limits of the monitor's tests from simulated approaches.

    profile   z_ref, s_ref = mean and sigma over draws of track (15 m), height (5 m), attitude and elevation error;
              sigma not below 0.5 m and multiplied by sqrt((n - 1) / chi2_0.05(n - 1)), so that few draws are not
              taken for certainty
    l_c       integral scale of the residuals of nominal approaches, between ds and L / 8
    limits    t_i = quantile 1 - Pfa / 4 of the maxima of T_i over whole nominal approaches, all windows, dependence
              included: a Gumbel distribution fitted by L-moments to the maxima, and not below the largest of them;
              with a 95 % bootstrap interval.  (A generalised-Pareto tail needs more approaches than are flown here.)

Sources: Spiegel 2018, 7.2.2 (profile from the sensor model); Hosking 1990 (L-moments); Wilson and Hilferty 1931
(chi-square quantile).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.config import Approach
from fti.errors import ConfigError
from fti.hil.approaches import NOMINAL, AltimeterModel, Flown, draw_profile, fly, simulate
from fti.nav.integrity.approach import Airfield, ApproachPath
from fti.nav.integrity.monitor import ClearanceMonitor
from fti.nav.integrity.reference import LEAST_CORRELATIONS, Header, Limits, Profile, Reference, grid
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

DS_M = 5.0
WINDOW_M = 400.0
SD_FLOOR_M = 0.5
EULER_GAMMA = 0.5772156649015329
BOOTSTRAPS = 500
TESTS = ("t1", "t2", "t3", "t4")
METHOD = "Gumbel by L-moments on the maxima of each approach, quantile 1 - pfa/4, not below the largest maximum"

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class Plan:
    """What a reference is made from.  surface : its name; pfa : false alarms per approach, all tests together."""

    surface: str
    s_max: float = 7000.0
    draws: int = 100
    runs: int = 200
    seed: int = 1
    pfa: float = 0.01


@dataclass(frozen=True, eq=False)
class Surface:
    """Terrain as the sensor sees it, on the reference's grid [m]: mean and sigma over the draws, sigma of a sample."""

    s: Array
    z_ref: Array
    s_ref: Array
    s_alt: Array


def make_reference(
    airfield: Airfield, terrain: Terrain, altimeter: AltimeterModel, plan: Plan, progress: Progress
) -> Reference:
    """Profile, correlation length and limits.  progress(what, done, of) is called as the work goes on.

    Raises ConfigError where the terrain does not cover the approach.
    """
    path = ApproachPath(airfield)
    surface = make_surface(path, terrain, altimeter, plan, progress)
    rng = np.random.default_rng([plan.seed, 2])
    flights = []
    for run in range(plan.runs):
        flights.append(simulate(path, terrain, altimeter, plan.s_max, rng))
        progress("nominal approaches", run + 1, plan.runs)
    correlation = correlation_length(surface, flights)
    reference = _without_limits(airfield, altimeter, plan, surface, correlation)
    maxima = []
    for run, flown in enumerate(flights):
        maxima.append(approach_maxima(reference, flown))
        progress("integrity monitor", run + 1, plan.runs)
    header = reference.header.model_copy(update={"limits": make_limits(plan, np.array(maxima))})
    return dataclasses.replace(reference, header=header)


def _without_limits(
    airfield: Airfield, altimeter: AltimeterModel, plan: Plan, surface: Surface, correlation: float
) -> Reference:
    """The reference with every limit at 1, so that ratios are the statistics themselves."""
    unlimited = _limits(plan, [1.0] * len(TESTS), [(1.0, 1.0)] * len(TESTS))
    profile = Profile(
        surface=plan.surface,
        ds_m=DS_M,
        s_max_m=plan.s_max,
        draws=plan.draws,
        seed=plan.seed,
        window_m=WINDOW_M,
        correlation_m=round(correlation, 1),
        datum_sd_m=NOMINAL.dem_bias,
    )
    header = Header(airfield=airfield, sensor=altimeter.sensor, profile=profile, limits=unlimited)
    return Reference(header, surface.s, surface.z_ref, surface.s_ref, surface.s_alt)


# ------------------------------------------------------------------------------------------------------- profile


def make_surface(
    path: ApproachPath, terrain: Terrain, altimeter: AltimeterModel, plan: Plan, progress: Progress
) -> Surface:
    """Mean and sigma of the terrain as the sensor sees it.  Raises ConfigError where it sees none."""
    s = grid(DS_M, plan.s_max)
    rng = np.random.default_rng([plan.seed, 1])
    draws = []
    for n in range(plan.draws):
        draws.append(draw_profile(path, terrain, altimeter, s, rng))
        progress("profile", n + 1, plan.draws)
    z = np.array(draws)
    blind = ~np.isfinite(z).all(axis=0)
    if blind.any():
        raise ConfigError(
            f"{path.airfield.name}: no return from {plan.surface!r} between {s[blind][0]:.0f} and "
            f"{s[blind][-1]:.0f} m before the intercept point; the profile must end before (s_max = {plan.s_max:.0f} m)"
        )
    sd = np.maximum(z.std(axis=0, ddof=1), SD_FLOOR_M) * few_draws_factor(plan.draws)
    z_ref = z.mean(axis=0)
    rounded = (np.round(values, 3) for values in (z_ref, sd, altimeter.sd(path.alt_path(s) - z_ref)))
    return Surface(s, *rounded)


def few_draws_factor(n: int) -> float:
    """sqrt((n - 1) / chi2_0.05(n - 1)): 1.65 for 10 draws; within 1.6 % from n = 5 (Wilson and Hilferty 1931)."""
    degrees = n - 1
    spread = 2.0 / (9.0 * degrees)
    return float((1.0 - spread - 1.6448536 * math.sqrt(spread)) ** -1.5)


# ------------------------------------------------------------------------------------------------- correlation length


def correlation_length(surface: Surface, flights: Sequence[Flown]) -> float:
    """Integral scale of the normalised residuals [m], within ds and L / 8: l_c = ds (1 + 2 sum rho)."""
    lags = round(WINDOW_M / DS_M)
    covariance = np.zeros(lags)
    for flown in flights:
        residual = _binned_residual(surface, flown)
        residual = residual[np.isfinite(residual)]
        covariance += [float(np.mean(residual[lag:] * residual[: len(residual) - lag])) for lag in range(lags)]
    rho = covariance[1:] / covariance[0]
    negative = np.flatnonzero(rho <= 0.0)
    until = int(negative[0]) if len(negative) else len(rho)
    scale = DS_M * (1.0 + 2.0 * float(rho[:until].sum()))
    return min(max(scale, DS_M), WINDOW_M / LEAST_CORRELATIONS)


def _binned_residual(surface: Surface, flown: Flown) -> Array:
    """(z - z_ref) / sigma in bins, without its mean over a window, NaN where there is no sample."""
    at = np.rint((flown.nav_s - surface.s[0]) / DS_M).astype(np.intp)
    inside = (at >= 0) & (at < len(surface.s))
    z = (flown.nav_alt - flown.agl)[inside]
    count = np.bincount(at[inside], minlength=len(surface.s))
    total = np.bincount(at[inside], z, minlength=len(surface.s))
    with np.errstate(invalid="ignore"):
        residual = (total / count - surface.z_ref) / np.hypot(surface.s_ref, surface.s_alt)
    flat = np.ones(round(WINDOW_M / DS_M) + 1)
    there = np.isfinite(residual)
    mean = np.convolve(np.where(there, residual, 0.0), flat, "same") / np.maximum(
        np.convolve(there.astype(float), flat, "same"), 1.0
    )
    return np.asarray(residual - mean)


# ------------------------------------------------------------------------------------------------------------ limits


def approach_maxima(reference: Reference, flown: Flown) -> Array:
    """The greatest T1, T2, T3, T4 of all windows of an approach, shape (4,); the limits of ``reference`` are all 1.

    T2 counts where the shift can be observable for any limit above 1: a superset of the windows in which it is judged.
    """
    monitor = ClearanceMonitor(reference, Approach(profile="", window_m=reference.header.profile.window_m))
    found = np.zeros(4)
    for output in fly(monitor, flown):
        ratios = (output.t1_ratio, output.t2_ratio, output.t3_ratio, output.t4_ratio)
        found = np.maximum(found, [0.0 if ratio is None else ratio for ratio in ratios])
    return found


def gumbel_quantile(maxima: Array, p: float) -> float:
    """Quantile p of a Gumbel distribution with the L-moments of ``maxima``, not below the largest of them."""
    ordered = np.sort(maxima)
    n = len(ordered)
    mean = float(ordered.mean())
    half_gini = 2.0 * float(np.arange(n) @ ordered) / (n * (n - 1)) - mean if n > 1 else 0.0
    scale = half_gini / math.log(2.0)
    fitted = mean - EULER_GAMMA * scale - scale * math.log(-math.log(p))
    return max(fitted, float(ordered[-1]))


def bootstrap_interval(maxima: Array, p: float, rng: np.random.Generator) -> tuple[float, float]:
    """95 % interval of ``gumbel_quantile`` over resampled approaches."""
    found = [gumbel_quantile(rng.choice(maxima, len(maxima)), p) for _ in range(BOOTSTRAPS)]
    low, high = np.quantile(found, (0.025, 0.975))
    return round(float(low), 3), round(float(high), 3)


def make_limits(plan: Plan, maxima: Array) -> Limits:
    """Limits from the maxima of the tests, shape (runs, 4)."""
    p = 1.0 - plan.pfa / len(TESTS)
    rng = np.random.default_rng([plan.seed, 3])
    values = [round(gumbel_quantile(column, p), 3) for column in maxima.T]
    intervals = [bootstrap_interval(column, p, rng) for column in maxima.T]
    return _limits(plan, values, intervals)


def _limits(plan: Plan, values: Sequence[float], intervals: Sequence[tuple[float, float]]) -> Limits:
    table = dict(zip(TESTS, values, strict=True)) | {
        f"{test}_interval": interval for test, interval in zip(TESTS, intervals, strict=True)
    }
    made = {"pfa": plan.pfa, "runs": plan.runs, "seed": plan.seed, "method": METHOD}
    return Limits.model_validate(table | made)
