"""Flights whose position is found by matching, and the same with ground or instruments that mislead."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Ints, Rng
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.five_point_search import five_point_search
from fti.nav.terrain_matching.acquisition import FIXES, Acquisition
from fti.nav.terrain_matching.apparent_surface import RangeTrack, apparent_surface
from fti.nav.terrain_matching.fix import MatchPriors, match
from fti.nav.terrain_matching.likelihood import Likelihood
from fti.nav.terrain_matching.printed_metric import mean_absolute_residual
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.selection import select_samples
from fti.nav.terrain_matching.window import TerrainWindow, cut_window
from fti.ranging.laser import Laser
from fti.ranging.sensor import Poses
from fti.terrain.dem_error import DemError
from fti.terrain.demo_region import demo_region
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

SAMPLES, PERIOD_S, SPEED_MPS = 125, 0.2, 60.0
POSITION_SD_M, HEIGHT_SD_M, NOISE_M = 50.0, 5.0, 1.5
#: Shifts on each side [m]: five sigma of the position.
REACH_M = 250.0
#: Size and posts of a synthetic ground [m], and its relief: sigma, longest and shortest wave.
SIZE_M, CELL_M, RELIEF_M = 11000.0, 5.0, (40.0, 3000.0, 30.0)
#: Elevation of the package: posts [m], and the edges of the square that is used, in the frame of the demonstration.
REAL_CELL_M, REAL_EDGES_M = 40.0, (-14500.0, -5500.0, -8500.0, 500.0)
#: So many consecutive runs share a synthetic ground.
RUNS_PER_GROUND = 10
DEM_ERROR = DemError(noise_sd=1.5)
#: With it, neighbouring samples are not independent: 12 m between samples, correlation lengths of 30 m and 300 m.
INDEPENDENT_SHARE = 0.1
#: Budget of a selection of samples, and one sigma of the position [m] while it is tracked.
SELECTED, TRACKED_SD_M = 13, 5.0
SELECTIONS = ("informative", "steepest", "evenly spaced")
#: The banked flight: height above the highest ground [m], amplitude [rad] and period [s] of the roll.
HEIGHT_AGL_M, MAX_ROLL, ROLL_PERIOD_S = 80.0, math.radians(10.0), 8.0
WRONG_START_M = 2000.0
#: One sigma of the drift of the navigated position in the flights with drift [m/s].
DRIFT_SD_MPS = 0.5
#: The same that acquisition assumes [m/s].
DRIFT_MPS = 0.1


@functools.lru_cache(maxsize=2)
def synthetic_ground(number: int) -> Terrain:
    """Fractal relief."""
    shape, (sd, longest, shortest) = (int(SIZE_M / CELL_M),) * 2, RELIEF_M
    rng = np.random.default_rng([number, 41])
    return Terrain.from_array(
        fractal_relief(shape, CELL_M, rng, sd=sd, max_size_m=longest, min_size_m=shortest), CELL_M
    )


@functools.lru_cache(maxsize=1)
def real_ground() -> Terrain:
    """The elevation of the package around the demonstration."""
    west, east, south, north = REAL_EDGES_M
    places = np.meshgrid(np.arange(west, east, REAL_CELL_M), np.arange(south, north, REAL_CELL_M))
    return Terrain.from_array(demo_region().up(*places), REAL_CELL_M, east0=west, north0=south)


@dataclass(frozen=True, eq=False)
class Track:
    """A straight flight in several windows.

    middle       : of the first window [m];  heading : [rad]
    error        : true minus navigated position [m];  height_error : navigated minus true height [m]
    drift        : change of the error with time, which is zero in the middle of a window [m/s]
    """

    middle: Array
    heading: float
    error: Array
    height_error: float
    drift: Array

    def profile(self, ground: Terrain, rng: Rng, window: int = 0, *, is_stuck: bool = False) -> Profile:
        """The profile that is measured in a window."""
        t = np.asarray(PERIOD_S * (np.arange(SAMPLES) + window * SAMPLES), dtype=np.float64)
        along = SPEED_MPS * (t - 0.5 * PERIOD_S * SAMPLES)
        east, north = self.middle[0] + along * math.sin(self.heading), self.middle[1] + along * math.cos(self.heading)
        off_east, off_north = self.error[:, None] + self.drift[:, None] * (t - t.mean())
        up = ground.up(east + off_east, north + off_north)
        up = np.full(SAMPLES, up[0]) if is_stuck else up + NOISE_M * rng.standard_normal(SAMPLES)
        return Profile(t, east, north, up + self.height_error, np.full(SAMPLES, NOISE_M), HEIGHT_SD_M)


def draw_track(ground: Terrain, rng: Rng, error: Array, drift: Array | None = None) -> Track:
    """A track whose windows stay within the ground."""
    layer = ground.finest
    centre = np.array([0.5 * (layer.east0 + layer.east1), 0.5 * (layer.north0 + layer.north1)])
    heading = float(rng.uniform(0.0, math.tau))
    back = SPEED_MPS * PERIOD_S * SAMPLES * 0.5 * (FIXES - 1) * np.array([math.sin(heading), math.cos(heading)])
    middle, height_error = centre + rng.uniform(-500.0, 500.0, 2) - back, HEIGHT_SD_M * rng.standard_normal()
    return Track(middle, heading, error, height_error, np.zeros(2) if drift is None else drift)


@dataclass(frozen=True)
class GroundResult:
    """Errors over one ground [m, and over the bound or the covariance].

    error_over_bound : of the likelihood and the printed metric: error^2 in units of the Cramer-Rao bound, halved
    nees             : error^2 over covariance, halved; None if refused
    found_cell       : the five-point search ends in the cell of the exhaustive minimum
    tracked, lost    : as error_over_bound, of a tenth of the samples, for each of ``SELECTIONS``; the position is known
                       to ``TRACKED_SD_M`` and to ``POSITION_SD_M``
    """

    error_m: float
    error_over_bound: tuple[float, float]
    nees: float | None
    found_cell: bool
    tracked: tuple[float, ...]
    lost: tuple[float, ...]


@dataclass(frozen=True)
class Flight:
    """A run: over exact elevation, synthetic and real, over uncertain elevation, and banked.

    uncertain : error and sigma of the fix [m]; None if refused
    banked    : error of the fix with compensation for every shift, and without [m]
    drifting  : error of the fix with offset and drift, and with a constant offset [m]
    nees      : error^2 over covariance of the former, halved
    """

    synthetic: GroundResult
    real: GroundResult
    uncertain: tuple[float, float] | None
    banked: tuple[float, float]
    drifting: tuple[float, float]
    nees: float


def fly(seed: int) -> Flight:
    """One run."""
    rng = np.random.default_rng([seed, 4])
    ground = synthetic_ground(seed // RUNS_PER_GROUND)
    synthetic, real = _match_exact(ground, rng), _match_exact(real_ground(), rng)
    uncertain, banked = _match_uncertain(ground, rng), _match_banked(ground, rng)
    return Flight(synthetic, real, uncertain, banked, *_match_drifting(ground, rng))


def lattice_over(ground: Terrain) -> Lattice:
    """Shifts of every cell up to ``REACH_M``."""
    return Lattice(math.ceil(REACH_M / ground.finest.cell_m))


def window_around(terrain: Terrain, profile: Profile, lattice: Lattice) -> TerrainWindow:
    """The posts for all shifts of a lattice."""
    return cut_window(terrain, profile, (lattice.steps + 1) * terrain.finest.cell_m)


def _match_exact(ground: Terrain, rng: Rng) -> GroundResult:
    track = draw_track(ground, rng, POSITION_SD_M * rng.standard_normal(2))
    profile, lattice = track.profile(ground, rng), lattice_over(ground)
    window = window_around(ground, profile, lattice)
    fix = match(window, profile, lattice)
    likelihood = Likelihood(window, profile)
    information = likelihood.at(track.error).information
    printed = _exhaustive_minimum(lambda shifts: mean_absolute_residual(ground, profile, shifts), fix.shift)
    errors = [shift - track.error for shift in (fix.shift, printed)]
    five, _ = five_point_search(likelihood.chi_square, 2.0 * REACH_M, ground.finest.cell_m)
    off = errors[0]
    return GroundResult(
        error_m=float(np.hypot(*off)),
        error_over_bound=tuple(float(0.5 * each @ information @ each) for each in errors),  # type: ignore[arg-type]
        nees=float(0.5 * off @ np.linalg.solve(fix.cov, off)) if fix.is_usable else None,
        found_cell=bool(np.abs(five - fix.shift).max() <= ground.finest.cell_m),
        tracked=_match_selected(ground, rng, TRACKED_SD_M),
        lost=_match_selected(ground, rng, POSITION_SD_M),
    )


def _exhaustive_minimum(metric: Callable[[Array], Array], near: Array) -> Array:
    """The minimum of a metric within 20 m of a shift, on grids down to 0.1 m."""
    steps = np.linspace(-1.0, 1.0, 21)
    for reach_m in (20.0, 4.0, 1.0):
        shifts = near + reach_m * np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        near = shifts[metric(shifts).argmin()]
    return near


def select(kind: str, window: TerrainWindow, profile: Profile, position_sd: float) -> Ints:
    """Indices of ``SELECTED`` samples.  kind : of ``SELECTIONS``; the source has the steepest (section 4.2)"""
    if kind == "informative":
        return select_samples(window, profile, SELECTED, position_sd)
    if kind == "steepest":
        north, east = np.gradient(window.heights, window.cell_m)
        column, row = (np.rint(place).astype(np.int64) for place in window.places(profile.east, profile.north))
        return np.sort(np.hypot(east, north)[row, column].argsort()[-SELECTED:])
    return np.linspace(0, len(profile) - 1, SELECTED).round().astype(np.int64)


def _match_selected(ground: Terrain, rng: Rng, position_sd: float) -> tuple[float, ...]:
    """Errors^2 of fixes from few samples in units of the bound of all, halved, for each of ``SELECTIONS``."""
    track = draw_track(ground, rng, position_sd * rng.standard_normal(2))
    profile = track.profile(ground, rng)
    lattice = Lattice(max(3, math.ceil(5.0 * position_sd / ground.finest.cell_m)))
    window = window_around(ground, profile, lattice)
    information = Likelihood(window, profile).at(track.error).information
    errors = (
        match(window, profile.select(select(kind, window, profile, position_sd)), lattice).shift - track.error
        for kind in SELECTIONS
    )
    return tuple(float(0.5 * each @ information @ each) for each in errors)


def _match_uncertain(ground: Terrain, rng: Rng) -> tuple[float, float] | None:
    """Error and sigma of a fix with elevation that has errors [m]; None if refused."""
    track = draw_track(ground, rng, POSITION_SD_M * rng.standard_normal(2))
    profile, lattice = track.profile(ground, rng), lattice_over(ground)
    exact = window_around(ground, profile, lattice)
    elevation = DEM_ERROR.apply(
        Terrain.from_array(exact.heights, exact.cell_m, east0=exact.east0, north0=exact.north0), rng
    )
    sd = np.full(SAMPLES, math.hypot(NOISE_M, DEM_ERROR.noise_sd))
    profile = Profile(profile.t, profile.east, profile.north, profile.ground, sd, HEIGHT_SD_M)
    fix = match(window_around(elevation, profile, lattice), profile, lattice, priors=MatchPriors(INDEPENDENT_SHARE))
    if not fix.is_usable:
        return None
    return float(np.hypot(*(fix.shift - track.error))), float(np.sqrt(np.linalg.eigvalsh(fix.cov)[-1]))


@dataclass(frozen=True, eq=False)
class BankedFlight:
    """A profile of slant ranges, and what it is compared with.

    error : true minus navigated position [m];  plain, compensated : the ground, and as the laser sees it at each place
    """

    error: Array
    profile: Profile
    plain: TerrainWindow
    compensated: TerrainWindow
    lattice: Lattice


def draw_banked(ground: Terrain, rng: Rng) -> BankedFlight:
    """A flight with a laser that rolls with the aircraft."""
    track = draw_track(ground, rng, REACH_M / 10.0 * rng.uniform(-1.0, 1.0, 2))
    level = track.profile(ground, rng)
    roll = MAX_ROLL * np.sin(math.tau * level.t / ROLL_PERIOD_S)
    mats = MAT_ENU_NED @ mat_from_rpy(roll, np.zeros(SAMPLES), np.full(SAMPLES, track.heading))
    up = np.full(SAMPLES, level.ground.max() + HEIGHT_AGL_M)
    navigated = np.column_stack((level.east, level.north, up))
    true = navigated + np.append(track.error, 0.0)
    laser = Laser()
    ranges = laser.measure(ground, Poses.stationary(true, mats)).slant_range + NOISE_M * rng.standard_normal(SAMPLES)
    ranges -= track.height_error
    known = np.isfinite(ranges)
    poses, sd = Poses.stationary(navigated[known], mats[known]), np.full(np.count_nonzero(known), NOISE_M)
    measured = RangeTrack(level.t[known], poses, ranges[known], sd, HEIGHT_SD_M).profile
    lattice, cell_m = Lattice(10), ground.finest.cell_m
    margin_m = (lattice.steps + 1) * cell_m
    compensated = apparent_surface(laser, ground, poses, cell_m, margin_m)
    return BankedFlight(track.error, measured, cut_window(ground, measured, margin_m), compensated, lattice)


def _match_banked(ground: Terrain, rng: Rng) -> tuple[float, float]:
    """Errors of two fixes by a laser that rolls [m]: compensated for every shift, and slant ranges as heights."""
    flight = draw_banked(ground, rng)
    closed, plain = (match(window, flight.profile, flight.lattice) for window in (flight.compensated, flight.plain))
    return float(np.hypot(*(closed.shift - flight.error))), float(np.hypot(*(plain.shift - flight.error)))


def _match_drifting(ground: Terrain, rng: Rng) -> tuple[tuple[float, float], float]:
    """Errors of two fixes of a position that drifts [m]: offset and drift, offset only; error^2 over covariance."""
    drift = DRIFT_SD_MPS * rng.standard_normal(2)
    track = draw_track(ground, rng, POSITION_SD_M * rng.standard_normal(2), drift)
    profile, lattice = track.profile(ground, rng), lattice_over(ground)
    window = window_around(ground, profile, lattice)
    both, constant = (
        match(window, profile, lattice, priors=MatchPriors(drift_sd=DRIFT_SD_MPS)),
        match(window, profile, lattice),
    )
    off = both.shift - track.error
    errors = (float(np.hypot(*off)), float(np.hypot(*(constant.shift - track.error))))
    return errors, float(0.5 * off @ np.linalg.solve(both.cov, off))


# -------------------------------------------------------------------------------------------------- hostile cases


@dataclass(frozen=True)
class Confirmed:
    """A fix after acquisition.  error_m : its error;  distance_2 : error^2 over covariance"""

    error_m: float
    distance_2: float


@functools.lru_cache(maxsize=1)
def _flat_ground() -> Terrain:
    """The sea: waves of 0.2 m."""
    shape = (int(SIZE_M / CELL_M),) * 2
    return Terrain.from_array(0.2 * np.random.default_rng(3).standard_normal(shape), CELL_M)


@functools.lru_cache(maxsize=1)
def _repeated_ground() -> Terrain:
    """Dunes, 150 m apart both ways."""
    wave = 10.0 * np.sin(math.tau * CELL_M * np.arange(int(SIZE_M / CELL_M)) / 150.0)
    return Terrain.from_array(wave[:, None] + wave, CELL_M)


@dataclass(frozen=True)
class HostileCase:
    """An acquisition that may mislead.

    ground   : None: synthetic relief
    error_m  : distance of the true from the navigated position at the start; None: drawn with ``POSITION_SD_M``
    map_offset_m, position_sd_m : distance of the map from its place, and one sigma of the navigated position for each
    axis, which refuses fixes; None: no map is off, no position refuses
    """

    ground: Callable[[], Terrain] | None = None
    is_stuck: bool = False
    error_m: float | None = None
    map_offset_m: float = 0.0
    position_sd_m: float | None = None


GOOD = "good ground"
#: A horizontal sigma of 20 m is 14 m for each axis.  20 m for each axis, or 50 m, do not refuse every map that is off.
MAP_OFF, MAP_OFF_20, MAP_OFF_50 = "map 100 m off", "map 100 m off, axes of 20 m", "map 100 m off, axes of 50 m"
HOSTILE = {
    GOOD: HostileCase(),
    "flat ground": HostileCase(ground=_flat_ground),
    "repeated ground": HostileCase(ground=_repeated_ground),
    "stuck altimeter": HostileCase(is_stuck=True),
    "wrong start": HostileCase(error_m=WRONG_START_M),
    MAP_OFF: HostileCase(map_offset_m=100.0, position_sd_m=20.0 / math.sqrt(2.0)),
    MAP_OFF_20: HostileCase(map_offset_m=100.0, position_sd_m=20.0),
    MAP_OFF_50: HostileCase(map_offset_m=100.0, position_sd_m=50.0),
}


def fly_hostile(seed: int) -> dict[str, Confirmed | None]:
    """Acquisition in each case of ``HOSTILE``; None where it is not confirmed."""
    good = synthetic_ground(seed // RUNS_PER_GROUND)
    return {
        name: _acquire(case.ground() if case.ground else good, case, np.random.default_rng([seed, 5, number]))
        for number, (name, case) in enumerate(HOSTILE.items())
    }


def _acquire(ground: Terrain, case: HostileCase, rng: Rng) -> Confirmed | None:
    """The last of three fixes that agree; None if they do not, or if one is refused."""
    error = (case.position_sd_m or POSITION_SD_M) * rng.standard_normal(2)
    if case.error_m is not None:
        error = case.error_m * _direction(rng)
    track = draw_track(ground, rng, error + case.map_offset_m * _direction(rng))
    lattice, acquisition, confirmed = lattice_over(ground), Acquisition(DRIFT_MPS), None
    position_cov = None if case.position_sd_m is None else case.position_sd_m**2 * np.eye(2)
    for number in range(FIXES):
        profile = track.profile(ground, rng, number, is_stuck=case.is_stuck)
        fix = match(
            window_around(ground, profile, lattice), profile, lattice, priors=MatchPriors(position_cov=position_cov)
        )
        if not fix.is_usable:
            return None
        confirmed = acquisition.add(fix)
    if confirmed is None:
        return None
    off = confirmed.shift - error
    return Confirmed(float(np.hypot(*off)), float(off @ np.linalg.solve(confirmed.cov, off)))


def _direction(rng: Rng) -> Array:
    angle = rng.uniform(0.0, math.tau)
    return np.array([math.sin(angle), math.cos(angle)])
