"""The methods of position from the ground, by the name that ``TerrainFix.method`` has.

    profile      every shift of the search area is compared; position and covariance are those of the likelihood.  This
                 method aids the filter in flight
    beams        of a multi-beam altimeter, in flight as well: the same with the measured points of all beams, weighted
                 by the angle between beam and slope
    five_point   the five-point search of the source instead of every shift, then the likelihood around its end
    printed      metric and covariance as the source prints them; it has no test that refuses a fix
    vertical     of a radar: its range is taken as the height straight below, without beam and attitude
    closed_loop  of a radar: around the fix of ``profile`` ranges are predicted with the model of the configuration
                 (``[device.altimeter] model``) and the navigated attitude, and compared with the measured ones

    point_mass   a sequential filter, sample by sample, that keeps its state from profile to profile: on a grid
    particles    the same with particles; on a grid while the position is not within 1 km
    marginalised the same with particles that estimate the velocity error

A method is created once for a flight and gets one profile after the other, so it may keep a state.  Another method is
one more entry of ``METHODS``; ``fti reprocess --compare-terrain-methods`` compares all of them on one flight.
Source: Spiegel 2018, section 4.1 (matching), 4.5 (closed loop), 4.5.2 (five-point search).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from fti.arrays import Array
from fti.config import Altimeter
from fti.nav.altimetry.expected_range import make_radar_model
from fti.nav.five_point_search import five_point_search
from fti.nav.height_profile import ProfileSamples
from fti.nav.match_task import MatchTask
from fti.nav.separation.copies import largest_sd
from fti.nav.sequential_methods import SequentialMethod
from fti.nav.terrain_filters.point_mass import PointMassFilter
from fti.nav.terrain_filters.terrain_filter import TerrainFilter
from fti.nav.terrain_matching.apparent_surface import RangeTrack, apparent_surface
from fti.nav.terrain_matching.beam_profile import BeamTrack, match_beams
from fti.nav.terrain_matching.fix import MatchFix, Refusal, match, without_position
from fti.nav.terrain_matching.likelihood import Likelihood
from fti.nav.terrain_matching.nearest_surface import RadarTrack, nearest_surface
from fti.nav.terrain_matching.printed_metric import matching_covariance, mean_absolute_residual
from fti.nav.terrain_matching.profile import MIN_SAMPLES, Profile
from fti.nav.terrain_matching.reach import search_area
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import TerrainWindow
from fti.ranging.sensor import Poses
from fti.terrain.terrain import Terrain

if TYPE_CHECKING:
    from fti.messages.measurements import Measurement
    from fti.messages.outputs import HeightAboveGround, TerrainFix
    from fti.nav.filter.estimate import Estimate
    from fti.nav.filter.position_mark import PositionMark
    from fti.nav.navigation import NavState
    from fti.nav.terrain_reference import Ground

#: Cells around the end of a five-point search in which the minimum must lie.
NEAR_CELLS = 3
#: Steps of a cell, each way, with which the smallest printed metric is refined.
FINE_STEPS = 10
#: Closed loop: distance of the nodes of predicted ranges, and posts around the shifted samples [m].
NODE_M, MARGIN_M = 6.0, 1.0
#: Closed loop: largest shift from the first fix, in its sigmas, and limits of it [m].
CLOSED_SIGMAS, MIN_CLOSED_M, MAX_CLOSED_M = 5.0, 30, 150


class TerrainMethod(Protocol):
    """A method on one flight."""

    def match(self, task: MatchTask) -> MatchFix:
        """The fix of the next profile."""


class ExhaustiveSearch:
    """Every shift of the search area."""

    def match(self, task: MatchTask) -> MatchFix:
        """The fix by the likelihood."""
        return task.solve(*task.search_area())


class BeamSearch:
    """Every shift of the search area, with the measured points of all beams."""

    def match(self, task: MatchTask) -> MatchFix:
        """The fix by the likelihood, with the weights of the slopes that it finds."""
        of = task.heights.samples
        poses = Poses.stationary(of.origins, np.broadcast_to(np.eye(3), (len(of.t), 3, 3)))
        track = BeamTrack(of.t, poses, of.axes[:, None], of.ranges[:, None], of.range_sds, of.dem_sds, task.height_sd)
        return match_beams(task.heights.ground.terrain, track, task.reach_m, task.limits, task.priors)


class FivePointSearch:
    """The five-point search, which may end in a local minimum: other minima are not known to it."""

    def match(self, task: MatchTask) -> MatchFix:
        """The fix by the likelihood around the end of the search."""
        profile, window, lattice = task.search_area()
        likelihood = Likelihood(window, profile, task.priors.drift_sd)
        end, _ = five_point_search(likelihood.chi_square, 2.0 * task.reach_m, window.cell_m)
        furthest = lattice.steps * lattice.stride
        east, north = np.clip(np.rint(end / window.cell_m).astype(int), -furthest, furthest).tolist()
        return task.solve(profile, window, Lattice(NEAR_CELLS, centre=(east, north)))


class PrintedMetric:
    """The smallest mean absolute residual, with the matching quality of the whole grid as its probability."""

    def match(self, task: MatchTask) -> MatchFix:
        """The fix; nothing refuses it where the ground is known."""
        profile, window, lattice = task.search_area()
        ground = Terrain.from_array(window.heights, window.cell_m, east0=window.east0, north0=window.north0)
        residuals = functools.partial(mean_absolute_residual, ground, profile)
        east, north = lattice.shifts(window.cell_m)
        metric = np.array([residuals(np.column_stack((east, np.full_like(east, y)))) for y in north])
        if np.isnan(metric).all():
            return without_position(profile, Refusal.UNKNOWN_GROUND)
        i, j = np.unravel_index(int(np.nanargmin(metric)), metric.shape)
        steps = lattice.stride * window.cell_m / FINE_STEPS * np.arange(-FINE_STEPS, FINE_STEPS + 1)
        near = np.stack(np.meshgrid(east[j] + steps, north[i] + steps), axis=-1).reshape(-1, 2)
        shift = near[np.nanargmin(residuals(near))]
        _, cov = matching_covariance(np.nan_to_num(metric, nan=float(np.nanmax(metric))), east, north)
        up = float(np.mean(ground.up(profile.east + shift[0], profile.north + shift[1]) - profile.ground))
        return MatchFix(profile.middle, shift, cov, up, math.nan, np.zeros(2), 0.0, 1.0, frozenset())


class VerticalRange:
    """The ranges of a radar as heights straight below it, compared with the elevation."""

    def match(self, task: MatchTask) -> MatchFix:
        """The fix by the likelihood."""
        of = task.heights.samples
        east, north, up = of.origins.T
        profile = Profile(of.t, east, north, up - of.ranges, of.sds, task.height_sd)
        return task.solve(profile, *search_area(task.heights.ground.terrain, profile, task.reach_m))


class ClosedLoop:
    """Ranges of a radar, predicted with its model for each place around the fix of the exhaustive search."""

    def __init__(self, altimeter: Altimeter) -> None:
        self._radar, self._first = make_radar_model(altimeter), ExhaustiveSearch()

    def match(self, task: MatchTask) -> MatchFix:
        """The fix by the likelihood of differences of ranges; both searches may refuse it."""
        first = self._first.match(task)
        if not np.isfinite(first.shift).all():
            return first
        step = np.append(first.shift, first.up)
        of = task.heights.samples
        track = RangeTrack(of.t, poses_of(of, step), of.ranges, of.sds, task.height_sd)
        reach_m = _closed_reach_m(first.cov)
        surface = apparent_surface(self._radar, task.heights.ground.terrain, track.poses, NODE_M, reach_m + MARGIN_M)
        # the covariance of the navigated position does not bound the distance from the first fix
        task = replace(task, priors=replace(task.priors, position_cov=None))
        fix = task.solve(track.profile, surface.refine(round(NODE_M)), Lattice(reach_m))
        return replace(fix, shift=fix.shift + step[:2], up=fix.up + step[2], refusals=fix.refusals | first.refusals)


def _closed_reach_m(cov: Array) -> int:
    return min(max(math.ceil(CLOSED_SIGMAS * largest_sd(cov)), MIN_CLOSED_M), MAX_CLOSED_M)


def poses_of(samples: ProfileSamples, step: Array) -> Poses:
    """Poses of the sensor, moved by a step (3,) [m]; a beam is the same all round, so the turn around it is free."""
    down = samples.axes
    level = np.cross(down, np.array([0.0, 1.0, 0.0]))
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    mats = np.stack((level, np.cross(down, level), down), axis=-1)
    return Poses(samples.origins + step, mats, np.gradient(samples.origins, samples.t, axis=0))


class TerrainObserver(Protocol):
    """Sees the inputs of the filter and of the position from the ground, and changes nothing."""

    def accepts(self, device: str, kind: type[Measurement]) -> bool:
        """Whether it takes measurements of this kind of a device."""

    def feed(self, device: str, m: Any, t_ns: int) -> None:
        """A measurement that is valid at t_ns."""

    def feed_height(self, height: HeightAboveGround, nav: NavState) -> None:
        """An output of an altimeter."""

    def set_terrain(self, ground: Ground | None) -> None:
        """The known ground."""

    def see_mark(self, t_ns: int, mark: PositionMark) -> None:
        """The middle of a profile."""

    def see_profile(self, task: MatchTask, fix: TerrainFix, marked: Estimate) -> None:
        """The end of a profile.  fix : without a position;  marked : the filter's estimate in the middle"""

    def tick(self, t_ns: int) -> None:
        """A tick of 20 ms."""


@dataclass(frozen=True)
class MethodEntry:
    """How a method is made, and for which kinds of altimeters.  about : the method in a few words"""

    about: str
    make: Callable[[Altimeter], TerrainMethod]
    kinds: frozenset[str] = frozenset({"laser", "radar", "multibeam"})


_RADAR = frozenset({"radar"})
#: The method that aids the filter, and that of a multi-beam altimeter.
IN_FLIGHT, BEAMS = "profile", "beams"
METHODS: Mapping[str, MethodEntry] = MappingProxyType(
    {
        IN_FLIGHT: MethodEntry("every shift, likelihood", lambda _: ExhaustiveSearch()),
        BEAMS: MethodEntry("every shift with all beams, likelihood", lambda _: BeamSearch(), frozenset({"multibeam"})),
        "five_point": MethodEntry("five-point search, likelihood", lambda _: FivePointSearch()),
        "printed": MethodEntry("metric and covariance as printed in the source", lambda _: PrintedMetric()),
        "vertical": MethodEntry("range as height straight below, likelihood", lambda _: VerticalRange(), _RADAR),
        "closed_loop": MethodEntry("ranges predicted with the model of the altimeter", ClosedLoop, _RADAR),
        "point_mass": MethodEntry("sequential: point-mass filter", lambda _: SequentialMethod(PointMassFilter)),
        "particles": MethodEntry("sequential: particles", lambda _: SequentialMethod(TerrainFilter)),
        "marginalised": MethodEntry(
            "sequential: particles with a velocity error", lambda _: SequentialMethod(TerrainFilter, has_velocity=True)
        ),
    }
)


def name_in_flight(altimeter: Altimeter) -> str:
    """The method that aids the filter with an altimeter."""
    return BEAMS if altimeter.kind == "multibeam" else IN_FLIGHT


def methods_for(altimeter: Altimeter) -> dict[str, TerrainMethod]:
    """New methods that apply to an altimeter, by name."""
    return {name: entry.make(altimeter) for name, entry in METHODS.items() if altimeter.kind in entry.kinds}


def warm_up() -> None:
    """Compile the kernels of profiles and methods in flight; a window is a view of posts, or it is not."""
    still = np.zeros(MIN_SAMPLES)
    profile = Profile(np.arange(float(MIN_SAMPLES)), still, still, still, still + 1.0, 1.0)
    track = RadarTrack(np.array([[0.0, 0.0, 10.0]]), np.array([[0.0, 0.0, -1.0]]), 0.3)
    posts = np.zeros((12, 12))
    ground = Terrain.from_array(posts, 1.0)
    ground.gradient(5.0, 5.0)  # slopes below several beams
    ground.source(5.0, 5.0)  # sigma of a sample; it looks up heights, as a far search does
    for heights in (posts, posts[:, 1:]):
        window = TerrainWindow(heights, 1.0, -5.0, -5.0)
        match(window, profile, Lattice(2))
        nearest_surface(window, track, 5.0)
