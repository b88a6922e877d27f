"""Fits, refusals and comparison of all elevation models with the ranges of one altimeter.

A shift of the map along the track and a lag of the altimeter change the residuals of one straight leg in the same way.
They are estimated together only where legs are ``MIN_ANGLE_DEG`` apart, weighted by what the lag changes there, and
no direction of the shift is correlated with the lag by more than ``MAX_CORRELATION``.  Otherwise each is estimated with
the other fixed to 0.

Two models are compared as given, bias and lag removed from each, and with their shifts removed too.  The mean
difference of their squared residuals has an interval by a bootstrap of groups of samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Codes, Ints, Rng
from fti.errors import ConfigError
from fti.post.terrain_judge.fit import ALL, REACH_M, WITHOUT_LAG, WITHOUT_SHIFT, MapFit, fit_map, robust_sd, sum_groups
from fti.post.terrain_judge.samples import MIN_GROUPS, RangeSamples
from fti.post.terrain_judge.surfaces import surface_of
from fti.terrain.terrain import Terrain

#: Angle between legs [deg], and the share of the information outside of a sector of that width.
MIN_ANGLE_DEG, MIN_SHARE = 60, 0.1
#: Width of the bins of headings [deg]; divides ``MIN_ANGLE_DEG``.
BIN_DEG = 5
#: Largest correlation of the lag with the shift in any direction.
MAX_CORRELATION = 0.9
#: Largest sigma of a shift that is an estimate [m]: half of the search.
MAX_SHIFT_SD_M = 0.5 * REACH_M
#: Residuals are limited to this many times the larger spread of two models before they are squared.
MAX_SPREADS = 5.0
RESAMPLINGS = 2000
PROBABILITY = 0.95
SEED = 0


@dataclass(frozen=True, eq=False)
class MapResult:
    """One elevation model.

    as_given : bias and lag, shift 0;  shifted : bias and shift, lag 0;  full : all together
    refusals : why shift and lag are not estimated together; empty: they are
    covered  : share of the samples over known ground
    """

    name: str
    terrain: Terrain
    covered: float
    as_given: MapFit
    shifted: MapFit
    full: MapFit
    refusals: tuple[str, ...]

    @property
    def best(self) -> MapFit:
        """The fit with the shift: with the lag where they are estimated together."""
        return self.shifted if self.refusals else self.full


@dataclass(frozen=True)
class MapDifference:
    """The first model against the second one.

    square_m2 : mean square residual of the second minus that of the first, > 0 where the first agrees better
    low, high : interval of it;  samples : over ground that both know
    """

    first: str
    second: str
    square_m2: float
    low: float
    high: float
    samples: int

    @property
    def better(self) -> str | None:
        """The model that agrees better; None where the interval contains 0."""
        if self.low > 0.0:
            return self.first
        return self.second if self.high < 0.0 else None


@dataclass(frozen=True)
class CoverRow:
    """Residuals of one model over one class of land cover.

    bias_m : median of measured minus map;  spread_m : robust sigma
    """

    name: str
    land_cover: int
    samples: int
    bias_m: float
    spread_m: float


@dataclass(frozen=True, eq=False)
class AltimeterResult:
    """All models with the ranges of one altimeter, the best one as given first.

    differences : as given, every pair;  shifted_differences : with the shifts removed
    """

    sensor: str
    samples: RangeSamples
    maps: tuple[MapResult, ...]
    differences: tuple[MapDifference, ...]
    shifted_differences: tuple[MapDifference, ...]
    cover: tuple[CoverRow, ...] = ()


def judge(
    sensor: str,
    samples: RangeSamples,
    terrains: Mapping[str, Terrain],
    classes: Codes | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> AltimeterResult:
    """Compare elevation models, by name, with the ranges of an altimeter.

    classes : of land cover below the samples (n,)
    Raises ConfigError for a model without elevation below the track.
    """
    rng = np.random.default_rng(SEED)
    maps = list[MapResult]()
    for name, terrain in terrains.items():
        try:
            maps.append(fit_terrain(name, samples, terrain, rng))
        except ValueError as error:
            raise ConfigError(f"{name}: {error} of {sensor!r}") from None
        progress(len(maps) / len(terrains))
    fits = [each.as_given for each in maps]
    maps.sort(key=lambda each: mean_square(fits, each.as_given))
    pairs = [(first, second) for i, first in enumerate(maps) for second in maps[i + 1 :]]
    groups = (*samples.time_groups, *samples.ground_groups)
    differences = [
        compare(groups, (first.name, first.as_given), (second.name, second.as_given), rng) for first, second in pairs
    ]
    shifted = [compare(groups, (first.name, first.best), (second.name, second.best), rng) for first, second in pairs]
    cover = () if classes is None else tuple(row for each in maps for row in cover_rows(each, classes))
    return AltimeterResult(sensor, samples, tuple(maps), tuple(differences), tuple(shifted), cover)


def fit_terrain(name: str, samples: RangeSamples, terrain: Terrain, rng: Rng) -> MapResult:
    """All fits of one model.  Raises ValueError where it has no elevation below the samples."""
    surface = surface_of(terrain, samples, REACH_M)
    as_given, shifted, full = (fit_map(samples, surface, free, rng) for free in (WITHOUT_SHIFT, WITHOUT_LAG, ALL))
    covered = float(np.isfinite(as_given.residuals).mean())
    return MapResult(name, terrain, covered, as_given, shifted, full, tuple(refusals(samples, full)))


def refusals(samples: RangeSamples, full: MapFit) -> list[str]:
    """Why shift and lag are not estimated together."""
    found = list[str]()
    if not np.isfinite(full.cov).all():
        blocks = len(np.unique(samples.blocks[full.weights > 0.0]))
        return [f"only {blocks} blocks of the track over known ground, {MIN_GROUPS} are needed for a sigma"]
    if not full.is_inside:
        found.append(f"no solution within {REACH_M:g} m")
    elif full.sds[1:3].max() > MAX_SHIFT_SD_M:
        found.append("the ground is too flat for a shift")
    share = sector_share(samples.track.velocities(samples.t - full.values[3]), full.weights * full.by_lag**2)
    if share > 1.0 - MIN_SHARE:
        found.append(f"no legs with headings {MIN_ANGLE_DEG} deg apart")
    if full.lag_correlation > MAX_CORRELATION:
        found.append(f"correlation of shift and lag {full.lag_correlation:.2f}, above {MAX_CORRELATION}")
    return found


def sector_share(velocities: Array, weights: Array) -> float:
    """Largest share of the weights whose headings are within a sector of ``MIN_ANGLE_DEG``.

    velocities : east, north (n, 2) [m/s]
    """
    headings = np.degrees(np.arctan2(velocities[:, 0], velocities[:, 1])) % 360.0
    bins, _ = np.histogram(headings, bins=360 // BIN_DEG, range=(0.0, 360.0), weights=weights)
    width = MIN_ANGLE_DEG // BIN_DEG
    sums = np.convolve(np.concatenate((bins, bins[: width - 1])), np.ones(width), "valid")
    return float(sums.max() / max(bins.sum(), 1e-30))


def mean_square(fits: list[MapFit], fit: MapFit) -> float:
    """Mean of the limited squared residuals of one fit, over ground that all fits know [m^2]; infinite without any."""
    common = np.isfinite([each.residuals for each in fits]).all(axis=0)
    limit = MAX_SPREADS * max(each.spread_m for each in fits)
    squares = np.minimum(fit.residuals[common] ** 2, limit**2)
    return float(squares.mean()) if len(squares) else np.inf


def compare(groups: Sequence[Ints], first: tuple[str, MapFit], second: tuple[str, MapFit], rng: Rng) -> MapDifference:
    """Paired difference of the squared residuals over ground that both know, with the widest interval of all groups.

    groups : numbers (n,) of the groups of samples, of several kinds
    """
    one, other = first[1].residuals, second[1].residuals
    common = np.isfinite(one) & np.isfinite(other)
    limit = (MAX_SPREADS * max(robust_sd(one), robust_sd(other))) ** 2
    difference = np.minimum(other[common] ** 2, limit) - np.minimum(one[common] ** 2, limit)
    intervals = [_interval(difference, numbers[common], rng) for numbers in groups]
    intervals = [ends for ends in intervals if np.isfinite(ends).all()]
    low, high = max(intervals, key=lambda ends: ends[1] - ends[0], default=(-np.inf, np.inf))
    mean = float(difference.mean()) if len(difference) else np.nan
    return MapDifference(first[0], second[0], mean, low, high, len(difference))


def _interval(values: Array, numbers: Ints, rng: Rng) -> tuple[float, float]:
    """Interval of the mean by groups that are drawn with replacement; infinite with fewer than ``MIN_GROUPS``."""
    sums, counts = sum_groups(numbers, values), sum_groups(numbers, np.ones(len(values)))
    if len(sums) < MIN_GROUPS:
        return -np.inf, np.inf
    drawn = rng.multinomial(len(sums), np.full(len(sums), 1.0 / len(sums)), RESAMPLINGS)
    low, high = np.quantile((drawn @ sums) / (drawn @ counts), [0.5 * (1.0 - PROBABILITY), 0.5 * (1.0 + PROBABILITY)])
    return float(low), float(high)


def cover_rows(result: MapResult, classes: Codes) -> list[CoverRow]:
    """One row for each class of land cover."""
    fit = result.best
    rows = list[CoverRow]()
    for number in np.unique(classes):
        residuals = fit.residuals[(classes == number) & np.isfinite(fit.residuals)]
        if len(residuals):
            bias = float(np.median(residuals)) + float(fit.values[0])
            rows.append(CoverRow(result.name, int(number), len(residuals), bias, robust_sd(residuals)))
    return rows
