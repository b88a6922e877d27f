"""Flights of an altimeter with all beams of table 7.6, and the fixes of some of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fti.arrays import Array, Ints, Rng
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy, rotate
from fti.nav.terrain_matching.beam_profile import BeamTrack, match_beams
from fti.nav.terrain_matching.fix import MatchFix, MatchPriors
from fti.nav.terrain_matching.likelihood import Likelihood
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import cut_window
from fti.ranging.laser import Laser
from fti.ranging.multibeam import BEAMS_ACROSS_DEG, beam_directions
from fti.ranging.sensor import Poses
from fti.terrain.terrain import Terrain

#: Numbers of beams, and all angles that one of them has [deg].
BEAM_SETS = tuple(BEAMS_ACROSS_DEG)
ANGLES_DEG = tuple(sorted({angle for angles in BEAMS_ACROSS_DEG.values() for angle in angles}))
DIRECTIONS = beam_directions(0.0, np.radians(ANGLES_DEG))
#: Columns of each set in arrays of all angles.
COLUMNS = {number: [ANGLES_DEG.index(angle) for angle in angles] for number, angles in BEAMS_ACROSS_DEG.items()}
LASER = Laser(max_range=3000.0)
NOISE_M, HEIGHT_SD_M = 1.5, 5.0
SPEED_MPS, CLEARANCE_M, HEIGHT_AGL_M = 60.0, 50.0, 300.0


@dataclass(frozen=True, eq=False)
class Flight:
    """Poses of a flight, and what all beams measure.

    t           : times [s], shape (K,);  navigated, true : poses of the sensor
    slant_range : with noise [m], shape (K, number of angles);  noise : their errors [m]
    """

    t: Array
    navigated: Poses
    true: Poses
    slant_range: Array
    noise: Array

    def track(self, number: int, samples: slice = slice(None), correction: Array | None = None) -> BeamTrack:
        """The ranges of a set of beams in some of the samples.

        correction : of the navigated position of each of these samples, shape (n, 2) [m]
        """
        columns = COLUMNS[number]
        poses = _part(self.navigated, samples, correction)
        return _track(self.t[samples], poses, DIRECTIONS[columns], self.slant_range[samples, columns])

    def one_beam(self, ground: Terrain, directions: Array, chosen: Ints) -> BeamTrack:
        """The ranges of a sensor that measures one beam at a time.  chosen : of the directions (B, 3), shape (K,)"""
        beams = directions[chosen][:, None]
        rays = rotate(self.true.mats_ls[:, None], beams)
        ranges = LASER.measure_directions(ground, self.true.origins_l[:, None], rays, beams).slant_range
        return _track(self.t, self.navigated, beams, ranges + self.noise[:, :1])


def _part(poses: Poses, samples: slice, correction: Array | None) -> Poses:
    origins = poses.origins_l[samples].copy()
    if correction is not None:
        origins[:, :2] += correction
    return Poses(origins, poses.mats_ls[samples], poses.vels_l[samples])


def _track(t: Array, poses: Poses, directions: Array, ranges: Array) -> BeamTrack:
    return BeamTrack(t, poses, directions, ranges, NOISE_M, 0.0, HEIGHT_SD_M)


def fly(ground: Terrain, t: Array, poses: Poses, error: Array, rng: Rng) -> Flight:
    """A flight at true poses.  error : true minus navigated position, shape (K, 3) or (3,) [m]"""
    navigated = replace(poses, origins_l=poses.origins_l - error)
    rays = rotate(poses.mats_ls[:, None], DIRECTIONS)
    ranges = LASER.measure_directions(ground, poses.origins_l[:, None], rays, DIRECTIONS).slant_range
    noise = NOISE_M * rng.standard_normal(ranges.shape)
    return Flight(t, navigated, poses, ranges + noise, noise)


def poses_along(ground: Terrain, east: Array, north: Array, roll: Array, heading: Array) -> Poses:
    """Level flight, ``HEIGHT_AGL_M`` above the mean ground below, ``CLEARANCE_M`` above its top at least."""
    below = ground.up(east, north)
    up = max(float(below.mean()) + HEIGHT_AGL_M, float(below.max()) + CLEARANCE_M)
    mats = MAT_ENU_NED @ mat_from_rpy(roll, np.zeros_like(roll), heading)
    return Poses.stationary(np.column_stack((east, north, np.full(len(east), up))), mats)


def lattice_over(ground: Terrain, reach_m: float) -> Lattice:
    """Shifts of every cell up to a reach, and one more."""
    return Lattice(math.ceil(reach_m / ground.finest.cell_m) + 1)


def information_at(ground: Terrain, track: BeamTrack, error: Array) -> Array:
    """Information of the position at its true place, shape (2, 2) [1/m^2]: the inverse of the Cramer-Rao bound."""
    profile = track.profile(ground, error)
    window = cut_window(ground, profile, float(np.abs(error).max()) + 2.0 * ground.finest.cell_m)
    return Likelihood(window, profile).at(error).information


def counted(number: int) -> str:
    """A number of beams as text."""
    return "1 beam" if number == 1 else f"{number} beams"


def sigma(fix: MatchFix) -> float:
    """Root of the mean of the two variances of a fix [m]."""
    return float(np.sqrt(0.5 * np.trace(fix.cov)))


def fix_of(ground: Terrain, track: BeamTrack, reach_m: float, independent_share: float = 1.0) -> MatchFix:
    """The fix of a track with shifts up to a reach [m], and one cell more."""
    priors = MatchPriors(independent_share=independent_share)
    return match_beams(ground, track, reach_m + ground.finest.cell_m, priors=priors)
