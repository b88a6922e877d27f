"""Fixes of four methods from the same measurements."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Mask, Rng
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.altimetry.validity import DEVIATION_M, Sample, reasons_against, wide_beam_limits
from fti.nav.terrain_matching.apparent_surface import RangeTrack, apparent_surface
from fti.nav.terrain_matching.fix import match
from fti.nav.terrain_matching.likelihood import Likelihood
from fti.nav.terrain_matching.profile import MIN_SAMPLES, Profile
from fti.nav.terrain_matching.search import Lattice, search_lattice
from fti.nav.terrain_matching.window import TerrainWindow, cut_window
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import NARROW
from fti.ranging.radar.dome import random_turn
from fti.ranging.sensor import Poses
from fti.study.ppsan.exact import ExactLikelihood, best_shifts, search_grids
from fti.terrain.dem_error import DemError
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

SAMPLES, PERIOD_S, SPEED_MPS, NOISE_M = 125, 0.04, 170.0, 0.3
POSITION_ERROR_M, HEIGHT_SD_M = 5.0, 5.0
#: One sigma of measured minus predicted range with another beam than that of the model [m].
RANGE_SD_M = 1.0
#: Above the highest ground below the track [m]; largest roll [rad] and its period [s]; largest pitch [rad].
CLEARANCE_M, ROLL, ROLL_PERIOD_S, PITCH = (100.0, 300.0), (math.radians(10.0), math.radians(40.0)), (4.0, 12.0), 0.1
POSTS, CELL_M, RELIEF_M = 800, 5.0, (40.0, 3000.0, 30.0)
FIXES_PER_GROUND = 5
DEM_ERROR = DemError(noise_sd=1.5)
MODEL_ORDER, FINE_ORDER, TRUTH_ORDER = 20, 40, 40
#: Table 7.3: grid of methods 1 to 3; half power of the antenna off its boresight (fig. 7.19).
REACH_M, STEP_M, HALF_POWER_DEG = 50.0, 5.0, 15.0
#: Nodes of the maps [m], posts around the shifted samples [m].
NODE_M, MARGIN_M = 6.0, 1.0
#: Largest shift in each map [m], and the order of the dome of its model.
SAME_BEAM_MAPS = ((50, MODEL_ORDER), (15, MODEL_ORDER))
MAPS = ((50, MODEL_ORDER), (15, FINE_ORDER), (15, FINE_ORDER))
#: Share of the samples that are enough without those that deviate.
MIN_KEPT = 0.5
#: Exact search: steps on each side of the first grid and their size [m], its best shifts from which the search begins,
#: the grids that follow, and the RMS of the residuals over the noise of the altimeter that ends it.
FIRST_GRID, STARTS, GRIDS, MAX_NOISE_RATIO = (5, 2.0), 8, ((3, 0.6), (3, 0.2), (3, 0.2)), 2.0
METHODS = ("raw", "valid", "attitude", "closed")


class PositionError(NamedTuple):
    """Errors of a fix [m]."""

    horizontal: float
    vertical: float


@dataclass(frozen=True, eq=False)
class FixRun:
    """A run.

    inverted  : exact search with the beam and the elevation of the truth
    methods   : by name, with an independent beam; None without a fix
    coarse    : method 4 of them with the maps of the coarse model only
    elevation : method 4 with an independent beam and elevation with errors
    """

    inverted: PositionError
    methods: dict[str, PositionError | None]
    coarse: PositionError
    elevation: PositionError


@dataclass(frozen=True, eq=False)
class Track:
    """Navigated poses, and what is wrong with them.

    t, roll, pitch : of the samples [s], [rad]
    error : true minus navigated position [m];  height_error : navigated minus true height [m]
    """

    t: Array
    roll: Array
    pitch: Array
    poses: Poses
    error: Array
    height_error: float

    def measure(self, ground: Terrain, radar: RadarAltimeter, rng: Rng) -> RangeTrack:
        """Ranges at the true poses, without those samples that have none."""
        true = self.poses.origins_l + np.append(self.error, -self.height_error)
        returns = radar.measure(ground, Poses(true, self.poses.mats_ls, self.poses.vels_l))
        ranges = returns.slant_range + NOISE_M * rng.standard_normal(SAMPLES)
        return RangeTrack(self.t, self.poses, ranges, np.full(SAMPLES, RANGE_SD_M), HEIGHT_SD_M)

    def error_of(self, moves: Array) -> PositionError:
        """Errors of an estimate of true minus navigated position and height (3,) [m]."""
        return PositionError(float(np.hypot(*(moves[:2] - self.error))), float(abs(moves[2] + self.height_error)))


@functools.cache
def model(order: int = MODEL_ORDER) -> RadarAltimeter:
    """The altimeter as the methods know it.  order : of its dome"""
    return RadarAltimeter(antenna=NARROW, order=order)


@functools.lru_cache(maxsize=1)
def make_ground(number: int) -> Terrain:
    """Fractal relief."""
    (sd, longest, shortest), rng = RELIEF_M, np.random.default_rng([number, 15])
    return Terrain.from_array(
        fractal_relief((POSTS, POSTS), CELL_M, rng, sd=sd, max_size_m=longest, min_size_m=shortest), CELL_M
    )


def draw_track(ground: Terrain, rng: Rng) -> Track:
    """A straight track around the middle of the ground, rolling and pitching."""
    heading, middle = rng.uniform(0.0, math.tau), 0.5 * CELL_M * POSTS + rng.uniform(-200.0, 200.0, 2)
    t, ahead = np.asarray(PERIOD_S * np.arange(SAMPLES), np.float64), np.array([math.sin(heading), math.cos(heading)])
    east, north = middle[:, None] + SPEED_MPS * ahead[:, None] * (t - t.mean())
    up = np.full(SAMPLES, ground.up(east, north).max() + rng.uniform(*CLEARANCE_M))
    phases = rng.uniform(0.0, math.tau, 2)[:, None] + math.tau * t / rng.uniform(*ROLL_PERIOD_S, 2)[:, None]
    roll, pitch = np.array([rng.uniform(*ROLL), PITCH])[:, None] * np.sin(phases)
    mats = MAT_ENU_NED @ mat_from_rpy(roll, pitch, np.full(SAMPLES, heading))
    vels = np.broadcast_to(np.append(SPEED_MPS * ahead, 0.0), (SAMPLES, 3))
    error = rng.uniform(-POSITION_ERROR_M, POSITION_ERROR_M, 2)
    height_error = HEIGHT_SD_M * float(rng.standard_normal())
    navigated = np.column_stack((east, north, up + height_error))
    return Track(t, roll, pitch, Poses(navigated, mats, vels), error, height_error)


def fly(seed: int) -> FixRun:
    """One run."""
    rng, ground = np.random.default_rng([seed, 151]), make_ground(seed // FIXES_PER_GROUND)
    track = draw_track(ground, rng)
    truth = RadarAltimeter(antenna=NARROW, order=TRUTH_ORDER, turn=random_turn(rng))
    same, other = track.measure(ground, model(), rng), track.measure(ground, truth, rng)
    methods = {name: grid_fix(track, other, ground, name) for name in METHODS[:3]}
    return FixRun(
        inverted=track.error_of(refine_exactly(*fix_by_maps(same, ground, SAME_BEAM_MAPS), ground)),
        methods={**methods, METHODS[3]: track.error_of(fix_by_maps(other, ground)[0])},
        coarse=track.error_of(fix_by_maps(other, ground, SAME_BEAM_MAPS)[0]),
        elevation=track.error_of(fix_by_maps(other, DEM_ERROR.apply(ground, rng))[0]),
    )


def grid_fix(track: Track, measured: RangeTrack, ground: Terrain, method: str) -> PositionError | None:
    """Methods 1 to 3; None with fewer than ``MIN_SAMPLES``."""
    heights = measured.slant_range
    if method == "attitude":
        heights = heights * -track.poses.mats_ls[:, 2, 2]
    known = np.isfinite(heights)
    if method != "raw":
        known &= is_valid(track, measured, heights, ground, limits_attitude=method == "valid")
    if np.count_nonzero(known) < MIN_SAMPLES:
        return None
    east, north, up = track.poses.origins_l[known].T
    profile = Profile(track.t[known], east, north, up - heights[known], measured.sd[known], HEIGHT_SD_M)
    lattice = Lattice(round(REACH_M / STEP_M), round(STEP_M / CELL_M))
    window = cut_window(ground, profile, REACH_M + CELL_M)
    chi_square, (shifts_east, shifts_north) = search_lattice(window, profile, lattice), lattice.shifts(CELL_M)
    i, j = np.unravel_index(int(chi_square.argmin()), chi_square.shape)
    shift = np.array([shifts_east[j], shifts_north[i]])
    return track.error_of(np.append(shift, -Likelihood(window, profile).at(shift).height_error))


def is_valid(track: Track, measured: RangeTrack, heights: Array, ground: Terrain, *, limits_attitude: bool) -> Mask:
    """Mask of the samples that the rules of validity accept.  heights : above ground, as they are used [m]"""
    limits = wide_beam_limits((model().min_range, model().max_range), HALF_POWER_DEG, HALF_POWER_DEG)
    if not limits_attitude:
        limits = limits.model_copy(update={"max_roll_deg": 90.0, "max_pitch_deg": 90.0})
    predicted = model().measure(ground, track.poses)
    rays = np.einsum("nij,nj->ni", track.poses.mats_ls, predicted.direction_s)
    east, north, up = track.poses.origins_l.T
    normals = ground.normal(*(track.poses.origins_l + predicted.slant_range[:, None] * rays).T[:2])
    columns = {
        "value": measured.slant_range, "height": heights, "roll": track.roll, "pitch": track.pitch,
        "predicted": predicted.slant_range, "dispersion": predicted.dispersion,
        "incidence": np.arccos(np.clip(-(rays * normals).sum(axis=1), -1.0, 1.0)),
        "navigated": up - ground.up(east, north),
    }  # fmt: skip
    rows = np.stack(list(columns.values()), axis=-1).tolist()
    return np.array([not reasons_against(Sample(**dict(zip(columns, row, strict=True))), limits) for row in rows])


def fix_by_maps(
    measured: RangeTrack, ground: Terrain, maps: Sequence[tuple[int, int]] = MAPS
) -> tuple[Array, RangeTrack]:
    """Method 4: true minus navigated position and height (3,) [m], and the samples at the places that it found.

    The track is moved to a fix for the next map: an error of the height changes the range of a banked altimeter by
    more than itself, and a map has the attitude of a sample at the place of that sample.
    """
    moves, moved = np.zeros(3), select(measured, np.isfinite(measured.slant_range))
    for reach_m, order in maps:
        fix = match(range_map(moved, ground, reach_m, order), moved.profile, Lattice(reach_m))
        if np.isfinite(fix.shift).all():
            step = np.append(fix.shift, fix.up)
            moves, moved = moves + step, move(moved, step)
        moved = without_deviating(moved, ground, order)
    return moves, moved


def without_deviating(measured: RangeTrack, ground: Terrain, order: int) -> RangeTrack:
    """The samples that deviate from the model by no more than the rules of validity allow; all if few are left."""
    residuals = ExactLikelihood(model(order), ground, measured).residuals(np.zeros((1, 2)))[0]
    kept = np.abs(residuals - np.nanmedian(residuals)) <= DEVIATION_M["radar"]
    return select(measured, kept) if np.count_nonzero(kept) >= MIN_KEPT * len(kept) else measured


def refine_exactly(moves: Array, moved: RangeTrack, ground: Terrain) -> Array:
    """The fix with the model at each sample and shift, from that of ``fix_by_maps`` on.

    The likelihood has many minima: the search begins at the best shifts of the first grid, one after the other, until
    the residuals are the noise of the altimeter.
    """
    exact = ExactLikelihood(model(), ground, moved)
    best, smallest = moves, math.inf
    for start in best_shifts(exact.chi_square, *FIRST_GRID, STARTS):
        step = np.append(start, exact.up(start))
        found, at = moves + step, move(moved, step)
        for grid in GRIDS:
            here = ExactLikelihood(model(), ground, at)
            shift = search_grids(here.chi_square, np.zeros(2), [grid])
            step = np.append(shift, here.up(shift))
            found, at = found + step, move(at, step)
        chi_square = float(ExactLikelihood(model(), ground, at).chi_square(np.zeros((1, 2)))[0])
        if chi_square < smallest:
            best, smallest = found, chi_square
        if RANGE_SD_M * math.sqrt(chi_square / len(at.t)) <= MAX_NOISE_RATIO * NOISE_M:
            break
    return best


def range_map(measured: RangeTrack, ground: Terrain, reach_m: int, order: int = MODEL_ORDER) -> TerrainWindow:
    """The apparent surface with posts of 1 m."""
    return apparent_surface(model(order), ground, measured.poses, NODE_M, reach_m + MARGIN_M).refine(round(NODE_M))


def move(measured: RangeTrack, step: Array) -> RangeTrack:
    """The same ranges at other navigated positions.  step : (3,) [m]"""
    poses = measured.poses
    return replace(measured, poses=Poses(poses.origins_l + step, poses.mats_ls, poses.vels_l))


def select(measured: RangeTrack, samples: Mask) -> RangeTrack:
    """Some of the samples."""
    poses = measured.poses
    kept = Poses(poses.origins_l[samples], poses.mats_ls[samples], poses.vels_l[samples])
    return RangeTrack(
        measured.t[samples], kept, measured.slant_range[samples], measured.sd[samples], measured.height_sd
    )
