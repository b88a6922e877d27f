"""Making a reference: the profile of an approach, and the limits of the monitor's tests from simulated approaches.

    profile   z_ref, s_ref = mean and sigma over draws of track (15 m), height (5 m), attitude and elevation error, or
              over recorded approaches (``fti.hil.references.recordings``); sigma not below 0.5 m and multiplied by
              sqrt((n - 1) / chi2_0.05(n - 1)), so that few draws are not taken for certainty
    l_c       integral scale of the residuals of nominal approaches, between ds and L / 8
    limits    t_i = quantile 1 - Pfa / 4 of the maxima of T_i over whole nominal approaches, all windows, dependence
              included (``fti.hil.references.tails``), with a 95 % bootstrap interval
    verified  other nominal approaches through the whole logic, states included: how many had an ALERT
    Pd        share of windows in ALERT when the aircraft flies 50, 100, 200 m beside the track and navigation says on
              it, by the part of the way in which they end

Sources: Spiegel 2018, 7.2.2 (profile from the sensor model); Wilson and Hilferty 1931 (chi-square quantile).
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from fti.config import Approach
from fti.errors import ConfigError
from fti.hil.references.approaches import NOMINAL, Flown, Ground, TerrainGround, draw_profile, fly, simulate, track_of
from fti.hil.references.range_map import map_ground
from fti.hil.references.tails import bootstrap_interval, upper_quantile
from fti.nav.integrity.monitor import OBSERVABLE_MARGIN, ClearanceMonitor
from fti.nav.integrity.reference import LEAST_CORRELATIONS, Detection, Header, Limits, Profile, Reference, grid
from fti.nav.integrity.scan import Scan, Scanner
from fti.types import IntegrityState

Array = NDArray[np.float64]
Argument = TypeVar("Argument")
Found = TypeVar("Found")

DS_M = 5.0
WINDOW_M = 400.0
SD_FLOOR_M = 0.5
TESTS = ("t1", "t2", "t3", "t4")
METHOD = "maxima of each approach, quantile 1 - pfa/4, generalised-Pareto tail by probability-weighted moments"
#: Approaches that the correlation length is found from.
CORRELATION_RUNS = 100
#: One in so many of the calibration's approaches is flown again, with another seed, to verify the limits.
VERIFY_EACH = 4
BESIDE_M = (50.0, 100.0, 200.0)
PART_M = 1000.0
#: Alert limits do not matter where only alarms count: those of the protection levels are kept out of the way.
ANY_LEVEL_M = 1e6

#: Told what is being done and the share of it that is done, 0 to 1.
Progress = Callable[[str, float], None]


class RunAll(Protocol):
    """Does a task for each argument, somewhere, and gives what it returns in their order."""

    def __call__(
        self, task: Callable[[Argument], Found], arguments: Iterable[Argument], progress: Callable[[float], None]
    ) -> list[Found]:
        """``progress`` is told the share that is done."""


def one_by_one(
    task: Callable[[Argument], Found], arguments: Iterable[Argument], progress: Callable[[float], None]
) -> list[Found]:
    """Here, one after the other."""
    todo, found = list(arguments), list[Found]()
    for argument in todo:
        found.append(task(argument))
        progress(len(found) / len(todo))
    return found


@dataclass(frozen=True, slots=True)
class Plan:
    """What a reference is made with.

    surface : name of the terrain or of the recordings, date : of their survey
    runs : simulated approaches for the limits      beside_runs : for each offset of the table of detection
    pfa : false alarms per approach, all tests together      pmd : missed detections
    """

    surface: str
    date: str
    made_from: Literal["terrain", "recordings"] = "terrain"
    s_max: float = 7000.0
    draws: int = 100
    runs: int = 2000
    beside_runs: int = 100
    seed: int = 1
    pfa: float = 0.01
    pmd: float = 1e-3

    def rng(self, *stream: int) -> np.random.Generator:
        """Random numbers of one purpose, the same for the same numbers."""
        return np.random.default_rng([self.seed, *stream])


@dataclass(frozen=True, eq=False)
class Surface:
    """Terrain as the sensor sees it, on the reference's grid [m]: mean and sigma over the draws, sigma of a sample."""

    s: Array
    z_ref: Array
    s_ref: Array
    s_alt: Array


def make_reference(ground: TerrainGround, plan: Plan, progress: Progress, run_all: RunAll = one_by_one) -> Reference:
    """From terrain and sensor model: profile, limits, table of detection.

    Raises ConfigError where the terrain does not cover the approach.
    """
    surface = make_surface(ground, plan, progress, run_all)
    mapped = map_ground(ground, plan.s_max, functools.partial(progress, "range map"))
    reference = calibrate(mapped, surface, plan, progress, run_all)
    offsets = [(sign * y, run) for y in BESIDE_M for sign in (-1, 1) for run in range(plan.beside_runs // 2)]
    task = functools.partial(_alerts_beside, ground, plan, reference)
    found = run_all(task, offsets, functools.partial(progress, "beside the track"))
    header = reference.header.model_copy(update={"detection": _detection(plan, found)})
    return dataclasses.replace(reference, header=header)


def calibrate(
    ground: Ground, surface: Surface, plan: Plan, progress: Progress, run_all: RunAll = one_by_one
) -> Reference:
    """The reference of a profile: correlation length, limits, and how they hold on other approaches."""
    some = range(min(CORRELATION_RUNS, plan.runs))
    covariances = run_all(
        functools.partial(_covariance, ground, plan, surface), some, functools.partial(progress, "correlation")
    )
    correlation = correlation_length(np.sum(covariances, axis=0))
    open_ended = _without_limits(ground, plan, surface, correlation)
    task = functools.partial(_maxima, ground, plan, Scanner(open_ended, _settings(open_ended)))
    maxima = np.array(run_all(task, range(plan.runs), functools.partial(progress, "nominal approaches")))
    limited = _with_limits(open_ended, make_limits(plan, maxima))
    others = range(max(plan.runs // VERIFY_EACH, 1))
    task_verify = functools.partial(_alarms, ground, plan, limited, Scanner(limited, _settings(limited)))
    alarms = run_all(task_verify, others, functools.partial(progress, "verification"))
    verified = {"verified_runs": len(alarms), "verified_alarms": sum(alarms)}
    return _with_limits(limited, limited.header.limits.model_copy(update=verified))


def _with_limits(reference: Reference, limits: Limits) -> Reference:
    return dataclasses.replace(reference, header=reference.header.model_copy(update={"limits": limits}))


def _without_limits(ground: Ground, plan: Plan, surface: Surface, correlation: float) -> Reference:
    """The reference with every limit at 1, so that ratios are the statistics themselves."""
    unlimited = _limits(plan, [1.0] * len(TESTS), [(1.0, 1.0)] * len(TESTS))
    profile = Profile(
        surface=plan.surface,
        made_from=plan.made_from,
        date=plan.date,
        ds_m=DS_M,
        s_max_m=plan.s_max,
        draws=plan.draws,
        seed=plan.seed,
        window_m=WINDOW_M,
        correlation_m=round(correlation, 1),
        datum_sd_m=NOMINAL.dem_bias,
    )
    header = Header(airfield=ground.path.airfield, sensor=ground.altimeter.sensor, profile=profile, limits=unlimited)
    return Reference(header, surface.s, surface.z_ref, surface.s_ref, surface.s_alt)


# ------------------------------------------------------------------------------------------------------- profile


def make_surface(ground: Ground, plan: Plan, progress: Progress, run_all: RunAll = one_by_one) -> Surface:
    """Mean and sigma of the terrain as the sensor sees it.  Raises ConfigError where it sees none."""
    s = grid(DS_M, plan.s_max)
    task = functools.partial(_draw, ground, plan, s)
    z = np.array(run_all(task, range(plan.draws), functools.partial(progress, "profile")))
    blind = ~np.isfinite(z).all(axis=0)
    if blind.any():
        raise ConfigError(
            f"{ground.path.airfield.name}: no return from {plan.surface!r} between {s[blind][0]:.0f} and "
            f"{s[blind][-1]:.0f} m before the intercept point; the profile must end before (s_max = {plan.s_max:.0f} m)"
        )
    return surface_of(ground, s, z)


def _draw(ground: Ground, plan: Plan, s: Array, n: int) -> Array:
    return draw_profile(ground, s, plan.rng(1, n))


def surface_of(ground: Ground, s: Array, z: Array) -> Surface:
    """From draws or recorded approaches z, shape (n, len(s)), n >= 5."""
    sd = np.maximum(z.std(axis=0, ddof=1), SD_FLOOR_M) * few_draws_factor(len(z))
    z_ref = z.mean(axis=0)
    rounded = (np.round(values, 3) for values in (z_ref, sd, ground.altimeter.sd(ground.path.alt_path(s) - z_ref)))
    return Surface(s, *rounded)


def few_draws_factor(n: int) -> float:
    """sqrt((n - 1) / chi2_0.05(n - 1)): 1.65 for 10 draws; within 1.6 % from n = 5 (Wilson and Hilferty 1931)."""
    degrees = n - 1
    spread = 2.0 / (9.0 * degrees)
    return float((1.0 - spread - 1.6448536 * math.sqrt(spread)) ** -1.5)


# ------------------------------------------------------------------------------------------------- correlation length


def correlation_length(covariance: Array) -> float:
    """Integral scale [m], within ds and L / 8: l_c = ds (1 + 2 sum rho) up to the first rho <= 0."""
    rho = covariance[1:] / covariance[0]
    negative = np.flatnonzero(rho <= 0.0)
    until = int(negative[0]) if len(negative) else len(rho)
    scale = DS_M * (1.0 + 2.0 * float(rho[:until].sum()))
    return min(max(scale, DS_M), WINDOW_M / LEAST_CORRELATIONS)


def _covariance(ground: Ground, plan: Plan, surface: Surface, run: int) -> Array:
    """Of the normalised residuals of an approach, by lag in bins up to a window."""
    residual = _binned_residual(surface, simulate(ground, plan.s_max, plan.rng(2, run)))
    return lagged_products(residual[np.isfinite(residual)])


def lagged_products(residual: Array) -> Array:
    """Mean product of residuals with those so many bins farther on, for lags up to a window."""
    lags = range(round(WINDOW_M / DS_M))
    return np.array([float(np.mean(residual[lag:] * residual[: len(residual) - lag])) for lag in lags])


def binned(s: Array, flown_s: Array, z: Array) -> Array:
    """Means of z in the bins around s, NaN where there is no sample."""
    at = np.rint((flown_s - s[0]) / DS_M).astype(np.intp)
    inside = (at >= 0) & (at < len(s))
    count = np.bincount(at[inside], minlength=len(s))
    total = np.bincount(at[inside], z[inside], minlength=len(s))
    with np.errstate(invalid="ignore"):
        return np.asarray(total / count)


def _binned_residual(surface: Surface, flown: Flown) -> Array:
    """(z - z_ref) / sigma in bins, without its mean over a window, NaN where there is no sample."""
    z = binned(surface.s, flown.nav_s, flown.nav_alt - flown.agl)
    residual = (z - surface.z_ref) / np.hypot(surface.s_ref, surface.s_alt)
    flat = np.ones(round(WINDOW_M / DS_M) + 1)
    there = np.isfinite(residual)
    mean = np.convolve(np.where(there, residual, 0.0), flat, "same") / np.maximum(
        np.convolve(there.astype(float), flat, "same"), 1.0
    )
    return np.asarray(residual - mean)


# ------------------------------------------------------------------------------------------------------------ limits


def make_monitor(reference: Reference) -> ClearanceMonitor:
    """A monitor whose protection levels keep no alarm from being counted."""
    return ClearanceMonitor(reference, _settings(reference))


def _settings(reference: Reference) -> Approach:
    return Approach(profile="", window_m=reference.header.profile.window_m, alert_v_m=ANY_LEVEL_M)


def approach_maxima(scan: Scan, alert_s: float) -> Array:
    """The greatest T1, T2, T3, T4 of all windows of an approach, shape (4,).

    T2 counts where the shift can be observable for any limit above 1: a superset of the windows in which it is judged.
    """
    observable = (scan.observability >= (1.0 + OBSERVABLE_MARGIN) ** 2) & (scan.shift_resolution <= alert_s)
    return np.array([scan.t1.max(), np.max(scan.t2 * observable), scan.t3.max(), scan.t4.max()])


def _maxima(ground: Ground, plan: Plan, scanner: Scanner, run: int) -> Array:
    flown = simulate(ground, plan.s_max, plan.rng(3, run))
    scan = scanner.scan(track_of(flown), flown.vertical_sd)
    if scan is None or not len(scan.s):
        raise ConfigError(f"{plan.surface}: a nominal approach leaves windows without samples: it cannot be monitored")
    return approach_maxima(scan, Approach(profile="").alert_s_m)


def may_alarm(scan: Scan | None, limits: Limits) -> bool:
    """Whether a statistic is above its limit, so that the alarm logic must be asked."""
    if scan is None:
        return True
    over = ((scan.t1, limits.t1), (scan.t2, limits.t2), (scan.t3, limits.t3), (scan.t4, limits.t4))
    return any(bool(np.any(values > limit)) for values, limit in over)


def _alarms(ground: Ground, plan: Plan, reference: Reference, scanner: Scanner, run: int) -> bool:
    """Whether there was an ALERT on a nominal approach that the limits were not made from."""
    flown = simulate(ground, plan.s_max, plan.rng(4, run))
    if not may_alarm(scanner.scan(track_of(flown), flown.vertical_sd), reference.header.limits):
        return False
    return any(output.state is IntegrityState.ALERT for output in fly(make_monitor(reference), flown))


def make_limits(plan: Plan, maxima: Array) -> Limits:
    """Limits from the maxima of the tests, shape (runs, 4)."""
    beyond, rng = plan.pfa / len(TESTS), plan.rng(5)
    values = [round(upper_quantile(column, beyond), 3) for column in maxima.T]
    intervals = [bootstrap_interval(column, beyond, rng) for column in maxima.T]
    return _limits(plan, values, [(round(low, 3), round(high, 3)) for low, high in intervals])


def _limits(plan: Plan, values: Sequence[float], intervals: Sequence[tuple[float, float]]) -> Limits:
    table = dict(zip(TESTS, values, strict=True)) | {
        f"{test}_interval": interval for test, interval in zip(TESTS, intervals, strict=True)
    }
    made = {"pfa": plan.pfa, "pmd": plan.pmd, "runs": plan.runs, "seed": plan.seed, "method": METHOD}
    return Limits.model_validate(table | made | {"verified_runs": 0, "verified_alarms": 0})


# --------------------------------------------------------------------------------------------------- beside the track


def _parts(plan: Plan) -> Array:
    """Begin of each part of the way [m], descending."""
    return np.asarray(PART_M * np.arange(math.ceil(plan.s_max / PART_M), 0, -1))


def _alerts_beside(ground: Ground, plan: Plan, reference: Reference, flight: tuple[float, int]) -> Array:
    """Windows in ALERT and windows judged, by part, shape (2, parts), flown ``flight[0]`` m beside the track."""
    beside, run = flight
    rng = plan.rng(6, round(abs(beside)), int(beside > 0), run)
    flown = simulate(ground, plan.s_max, rng, offset=lambda s: np.full_like(s, beside))
    flown = dataclasses.replace(flown, nav_y=flown.nav_y - beside)
    counts = np.zeros((2, len(_parts(plan))))
    for output in fly(make_monitor(reference), flown):
        if output.valid and output.s_end is not None:
            part = len(counts[0]) - 1 - int(output.s_end // PART_M)
            counts[:, part] += output.state is IntegrityState.ALERT, 1
    return counts


def _detection(plan: Plan, found: Sequence[Array]) -> Detection:
    counts = np.sum(np.reshape(np.array(found), (len(BESIDE_M), -1, *found[0].shape)), axis=1)
    share = np.round(counts[:, 0] / np.maximum(counts[:, 1], 1.0), 3)
    return Detection(
        y_m=BESIDE_M,
        s_m=tuple(_parts(plan).tolist()),
        pd=tuple(tuple(row) for row in share.tolist()),
        runs=2 * (plan.beside_runs // 2),
    )
