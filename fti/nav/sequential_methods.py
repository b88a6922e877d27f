"""Position from the ground by a sequential filter that keeps its state from profile to profile.

The shift that the filter estimates refers to the navigated position.  Between two profiles navigation may have
corrected it: by the difference of its position from the last one, moved with the mean velocity.  The filter is
corrected by as much.  It begins anew after a gap, over other ground, and when a search begins again.

The fix of a profile is the estimate at its end; its covariance contains the drift since the middle of the profile, to
which a fix refers.  It contains all samples since the filter began, so fixes in succession are not independent: a
filter that is aided by them states too small a sigma.

Errors of elevation are correlated from sample to sample: the sigma of a sample is larger by the root of their number
over the number of independent ones.
Source: Bergman 1999, chapter 5; Schoen, Gustafsson, Nordlund 2005.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from fti.arrays import Array
from fti.nav.match_task import MatchTask
from fti.nav.separation.copies import largest_sd
from fti.nav.terrain_filters.drift_model import DriftModel, ShiftEstimate
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_matching.fix import MatchFix, MatchLimits, Refusal, without_position
from fti.nav.terrain_matching.profile import MIN_SAMPLES, Profile
from fti.nav.terrain_matching.window import TerrainWindow

if TYPE_CHECKING:
    from fti.nav.height_profile import ProfileSamples
    from fti.nav.terrain_reference import Ground

#: A search reaches so many sigmas of the position.
SEARCH_SIGMAS = 5.0
#: Longest time between profiles that a filter survives [s]: the mean velocity does not describe a longer one.
MAX_GAP_S = 5.0


class SequentialFilter(Protocol):
    """A filter of ``fti.nav.terrain_filters``."""

    def predict(self, seconds: float) -> None:
        """Time update."""

    def update(self, window: TerrainWindow, sample: HeightSample) -> None:
        """Measurement update."""

    def correct(self, east: float, north: float) -> None:
        """The navigated position was changed by this [m]."""

    def estimate(self) -> ShiftEstimate:
        """Mean and covariance."""


@dataclass(frozen=True, slots=True)
class _LastSample:
    """Time [s], navigated position (2,) [m] and velocity (2,) [m/s]."""

    t: float
    position: Array
    velocity: Array


@dataclass(slots=True)
class _Tracked:
    """A filter between two profiles.  was_search : whether the last profile was one of a search"""

    filter: SequentialFilter
    ground: Ground
    last: _LastSample
    was_search: bool


class SequentialMethod:
    """A sequential filter as a method of ``fti.nav.terrain_methods``.

    make : a filter from its model;  has_velocity : whether the drift of the navigated position is a velocity error
    (otherwise a random walk that grows as much within a profile)
    """

    def __init__(self, make: Callable[[DriftModel], SequentialFilter], *, has_velocity: bool = False) -> None:
        self._make, self._has_velocity = make, has_velocity
        self._tracked: _Tracked | None = None

    def match(self, task: MatchTask) -> MatchFix:
        """The fix of the next profile."""
        profile, window, _ = task.search_area()
        begin, end = _ends(task.heights.samples)
        tracked = self._continue(task, begin) or self._begin(task, profile, begin)
        _feed(tracked.filter, profile, window, task.priors.independent_share)
        tracked.last, tracked.was_search = end, task.priors.position_cov is None
        self._tracked = tracked
        drift_m = task.priors.drift_sd * (end.t - profile.middle)
        return fix_of(tracked.filter.estimate(), profile, task.limits, drift_m, window)

    def _continue(self, task: MatchTask, begin: _LastSample) -> _Tracked | None:
        """The filter of the last profile at the beginning of this one; None if there is none to go on with."""
        tracked, is_search = self._tracked, task.priors.position_cov is None
        if tracked is None or tracked.ground is not task.heights.ground or (is_search and not tracked.was_search):
            return None
        gap_s = begin.t - tracked.last.t
        if not 0.0 <= gap_s <= MAX_GAP_S:
            return None
        expected = tracked.last.position + 0.5 * gap_s * (tracked.last.velocity + begin.velocity)
        tracked.filter.correct(*(begin.position - expected).tolist())
        tracked.filter.predict(gap_s)
        return tracked

    def _begin(self, task: MatchTask, profile: Profile, begin: _LastSample) -> _Tracked:
        cov, span_s = task.priors.position_cov, float(profile.t[-1] - profile.t[0])
        sd = task.reach_m / SEARCH_SIGMAS if cov is None else largest_sd(cov)
        drift_sd = task.priors.drift_sd
        drift = (
            {"velocity_sd": drift_sd, "velocity_walk": drift_sd / math.sqrt(span_s)}
            if self._has_velocity
            else {"position_walk": drift_sd * math.sqrt(span_s)}
        )
        model = DriftModel(sd, task.height_sd, height_walk=task.height_sd / math.sqrt(span_s), **drift)
        return _Tracked(self._make(model), task.heights.ground, begin, was_search=cov is None)


def _ends(samples: ProfileSamples) -> tuple[_LastSample, _LastSample]:
    """The first and the last sample of a profile; beams of one time have one position."""
    t, first = np.unique(samples.t, return_index=True)
    positions = samples.origins[first, :2]
    velocities = np.gradient(positions, t, axis=0)
    begin, end = (_LastSample(float(t[k]), positions[k], velocities[k]) for k in (0, -1))
    return begin, end


def _feed(tracked: SequentialFilter, profile: Profile, window: TerrainWindow, independent_share: float) -> None:
    """All samples of a profile."""
    steps = np.diff(profile.t, prepend=profile.t[0])
    sds = profile.sd / math.sqrt(independent_share)
    rows = np.column_stack((steps, profile.east, profile.north, profile.ground, sds)).tolist()
    for seconds, *sample in rows:
        if seconds > 0.0:
            tracked.predict(seconds)
        tracked.update(window, HeightSample(*sample))


def fix_of(
    found: ShiftEstimate, profile: Profile, limits: MatchLimits, drift_m: float, window: TerrainWindow
) -> MatchFix:
    """The estimate of a filter as a fix.  drift_m : one sigma of the drift since the middle, each axis [m]"""
    cov = found.cov + drift_m**2 * np.eye(2)
    if _count_known(window, profile, found.shift) < MIN_SAMPLES:
        return without_position(profile, Refusal.UNKNOWN_GROUND)
    is_flat = largest_sd(cov) > limits.max_sd_m
    return MatchFix(
        t=profile.middle,
        shift=found.shift,
        cov=cov,
        up=-found.height_error,
        up_sd=found.height_sd,
        drift=np.zeros(2),
        ambiguity=0.0,
        noise_ratio=1.0,
        refusals=frozenset({Refusal.FLAT} if is_flat else {}),
    )


def _count_known(window: TerrainWindow, profile: Profile, shift: Array) -> int:
    """Number of samples over known ground, by the nearest post."""
    column, row = (np.rint(at).astype(int) for at in window.places(profile.east + shift[0], profile.north + shift[1]))
    rows, columns = window.heights.shape
    is_inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    return int(np.isfinite(window.heights[row[is_inside], column[is_inside]]).sum())
