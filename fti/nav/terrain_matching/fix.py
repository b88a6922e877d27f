"""The fix: the shift with the smallest chi-square, its covariance, and the reasons to refuse it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from fti.arrays import Array, Ints, Mask
from fti.nav.terrain_matching.likelihood import Likelihood, Minimum
from fti.nav.terrain_matching.profile import MIN_SAMPLES, Profile
from fti.nav.terrain_matching.search import Lattice, search_lattice
from fti.nav.terrain_matching.window import TerrainWindow

#: Parameters without a prior: two shifts.  Height error and drift have priors, which count as observations.
PARAMETERS = 2
#: Minima of the lattice that are refined; a minimum this far above the smallest one (scaled chi-square) cannot win.
MAX_CANDIDATES, MAX_EXCESS = 8, 60.0
#: Steps of the refinement of a minimum, and the change [m] that ends it.
MAX_ITERATIONS, RESOLUTION_M = 12, 0.01
#: Refinements of a minimum in which the residuals become linear at the drift of the one before.
DRIFT_ITERATIONS = 3
#: The likelihood around a minimum is integrated up to so many sigma, with so many shifts for each axis.
MOMENT_SIGMAS, MOMENT_STEPS = 4.0, 17
#: Least variance of an axis, in units of that of a linear surface.
MIN_VARIANCE = 0.25
#: Probability of shifts whose chi-square is unknown, for a linear surface; above, the fix is at the edge.
MAX_UNKNOWN = 1e-3
#: The terrain must explain the profile better than level ground does, by so much chi-square: over a level sea the
#: slopes of a map with errors are those errors.
MIN_CHI_SQUARE_REDUCTION = 25.0
#: Another minimum within this distance [sigma] belongs to the same fix.
SAME_SIGMAS = 5.0


class Refusal(StrEnum):
    """Why a fix must not be used.

    UNKNOWN_GROUND : less than ``MIN_SAMPLES`` samples are over known ground for every shift of the lattice
    FLAT       : the ground does not determine a position
    AT_EDGE    : the shifts end within the uncertainty of the fix
    RESIDUAL   : the profile does not fit the ground
    AMBIGUOUS  : another shift is almost as probable
    DISAGREES  : with the navigated position and its covariance
    """

    UNKNOWN_GROUND = "unknown_ground"
    FLAT = "flat"
    AT_EDGE = "at_edge"
    RESIDUAL = "residual"
    AMBIGUOUS = "ambiguous"
    DISAGREES = "disagrees"


@dataclass(frozen=True, slots=True)
class MatchLimits:
    """When a fix is refused.

    max_sd_m  : one sigma of the fix along the weaker axis [m]; above: ``FLAT``
    ambiguity : probability of the next minimum over that of the best; above: ``AMBIGUOUS``
    residual_sigmas : of the residual's chi-square beyond its expectation; above: ``RESIDUAL``
    distance_2 : square of the distance from the navigated position [sigma^2]; above: ``DISAGREES``.  99.9 % of two
    dimensions
    """

    max_sd_m: float = 30.0
    ambiguity: float = 1e-3
    residual_sigmas: float = 4.0
    distance_2: float = 13.8


USUAL_LIMITS = MatchLimits()


@dataclass(frozen=True, eq=False)
class MatchPriors:
    """What is known of the errors of a profile and of the navigated position.

    independent_share : number of independent errors over the number of samples, in (0, 1]: errors of elevation are
    correlated over tens of metres, and such samples count less
    drift_sd : one sigma of the drift of the navigated position for each axis [m/s]; 0: it does not drift
    position_cov : covariance of the navigated position, shape (2, 2) [m^2]; None: a fix at any distance is used.  It
    does not move the fix; a minimum that it makes less probable than the best one is less of an ambiguity
    """

    independent_share: float = 1.0
    drift_sd: float = 0.0
    position_cov: Array | None = None


NO_PRIORS = MatchPriors()


@dataclass(frozen=True, eq=False)
class MatchFix:
    """Result of one profile.

    t          : middle of the profile [s];  a fix refers to the position at this time
    shift      : true minus navigated position, east and north [m]; NaN where the ground is unknown
    cov        : its covariance [m^2]
    up         : true minus navigated height [m];  up_sd : one sigma of it [m]
    drift      : change of the shift with time, east and north [m/s]; 0 if none is estimated
    ambiguity  : probability of the next minimum over that of the best
    noise_ratio : RMS of the residuals over their stated sigma, at least 1; cov contains it
    refusals   : empty: the fix may be used
    """

    t: float
    shift: Array
    cov: Array
    up: float
    up_sd: float
    drift: Array
    ambiguity: float
    noise_ratio: float
    refusals: frozenset[Refusal]

    @property
    def is_usable(self) -> bool:
        """Whether nothing refuses it."""
        return not self.refusals


def match(
    window: TerrainWindow,
    profile: Profile,
    lattice: Lattice,
    limits: MatchLimits = USUAL_LIMITS,
    priors: MatchPriors = NO_PRIORS,
) -> MatchFix:
    """The fix of a profile, from the samples that are over known ground for every shift."""
    independent_share, position_cov = priors.independent_share, priors.position_cov
    known = _is_over_known_ground(window, profile, lattice)
    if np.count_nonzero(known) < MIN_SAMPLES:
        return without_position(profile, Refusal.UNKNOWN_GROUND)
    profile = profile.select(known)
    solutions = _solutions(window, profile, lattice, priors)
    likelihood, best = min(solutions, key=lambda solution: solution[1].chi_square)
    if best.step is None:
        return without_position(profile, Refusal.FLAT)
    noise = _noise_ratio(best.chi_square, profile)
    scale = independent_share / noise**2
    shift, cov, unknown = _moments(likelihood, best, scale)
    odds = [_odds(best, other, cov, scale) * _prior_odds(best, other, position_cov) for _, other in solutions]
    ambiguity = max(odds, default=0.0)
    tests = {
        Refusal.FLAT: math.sqrt(np.linalg.eigvalsh(cov)[-1]) > limits.max_sd_m
        or scale * (_level_chi_square(profile) - best.chi_square) < MIN_CHI_SQUARE_REDUCTION,
        Refusal.AT_EDGE: unknown > MAX_UNKNOWN or _is_at_edge(best.shift, lattice, window.cell_m),
        Refusal.RESIDUAL: best.chi_square > _max_chi_square(len(profile), independent_share, limits.residual_sigmas),
        Refusal.AMBIGUOUS: ambiguity > limits.ambiguity,
        Refusal.DISAGREES: disagrees(shift, cov, limits, position_cov),
    }
    return MatchFix(
        t=profile.middle,
        shift=shift,
        cov=cov,
        up=-float(best.height_error + best.height_slope @ (shift - best.shift)),
        up_sd=math.sqrt(best.height_variance / scale + best.height_slope @ cov @ best.height_slope),
        drift=best.drift,
        ambiguity=ambiguity,
        noise_ratio=noise,
        refusals=frozenset(reason for reason, applies in tests.items() if applies),
    )


def _is_over_known_ground(window: TerrainWindow, profile: Profile, lattice: Lattice) -> Mask:
    """Mask of the samples that no shift of the lattice places over unknown ground."""
    count = np.pad(np.isnan(window.heights).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    if not count[-1, -1]:
        return np.ones(len(profile), dtype=bool)
    column, row = window.places(profile.east, profile.north)
    rows, columns = window.heights.shape
    west, east = _post_span(column, lattice, lattice.centre[0], columns)
    south, north = _post_span(row, lattice, lattice.centre[1], rows)
    return np.asarray(count[north, east] - count[south, east] - count[north, west] + count[south, west] == 0)


def _post_span(place: Array, lattice: Lattice, centre: int, posts: int) -> Ints:
    """First post, and the one after the last, that any shift of a lattice uses for samples at places."""
    reach = lattice.steps * lattice.stride
    first = np.floor(place).astype(np.int64) + centre - reach
    return np.clip([first, first + 2 * reach + 2], 0, posts)


def _level_chi_square(profile: Profile) -> float:
    """Chi-square of level ground of unknown height."""
    weight = profile.weight
    return float(weight @ (profile.ground - weight @ profile.ground / weight.sum()) ** 2)


def _noise_ratio(chi_square: float, profile: Profile) -> float:
    """RMS of the residuals over their stated sigma, at least 1."""
    return max(1.0, math.sqrt(chi_square / (len(profile) - PARAMETERS)))


def disagrees(shift: Array, cov: Array, limits: MatchLimits, position_cov: Array | None) -> bool:
    """Whether a fix lies too far from the navigated position; never without its covariance."""
    if position_cov is None:
        return False
    return bool(shift @ np.linalg.solve(position_cov + cov, shift) > limits.distance_2)


def without_position(profile: Profile, reason: Refusal) -> MatchFix:
    """The fix of a profile that gives no position."""
    shift, cov = np.full(2, np.nan), np.full((2, 2), np.inf)
    return MatchFix(profile.middle, shift, cov, math.nan, math.inf, np.zeros(2), 1.0, math.nan, frozenset({reason}))


def _solutions(
    window: TerrainWindow, profile: Profile, lattice: Lattice, priors: MatchPriors
) -> list[tuple[Likelihood, Minimum]]:
    """The smallest local minima within the lattice, each with the likelihood that is linear at its drift."""
    chi_square = search_lattice(window, profile, lattice)
    excess = MAX_EXCESS * _noise_ratio(float(chi_square.min()), profile) ** 2 / priors.independent_share
    starts = [_finest(window, profile, lattice, at) for at in _candidates(chi_square, lattice, window.cell_m, excess)]
    return [_solve(window, profile, start, priors.drift_sd) for start in starts]


def _solve(window: TerrainWindow, profile: Profile, start: Array, drift_sd: float) -> tuple[Likelihood, Minimum]:
    """The minimum near a shift; the last one within the window if the drift leads out of it."""
    likelihood = Likelihood(window, profile, drift_sd)
    at = _refine(likelihood, start, window.cell_m)
    for _ in range(DRIFT_ITERATIONS if drift_sd > 0.0 else 0):
        moved = Likelihood(window, profile, drift_sd, at.drift)
        if np.isnan(moved.chi_square(at.shift[None])[0]):
            break
        likelihood, at = moved, _refine(moved, at.shift, window.cell_m)
    return likelihood, at


def _candidates(chi_square: Array, lattice: Lattice, cell_m: float, excess: float) -> Array:
    """Shifts of the smallest local minima of the lattice [m], shape (n, 2)."""
    around = np.pad(chi_square, 1, constant_values=np.inf)
    rows, columns = chi_square.shape
    neighbours = [around[i : i + rows, j : j + columns] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    is_minimum = (chi_square <= np.minimum.reduce(neighbours)) & (chi_square <= chi_square.min() + excess)
    at_row, at_column = np.nonzero(is_minimum)
    order = np.argsort(chi_square[at_row, at_column], kind="stable")[:MAX_CANDIDATES]
    east, north = lattice.shifts(cell_m)
    return np.column_stack((east[at_column[order]], north[at_row[order]]))


def _refine(likelihood: Likelihood, start: Array, cell_m: float) -> Minimum:
    """The minimum near a shift, by Gauss-Newton steps of a cell at most; they end at ground without slopes."""
    at, max_step_m = likelihood.at(start), cell_m
    for _ in range(MAX_ITERATIONS):
        step = at.step
        if step is None:
            break
        length = float(np.hypot(*step))
        next_at = likelihood.at(at.shift + step * min(1.0, max_step_m / max(length, RESOLUTION_M)))
        if next_at.chi_square < at.chi_square:
            at = next_at
        else:
            max_step_m *= 0.5
        if min(length, max_step_m) < RESOLUTION_M:
            break
    return at


def _finest(window: TerrainWindow, profile: Profile, lattice: Lattice, start: Array) -> Array:
    """The best shift in whole cells around a shift of a lattice with a stride, within the lattice."""
    if lattice.stride == 1:
        return start
    inner = lattice.stride * (lattice.steps - 1)
    east, north = (
        min(max(round(at / window.cell_m), centre - inner), centre + inner)
        for at, centre in zip(start, lattice.centre, strict=True)
    )
    around = Lattice(lattice.stride, 1, (east, north))
    chi_square = search_lattice(window, profile, around)
    i, j = np.unravel_index(int(chi_square.argmin()), chi_square.shape)
    shifts_east, shifts_north = around.shifts(window.cell_m)
    return np.array([shifts_east[j], shifts_north[i]])


def _moments(likelihood: Likelihood, best: Minimum, scale: float) -> tuple[Array, Array, float]:
    """Mean and covariance of the likelihood around a minimum [m, m^2], and the probability of unknown shifts.

    The variance of an axis is at least ``MIN_VARIANCE`` of that for a linear surface.  The last is for such a surface.
    """
    root = np.linalg.cholesky(np.linalg.inv(scale * best.information))
    steps = np.linspace(-MOMENT_SIGMAS, MOMENT_SIGMAS, MOMENT_STEPS)
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    excess = likelihood.chi_square(best.shift + offsets @ root.T) - best.chi_square
    probability = np.where(np.isnan(excess), 0.0, np.exp(-0.5 * scale * np.maximum(excess, 0.0)))
    probability /= probability.sum()
    linear = np.exp(-0.5 * (offsets**2).sum(axis=1))
    unknown = float(linear[np.isnan(excess)].sum() / linear.sum())
    mean = probability @ offsets
    centred = offsets - mean
    variances, axes = np.linalg.eigh((probability[:, None] * centred).T @ centred)
    axes = root @ axes * np.sqrt(np.maximum(variances, MIN_VARIANCE))
    return best.shift + root @ mean, axes @ axes.T, unknown


def _odds(best: Minimum, other: Minimum, cov: Array, scale: float) -> float:
    """Probability of another minimum over that of the best, large for ground without slopes; 0 if it is the same."""
    away = other.shift - best.shift
    if other is best or away @ np.linalg.solve(cov, away) < SAME_SIGMAS**2:
        return 0.0
    area = math.sqrt(np.linalg.det(best.information) / max(np.linalg.det(other.information), 1e-30))
    return float(area * math.exp(-0.5 * scale * (other.chi_square - best.chi_square)))


def _prior_odds(best: Minimum, other: Minimum, position_cov: Array | None) -> float:
    """Prior probability of another minimum over that of the best, at most 1."""
    if position_cov is None:
        return 1.0
    of_best, of_other = (each.shift @ np.linalg.solve(position_cov, each.shift) for each in (best, other))
    return math.exp(-0.5 * max(0.0, float(of_other - of_best)))


def _is_at_edge(shift: Array, lattice: Lattice, cell_m: float) -> bool:
    """Whether the lattice ends within a step of a shift."""
    from_centre = np.abs(shift / cell_m - np.asarray(lattice.centre))
    return bool(from_centre.max() > lattice.stride * (lattice.steps - 1))


def _max_chi_square(samples: int, independent_share: float, sigmas: float) -> float:
    """Largest chi-square of residuals with their stated sigma, of which a share is independent."""
    freedom = max(1.0, independent_share * samples - PARAMETERS)
    return (samples - PARAMETERS) * (1.0 + sigmas * math.sqrt(2.0 / freedom))
