"""Fixes of a laser with several beams, for the filter of a flight.

All beams measure at the times of the laser of ``fti.study.ground_flights``, with its noise; the vertical beam has its
ranges.  Marks, duration of the profiles, priors, refusals and limits of the search are those of the live position
(``fti.nav.terrain_positioning``).  It begins with satellites and does not search without a position.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.geodesy.rotations import mat_from_rpy, rotate
from fti.messages.outputs import Event, TerrainFix
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.position_mark import MarkedPosition, PositionMark
from fti.nav.height_profile import MAX_JUMP_M, jump_m
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.terrain_matching.beam_profile import BeamTrack, match_beams
from fti.nav.terrain_matching.fix import MatchFix, Refusal
from fti.nav.terrain_matching.reach import lattice_within
from fti.nav.terrain_positioning import (
    CORRELATED_M,
    LATE_NS,
    TRACK_SIGMAS,
    drift_sd,
    independent_share,
    level_cov,
    place_of,
    reach_m,
)
from fti.nav.terrain_reference import Ground
from fti.ranging.multibeam import BEAMS_ACROSS_DEG, beam_directions
from fti.ranging.sensor import Poses
from fti.study.ground_flights import LASER, LASER_SD_M, GroundCase, Sensors, poses_of

#: As ``CORRELATED_M``, of several beams: an error of elevation of 300 m length is common to beams that are 50 m apart.
#: Measured (seed 5, four flights): error^2 over covariance of a fix, halved, is 2.2 with 40 m, and 0.9 with 100 m; with
#: one beam and 40 m it is 0.8.
CORRELATED_BEAMS_M = 100.0
NOISE_SEED = 77


@dataclass(frozen=True, eq=False)
class _Sample:
    """Navigated state, matrix body to local, and ranges of all beams [m] at a time."""

    estimate: Estimate
    mat_lb: Array
    ranges: Array


class BeamPosition:
    """Position from the ground with beams across the track.  number : of beams, a key of table 7.6"""

    is_contradicting = False

    def __init__(self, number: int, case: GroundCase, sensors: Sensors, known: Ground, aided: AidedNavigation) -> None:
        self._directions = beam_directions(0.0, np.radians(BEAMS_ACROSS_DEG[number]))
        self._case, self._sensors, self._known, self._aided = case, sensors, known, aided
        self._span_ns = round((case.window_s or 0.0) * SECOND_NS)
        self._ranges = _measure(sensors, self._directions)
        self._samples: list[_Sample] = []
        self._mark: tuple[PositionMark, Estimate] | None = None

    def feed(self, k: int) -> None:
        """Take the ranges of the time ``height_t[k]`` of the sensors; a jump of the position begins a new profile."""
        truth = self._sensors.height_truth
        estimate = self._aided.estimate(round(float(self._sensors.height_t[k]) * SECOND_NS))
        if estimate is None:
            return
        if self._samples and jump_m(self._samples[-1].estimate, estimate) > MAX_JUMP_M:
            self._samples, self._mark = [], None
        to_n = mat_from_rpy(*(float(getattr(truth, name)[k]) for name in ("roll", "pitch", "heading")))
        mat_lb = self._known.terrain.frame.mat_ln(*estimate.geodetic[:2]) @ to_n
        self._samples.append(_Sample(estimate, mat_lb, self._ranges[k]))

    def tick(self, t_ns: int) -> Sequence[TerrainFix | Event]:
        """Mark the middle of a profile; at its end let its fix aid.  It has no outputs."""
        if not self._samples:
            return ()
        age_ns = t_ns - self._samples[0].estimate.t_ns
        if self._mark is None and age_ns >= self._span_ns // 2:
            self._set_mark(t_ns)
        if self._mark is not None and age_ns >= self._span_ns + LATE_NS:
            self._fix(t_ns, *self._mark)
            self._samples, self._mark = [], None
        return ()

    def _set_mark(self, t_ns: int) -> None:
        estimate = self._aided.estimate(t_ns)
        if estimate is not None:
            self._mark = PositionMark(*estimate.geodetic), estimate
            self._aided.feed_terrain_fix(t_ns, self._mark[0])

    def _fix(self, t_ns: int, mark: PositionMark, marked: Estimate) -> None:
        found = self._match(marked)
        if found.refusals - {Refusal.DISAGREES}:  # a fix that disagrees is for the gate of the filter
            return
        lat, lon = place_of(found, marked, self._known.terrain)
        cov_n = float(found.cov[1, 1]), float(found.cov[0, 0]), float(found.cov[0, 1])
        self._aided.feed_terrain_fix(t_ns, MarkedPosition(mark, lat, lon, cov_n))

    def _match(self, marked: Estimate) -> MatchFix:
        track = self._track(float(marked.sd_n[2]))
        length_m = math.hypot(*(track.poses.origins_l[-1] - track.poses.origins_l[0])[:2])
        correlated_m = CORRELATED_M if len(self._directions) == 1 else CORRELATED_BEAMS_M
        terrain, map_sd = self._known.terrain, self._case.map_sd
        return match_beams(
            terrain,
            track,
            lattice_within(reach_m(marked, map_sd, TRACK_SIGMAS), terrain.finest.cell_m),
            independent_share=independent_share(length_m, len(self._samples), correlated_m),
            drift_sd=drift_sd(marked),
            position_cov=level_cov(marked, map_sd),
        )

    def _track(self, height_sd: float) -> BeamTrack:
        frame, states = self._known.terrain.frame, [sample.estimate for sample in self._samples]
        origins = np.array([frame.to_local(*estimate.geodetic) for estimate in states])
        poses = Poses.stationary(origins, np.array([sample.mat_lb for sample in self._samples]))
        t = np.array([estimate.t_ns for estimate in states]) / SECOND_NS
        ranges = np.array([sample.ranges for sample in self._samples])
        return BeamTrack(t, poses, self._directions, ranges, LASER_SD_M, self._known.sd, height_sd)


def _measure(sensors: Sensors, directions: Array) -> Array:
    """Ranges of all beams at all times, shape (K, B) [m]; a vertical beam measures the ranges of the laser."""
    poses = poses_of(sensors.ground, sensors.height_truth)
    rays, origins = rotate(poses.mats_ls[:, None], directions), poses.origins_l[:, None]
    ranges = LASER.measure_directions(sensors.ground, origins, rays, directions).slant_range
    ranges = ranges + LASER_SD_M * np.random.default_rng(NOISE_SEED).standard_normal(ranges.shape)
    ranges[:, directions[:, 2] == 1.0] = sensors.ranges[:, None]
    return np.asarray(ranges)
