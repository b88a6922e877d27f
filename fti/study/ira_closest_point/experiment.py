"""Fixes of an interferometric altimeter at several crab angles, and the filter that they update.

Every 40 s a batch is matched with shifts of 5 m up to 250 m, and the filter is updated with a sigma of 10 m (table 2).
As in the source (table 3), batches are of all samples, or of those whose conventional and proposed point differ by more
than 5 or 10 m with the largest crab; these are the same samples at every crab angle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Ints, Mask
from fti.nav.interferometric.absolute_match import best_shift, profile_of_points
from fti.nav.interferometric.closest_point import PointMethod, closest_points
from fti.nav.interferometric.correction_filter import POSITION, STATES, CorrectionFilter
from fti.nav.terrain_matching.profile import MIN_SAMPLES, Profile
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import TerrainWindow, cut_window
from fti.ranging.sensor import Poses
from fti.study.ira_closest_point.flight import (
    ALTIMETER,
    CRABS_DEG,
    GROUND_M,
    HEIGHT_M,
    HEIGHT_SD_M,
    NOISE,
    PERIOD_S,
    SAMPLES,
    START,
    UNIT,
    CrabFlight,
    flights,
)

#: Cases 1 to 3 of the source: least difference of the two forms at the largest crab [m].
MIN_DIFFERENCES_M = (0.0, 5.0, 10.0)
#: Samples of a batch, and one sigma of its fix [m].
BATCH, FIX_SD_M = 80, 10.0
#: Parts of a cell, and shifts to each side: 5 m and 250 m.  Posts around the samples of a batch [m].
CELL_PARTS, LATTICE, MARGIN_M = 2, Lattice(50), 300.0
#: Fields of ``Fix``.
PARTS = ("matched", "corrected")


@dataclass(frozen=True, eq=False)
class Fix:
    """Errors of the horizontal position, east and north, shape (2,) each [m].

    matched : by the smallest mean absolute difference;  corrected : of the filter after the update
    """

    matched: Array
    corrected: Array


@dataclass(frozen=True)
class FixErrors:
    """Sums of the squares of the errors of a run [m^2], by the fields of ``Fix``, and the number of fixes."""

    matched: float
    corrected: float
    fixes: int


@dataclass(frozen=True)
class CrabRun:
    """A run.

    errors      : by crab angle [deg], method and least difference [m]
    differences : horizontal, conventional minus proposed, by crab angle, shape (samples,) each [m]
    looks       : angle of the points within the plane, over level ground, shape (samples,) [rad]
    """

    errors: dict[tuple[float, PointMethod, float], FixErrors]
    differences: dict[float, Array]
    looks: Array


def fly(seed: int) -> CrabRun:
    """A run: every crab angle and method."""
    flown = dict(zip(CRABS_DEG, flights(seed), strict=True))
    across = {crab: {method: _across(flight, method) for method in PointMethod} for crab, flight in flown.items()}
    apart = {crab: np.abs(at[PointMethod.CONVENTIONAL] - at[PointMethod.PROPOSED]) for crab, at in across.items()}
    errors = {
        (crab, method, least): summarise(list(fixes(flight, method, apart[CRABS_DEG[-1]] >= least)))
        for crab, flight in flown.items()
        for method in PointMethod
        for least in (MIN_DIFFERENCES_M if method is not PointMethod.SIMPLE else MIN_DIFFERENCES_M[:1])
    }
    looks = np.arctan(across[0.0][PointMethod.PROPOSED] / (HEIGHT_M - GROUND_M))
    return CrabRun(errors, apart, looks)


def _across(flight: CrabFlight, method: PointMethod) -> Array:
    """Distance of the measured points to the right of the track, shape (n,) [m]."""
    return np.asarray(flight.points(method).relative @ flight.right)


def fixes(flight: CrabFlight, method: PointMethod, is_used: Mask) -> Iterator[Fix]:
    """The fixes of a flight, each of which updates the filter; a batch of too few samples has none.

    is_used : which samples are matched, shape (n,)
    """
    tracked = CorrectionFilter(UNIT, START)
    for first in range(0, SAMPLES, BATCH):
        estimates = np.zeros((SAMPLES, STATES))
        for k in range(first, first + BATCH):
            if k:
                tracked.predict(flight.phis[k], NOISE)
            estimates[k] = tracked.x
        some = first + np.flatnonzero(is_used[first : first + BATCH])
        if len(some) < MIN_SAMPLES:
            continue
        window, profile = _profile(flight, method, estimates, some)
        left = (flight.errors - estimates)[some, POSITION].mean(axis=0)
        last = first + BATCH - 1
        shift = best_shift(window, profile, LATTICE)
        tracked.update(shift, FIX_SD_M, PERIOD_S * float(last - some.mean()))
        yield Fix(shift - left, (flight.errors[last] - tracked.x)[POSITION])


def _profile(flight: CrabFlight, method: PointMethod, estimates: Array, some: Ints) -> tuple[TerrainWindow, Profile]:
    poses = flight.navigated(estimates)
    at = Poses(poses.origins_l[some], poses.mats_ls[some], poses.vels_l[some])
    points = closest_points(flight.slant_range[some], flight.look_angle[some], at, method)
    profile = profile_of_points(np.asarray(PERIOD_S * some), at.origins_l, points, ALTIMETER.range_sd, HEIGHT_SD_M)
    return cut_window(flight.elevation, profile, MARGIN_M).refine(CELL_PARTS), profile


def summarise(found: Sequence[Fix]) -> FixErrors:
    """Sums over the fixes of a run."""
    matched, corrected = (float(sum(getattr(fix, name) @ getattr(fix, name) for fix in found)) for name in PARTS)
    return FixErrors(matched, corrected, len(found))


def squares(runs: Sequence[CrabRun], method: PointMethod, least: float, part: str = "matched") -> Array:
    """Sums of squares of a part of ``Fix`` [m^2], shape (runs, crab angles); of the runs that have a fix."""
    found = [[run.errors[crab, method, least] for crab in CRABS_DEG] for run in runs]
    return np.array([[getattr(each, part) for each in of_run] for of_run in found if of_run[0].fixes])


def rms(runs: Sequence[CrabRun], method: PointMethod, least: float, part: str = "matched") -> Array:
    """RMS over the fixes of all runs, shape (crab angles,) [m]."""
    count = sum(run.errors[CRABS_DEG[0], method, least].fixes for run in runs)
    return np.asarray(np.sqrt(squares(runs, method, least, part).sum(axis=0) / count))
