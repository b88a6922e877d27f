"""Live position from the ground: profiles of an altimeter in succession, matched with known terrain, aid the filter.

A profile has the heights of an altimeter with one beam, or the ranges of all beams of a multi-beam altimeter, and lasts
``window_s``.  In its middle the filter marks its position (``fti.nav.filter.position_mark``); at its end the fix, with
the covariance of its likelihood, corrects that mark.  Profiles do not overlap, and a height that aids the altitude of
the filter is not part of one: each sample is used once.

A search begins without a certain position: it reaches five sigma, at most ``MAX_REACH_M``, and three fixes in
succession must agree before one aids.  With satellites, and after such a search, the position is certain: each fix aids
that agrees with it, and the search reaches four sigma.  Fixes that fit nowhere, lie at the edge, or disagree
``LOST_COUNT`` times in succession begin the search again.

Two fixes in succession that disagree contradict the filter: the map or the position is wrong, and it is not known
which.  Without satellites a displaced map is not detected (MAP_UNVERIFIED); ``map_sd_m`` is in the filter's levels.
Configured by ``[nav.terrain_position]``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from fti.arrays import Array
from fti.config import Device, TerrainPositionTable
from fti.constants import SECOND_NS
from fti.geodesy.formulas import metres_per_radian
from fti.messages.measurements import BeamRange, Measurement
from fti.messages.outputs import Event, HeightAboveGround, TerrainFix
from fti.messages.reasons import Reason
from fti.nav.altimetry.compensation import mounting_of
from fti.nav.filter.position_mark import TERRAIN_POSITION, MarkedPosition, PositionMark
from fti.nav.height_profile import (
    BEAM_PERIOD_NS,
    PERIOD_NS,
    HeightProfile,
    MeasuredRange,
    range_of_beam,
    range_of_height,
)
from fti.nav.match_task import MatchTask
from fti.nav.separation.copies import largest_sd
from fti.nav.terrain_matching.acquisition import Acquisition
from fti.nav.terrain_matching.fix import MatchFix, MatchLimits, MatchPriors, Refusal
from fti.nav.terrain_methods import BEAMS, METHODS, TerrainObserver, name_in_flight
from fti.nav.terrain_reference import Ground

if TYPE_CHECKING:
    from fti.nav.filter.estimate import Estimate
    from fti.nav.inertial_aiding import AidedNavigation
    from fti.nav.navigation import NavState
    from fti.terrain.terrain import Terrain

#: Sigmas of the position that a search reaches, without and with a certain position; its limits [m].
SEARCH_SIGMAS, TRACK_SIGMAS = 5.0, 4.0
#: With satellites a position with a smaller sigma is certain [m].
CERTAIN_SD_M = 20.0
MIN_REACH_M, MAX_REACH_M = 150.0, 5000.0
LOST_COUNT, CONTRADICTION_COUNT = 3, 2
#: Heights may arrive so late after the end of a profile [ns].
LATE_NS = 200_000_000
#: Repetition of the last fix, and its greatest age in profiles.
REPEAT_NS, MAX_AGE_PROFILES = 500_000_000, 3
#: Least sigma of a velocity of the filter for the drift within a profile [m/s].
MIN_DRIFT_MPS = 0.05
REASON_OF = {
    Refusal.UNKNOWN_GROUND: Reason.TERRAIN_HOLE,
    Refusal.FLAT: Reason.GROUND_FLAT,
    Refusal.AT_EDGE: Reason.SEARCH_EDGE,
    Refusal.RESIDUAL: Reason.PROFILE_MISFIT,
    Refusal.AMBIGUOUS: Reason.AMBIGUOUS,
}
#: Refusals that show that the position or the terrain is wrong; the others are properties of the ground.
LOSING = frozenset({Reason.SEARCH_EDGE, Reason.PROFILE_MISFIT, Reason.REJECTED})
NAME = "position from the ground"


@dataclass(slots=True)
class _Mark:
    """The marked position.  estimate : the filter's then"""

    aiding: PositionMark
    estimate: Estimate


class TerrainPosition:
    """Position from the heights of one altimeter.

    aided : the filter that it aids;  observer : sees every mark and every profile; None: no observer
    """

    def __init__(
        self,
        settings: TerrainPositionTable,
        devices: Mapping[str, Device],
        aided: AidedNavigation,
        observer: TerrainObserver | None = None,
    ) -> None:
        self._settings, self._aided, self._observer = settings, aided, observer
        self._device = devices[settings.altimeter]
        assert self._device.altimeter is not None
        self._altimeter = self._device.altimeter
        self._method_name = name_in_flight(self._altimeter)
        self._method = METHODS[self._method_name].make(self._altimeter)
        self._span_ns = round(settings.window_s * SECOND_NS)
        self._limits = MatchLimits(max_sd_m=settings.max_sd_m)
        self._profile: HeightProfile | None = None
        self._nav: NavState | None = None  # at the time of the last beam
        self._mark: _Mark | None = None
        self._acquisition = Acquisition(MIN_DRIFT_MPS)
        self._is_search, self._lost, self._refused = True, 0, 0
        self._fix: TerrainFix | None = None
        self._undecided: TerrainFix | None = None  # until the filter has accepted or refused it
        self._sent_ns = 0
        self._events: list[Event] = []

    @property
    def is_contradicting(self) -> bool:
        """Whether the last fixes contradict the filter."""
        return self._refused >= CONTRADICTION_COUNT

    def set_terrain(self, ground: Ground | None) -> None:
        """Set the known ground; a profile over another one is dropped."""
        if ground:
            ground = ground.sensed_by(self._altimeter.kind)
        period_ns = BEAM_PERIOD_NS if self._method_name == BEAMS else PERIOD_NS
        self._profile, self._mark = (
            HeightProfile(mounting_of(self._device), ground, period_ns) if ground else None,
            None,
        )

    def accepts(self, device: str, kind: type[Measurement]) -> bool:
        """Whether measurements of a kind of a device are beams of the profile."""
        return self._method_name == BEAMS and device == self._device.name and issubclass(kind, BeamRange)

    def feed_beam(self, beam: BeamRange, t_ns: int, state_at: Callable[[int], NavState]) -> None:
        """Take a range of the multi-beam altimeter, valid at t_ns.  state_at : navigation at a time"""
        profile = self._profile
        if profile is None or not (profile.is_due(t_ns) or profile.is_last(t_ns)):
            return
        if self._nav is None or self._nav.t_ns != t_ns:
            self._nav = state_at(t_ns)
        measured = range_of_beam(beam, t_ns, self._device, self._nav.attitude)
        if profile.is_due(t_ns):
            self._add(profile, t_ns, measured, self._nav)
        elif measured is not None:
            profile.add_beam(measured)

    def feed_height(self, height: HeightAboveGround, nav: NavState) -> None:
        """Take an output of the altimeter that does not aid the altitude of the filter."""
        if self._profile is None or height.sensor != self._settings.altimeter or height.t_valid_ns is None:
            return
        self._add(
            self._profile, height.t_valid_ns, range_of_height(height, self._altimeter, self._profile.mounting), nav
        )

    def tick(self, t_ns: int) -> list[TerrainFix | Event]:
        """Mark the middle of a profile, match it at its end, repeat the last fix; events."""
        profile = self._profile
        if profile is not None and (begin_ns := profile.begin_ns) is not None:
            if self._mark is None and t_ns - begin_ns >= self._span_ns // 2:
                self._set_mark(t_ns)
            if t_ns - begin_ns >= self._span_ns + LATE_NS:
                self._finish(profile, t_ns)
        if self._undecided is not None:
            self._see_decision(self._undecided, t_ns)
        out: list[TerrainFix | Event] = [*self._events]
        self._events.clear()
        if t_ns - self._sent_ns >= REPEAT_NS or (self._fix is not None and self._fix.t_ns == t_ns):
            self._sent_ns = t_ns
            out.append(self._repeat(t_ns))
        return out

    # -------------------------------------------------------------------------------------------------------- profiles

    def _add(self, profile: HeightProfile, t_ns: int, measured: MeasuredRange | None, nav: NavState) -> None:
        """Add a range to the profile, which ends without a navigated state."""
        estimate = self._aided.estimate(t_ns) if nav.attitude else None
        if nav.attitude is None or estimate is None:
            self._drop()
        elif measured is not None and not profile.add(t_ns, measured, estimate, nav.attitude):
            self._mark = None

    def _drop(self) -> None:
        if self._profile is not None:
            self._profile.clear()
        self._mark = None

    def _set_mark(self, t_ns: int) -> None:
        estimate = self._aided.estimate(t_ns)
        if estimate is None:
            self._drop()
            return
        self._mark = _Mark(PositionMark(*estimate.geodetic), estimate)
        self._aided.feed_terrain_fix(t_ns, self._mark.aiding)
        if self._observer:
            self._observer.see_mark(t_ns, self._mark.aiding)

    def _finish(self, heights: HeightProfile, t_ns: int) -> None:
        """Match a profile, let its fix aid, and begin the next profile."""
        mark, ground = self._mark, heights.ground
        if mark is None:
            self._drop()
            return
        is_search = self._is_search and not self._is_certain(mark.estimate)
        fix = TerrainFix(
            t_ns=t_ns, t_valid_ns=mark.estimate.t_ns, valid=False, reasons=(Reason.TOO_FEW_HEIGHTS,),
            method=self._method_name, is_search=is_search, map_sd=self._settings.map_sd_m,
            reach=reach_m(mark.estimate, self._settings.map_sd_m, SEARCH_SIGMAS if is_search else TRACK_SIGMAS),
            samples=len(heights), length=heights.length_m,
        )  # fmt: skip
        if heights.is_complete(self._span_ns):
            task = self._task(heights, fix, mark)
            self._use(self._method.match(task), fix, mark, ground)
            if self._observer:
                self._observer.see_profile(task, fix, mark.estimate)
        else:
            self._fix = fix
        self._drop()

    def _is_certain(self, estimate: Estimate) -> bool:
        """Whether satellites determine a position well enough to need no search."""
        return self._aided.has_satellites(estimate.t_ns) and largest_sd(estimate.cov_n[:2, :2]) <= CERTAIN_SD_M

    def _task(self, heights: HeightProfile, fix: TerrainFix, mark: _Mark) -> MatchTask:
        """A profile, with the position's drift, and unless it searches its covariance, as priors."""
        return MatchTask(
            heights,
            height_sd=float(mark.estimate.sd_n[2]),
            reach_m=fix.reach or MIN_REACH_M,
            limits=self._limits,
            priors=MatchPriors(
                independent_share=heights.independent_share,
                drift_sd=drift_sd(mark.estimate),
                position_cov=None if fix.is_search else level_cov(mark.estimate, self._settings.map_sd_m),
            ),
        )

    def _use(self, found: MatchFix, fix: TerrainFix, mark: _Mark, ground: Ground) -> None:
        """Let a fix aid if nothing refuses it; it is published after the decision of the filter."""
        self._acquisition.drift_mps = drift_sd(mark.estimate)
        confirmed = self._acquisition.add(found)
        reasons = refusal_reasons(found, is_confirmed=confirmed is not None or not fix.is_search)
        fix = complete_fix(replace(fix, valid=not reasons, reasons=reasons), found, mark.estimate, ground)
        if reasons:
            self._fix = fix
            self._refuse(fix)
            return
        if fix.is_search:
            self._report(fix.t_ns, "info", f"three profiles agree to {_larger_sd(fix):.0f} m; it aids the filter")
        self._aided.feed_terrain_fix(fix.t_ns, aiding_of(fix, mark.aiding))
        self._undecided = fix

    def _refuse(self, fix: TerrainFix) -> None:
        """Count fixes that contradict the filter, and those after which the search begins again."""
        if fix.reasons == (Reason.REJECTED,):
            self._refused += 1
            if self._refused == CONTRADICTION_COUNT:
                self._report(fix.t_ns, "warning", _contradiction(fix))
        is_loss = not LOSING.isdisjoint(fix.reasons) and Reason.GROUND_FLAT not in fix.reasons
        self._lost = self._lost + 1 if is_loss and not self._aided.has_satellites(fix.t_ns) else 0
        if self._lost >= LOST_COUNT and not self._is_search:
            self._is_search, self._lost = True, 0
            self._report(fix.t_ns, "warning", f"lost: {LOST_COUNT} profiles in succession do not fit; searching")

    def _see_decision(self, fix: TerrainFix, t_ns: int) -> None:
        """The filter accepts or refuses a fix with its next inertial sample."""
        is_accepted = self._aided.is_accepted(TERRAIN_POSITION, fix.t_ns)
        if is_accepted is None:
            return
        self._undecided, self._fix = None, replace(fix, t_ns=t_ns)
        if not is_accepted:
            self._fix = replace(self._fix, valid=False, reasons=(Reason.REJECTED,))
            self._refuse(self._fix)
            return
        if self.is_contradicting:
            self._report(t_ns, "info", "agrees with the filter again")
        self._lost, self._refused, self._is_search = 0, 0, False

    def _report(self, t_ns: int, level: str, text: str) -> None:
        self._events.append(Event(t_ns=t_ns, level=level, source="nav", text=f"{NAME}: {text}"))

    def _repeat(self, t_ns: int) -> TerrainFix:
        """The last fix as an output of this time."""
        has_satellites = self._aided.has_satellites(t_ns)
        unchecked = () if has_satellites else (Reason.MAP_UNVERIFIED,)
        if self._fix is None:
            reason = Reason.NO_TERRAIN if self._profile is None else Reason.TOO_FEW_HEIGHTS
            return TerrainFix(t_ns=t_ns, t_valid_ns=None, valid=False, reasons=(reason,), unchecked=unchecked)
        age_ns = t_ns - (self._fix.t_valid_ns or 0)
        if self._fix.valid and age_ns > MAX_AGE_PROFILES * self._span_ns:
            self._fix = replace(self._fix, valid=False, reasons=(Reason.STALE,))
        return replace(self._fix, t_ns=t_ns, unchecked=unchecked)


def _contradiction(fix: TerrainFix) -> str:
    """Text of fixes that disagree with the filter."""
    north, east = fix.shift_north or 0.0, fix.shift_east or 0.0
    bearing = math.degrees(math.atan2(east, north)) % 360.0
    place = f"{math.hypot(north, east):.0f} m from the filter, towards {bearing:.0f} deg"
    return f"{CONTRADICTION_COUNT} profiles lie {place}; the map or the position is wrong, it is not known which"


def reach_m(estimate: Estimate, map_sd: float, sigmas: float) -> float:
    """How far to search from a position [m].  map_sd : of the map, each axis [m];  sigmas : of both together"""
    level_sd = math.hypot(largest_sd(estimate.cov_n[:2, :2]), map_sd)
    return min(max(sigmas * level_sd, MIN_REACH_M), MAX_REACH_M)


def level_cov(estimate: Estimate, map_sd: float) -> Array:
    """Covariance of a position against the map, east and north, shape (2, 2) [m^2]."""
    return np.asarray(estimate.cov_n[1::-1, 1::-1] + map_sd**2 * np.eye(2))


def drift_sd(estimate: Estimate) -> float:
    """One sigma of the horizontal velocity [m/s]."""
    return max(float(estimate.sd_n[3:5].max()), MIN_DRIFT_MPS)


def place_of(found: MatchFix, marked: Estimate, terrain: Terrain) -> tuple[float, float]:
    """Latitude and longitude [rad] of a match at the time of a marked position."""
    point = terrain.frame.to_local(*marked.geodetic)
    point[:2] += found.shift + found.drift * (marked.t_ns / SECOND_NS - found.t)
    lat, lon, _ = terrain.frame.to_geodetic(point)
    return float(lat), float(lon)


def _larger_sd(fix: TerrainFix) -> float:
    return max(fix.north_sd or 0.0, fix.east_sd or 0.0)


def refusal_reasons(found: MatchFix, *, is_confirmed: bool) -> tuple[Reason, ...]:
    """Why a fix must not aid the filter; one that disagrees is for its gate, and for its copy without satellites."""
    reasons = tuple(REASON_OF[refusal] for refusal in sorted(found.refusals - {Refusal.DISAGREES}))
    return reasons or (() if is_confirmed else (Reason.NOT_CONFIRMED,))


def aiding_of(fix: TerrainFix, mark: PositionMark) -> MarkedPosition:
    """A fix with a position as a measurement of the filter."""
    assert fix.lat is not None and fix.lon is not None and fix.north_sd is not None and fix.east_sd is not None
    across = (fix.correlation or 0.0) * fix.north_sd * fix.east_sd
    return MarkedPosition(mark, fix.lat, fix.lon, (fix.north_sd**2, fix.east_sd**2, across))


def complete_fix(fix: TerrainFix, found: MatchFix, marked: Estimate, ground: Ground) -> TerrainFix:
    """An output with the position of a match; unchanged without a position.  marked : the filter's, in its middle"""
    if not math.isfinite(found.shift[0]):
        return fix
    lat, lon, alt = marked.geodetic
    at_lat, at_lon = place_of(found, marked, ground.terrain)
    per_lat, per_lon = metres_per_radian(lat, alt)
    east_sd, north_sd = math.sqrt(found.cov[0, 0]), math.sqrt(found.cov[1, 1])
    return replace(
        fix,
        lat=at_lat,
        lon=at_lon,
        north_sd=north_sd,
        east_sd=east_sd,
        correlation=float(found.cov[0, 1]) / (east_sd * north_sd),
        shift_north=(at_lat - lat) * per_lat,
        shift_east=(at_lon - lon) * per_lon,
        up=found.up,
        up_sd=found.up_sd,
        ambiguity=found.ambiguity if math.isfinite(found.ambiguity) else None,
        noise_ratio=found.noise_ratio,
    )
