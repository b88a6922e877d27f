"""Matches every profile of a flight with every method; passive, beside navigation.

All methods get the same profiles, navigated states and search areas.  A fix is refused for the reasons of flight: by
its method, without three that agree during a search, and by its distance from the navigated position otherwise.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from fti.arrays import Array
from fti.config import Config
from fti.constants import SECOND_NS
from fti.errors import ConfigError
from fti.geodesy.formulas import metres_per_radian
from fti.messages.measurements import Measurement
from fti.messages.outputs import HeightAboveGround, TerrainFix
from fti.messages.reasons import Reason
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.position_mark import MarkedPosition, PositionMark
from fti.nav.match_task import MatchTask
from fti.nav.navigation import NavState
from fti.nav.terrain_matching.acquisition import Acquisition
from fti.nav.terrain_matching.fix import MatchFix, disagrees
from fti.nav.terrain_matching.likelihood import Likelihood
from fti.nav.terrain_methods import TerrainMethod, methods_for, name_in_flight
from fti.nav.terrain_positioning import MIN_DRIFT_MPS, aiding_of, complete_fix, drift_sd, refusal_reasons
from fti.nav.terrain_reference import Ground
from fti.post.score.truth_table import TruthTable
from fti.post.terrain_comparison.filters import OutageFilter
from fti.post.terrain_comparison.reference import Reference, ReferencePosition, SatelliteReference, TruthReference

#: Period at which positions are compared [ns].
SAMPLE_NS = SECOND_NS
#: Names of the filters that no method aids.
ALONE, BOUND = "alone", "bound"
#: A bound of a profile above this sigma aids nothing [m].
MAX_BOUND_SD_M = 1000.0


@dataclass(frozen=True, slots=True)
class MethodFix:
    """A fix of one method.

    fix : as in flight;  seconds : of the processor
    error : north and east from the reference [m];  reference_cov : of the reference, shape (2, 2) [m^2]; None: unknown
    """

    fix: TerrainFix
    seconds: float
    error: Array | None
    reference_cov: Array | None


@dataclass(frozen=True, slots=True)
class FilterSample:
    """A filter at one time.  error : north and east from the reference [m];  sd : stated, both axes together [m]"""

    error: Array
    sd: float


@dataclass(slots=True)
class ComparedFlight:
    """What the comparison has found.

    reference : name of the source of the reference position;  map_sd : configured [m]
    in_flight : the method that aids the filter
    fixes   : of each method, one for each profile
    bounds  : Cramer-Rao bound of each profile, both axes together, one sigma [m]; NaN where it is unknown
    track   : time [ns] and reference position once a second
    filters : of ``ALONE``, ``BOUND`` and each method, at the times of ``outage_ns``: all of them exist
    """

    reference: str
    map_sd: float
    in_flight: str
    fixes: dict[str, list[MethodFix]] = field(default_factory=dict)
    bounds: list[float] = field(default_factory=list)
    track: list[tuple[int, ReferencePosition]] = field(default_factory=list)
    outage_ns: list[int] = field(default_factory=list)
    filters: dict[str, list[FilterSample]] = field(default_factory=dict)
    ground: Ground | None = None


@dataclass(slots=True)
class _ComparedMethod:
    method: TerrainMethod
    acquisition: Acquisition


class MethodComparison:
    """Observes a flight (``fti.nav.terrain_methods.TerrainObserver``).

    config : of the reprocessing, from ``file``;  truth : of the emulator; empty: the satellites are the reference
    Raises ConfigError without ``[nav.terrain_position]``.
    """

    def __init__(self, config: Config, file: Path, truth: list[TruthTable]) -> None:
        nav, devices = config.nav, {device.name: device for device in config.device}
        table = nav.terrain_position
        altimeter = devices[table.altimeter].altimeter if table else None
        if table is None or nav.filter is None or altimeter is None:
            raise ConfigError(
                f"{file}: has no [nav.terrain_position]: there are no profiles to compare; name a configuration with "
                "this table, [nav.filter] and [nav.terrain]"
            )
        self._reference: Reference = TruthReference(truth) if truth else SatelliteReference(nav.filter, devices)
        self._methods = {
            name: _ComparedMethod(method, Acquisition(MIN_DRIFT_MPS)) for name, method in methods_for(altimeter).items()
        }
        names = (ALONE, BOUND, *self._methods)
        self._filters = {name: OutageFilter(nav.filter, devices, table.map_sd_m) for name in names}
        self._mark: tuple[PositionMark, ReferencePosition | None] | None = None
        self._sampled_ns = 0
        self.flight = ComparedFlight(self._reference.name, table.map_sd_m, name_in_flight(altimeter))
        self.flight.fixes = {name: [] for name in self._methods}
        self.flight.filters = {name: [] for name in names}

    # ----------------------------------------------------------------------------------------------------------- inputs

    def accepts(self, device: str, kind: type[Measurement]) -> bool:
        """All: the filters choose theirs."""
        return True

    def feed(self, device: str, m: Measurement, t_ns: int) -> None:
        """A measurement for reference and filters."""
        self._reference.feed(device, m, t_ns)
        for each in self._filters.values():
            each.feed(device, m, t_ns)

    def feed_height(self, height: HeightAboveGround, nav: NavState) -> None:
        """A height for the altitude of the filters."""
        for each in self._filters.values():
            each.feed_height(height, nav)

    def set_terrain(self, ground: Ground | None) -> None:
        """The known ground."""
        self.flight.ground = ground or self.flight.ground
        for each in self._filters.values():
            each.set_terrain(ground)

    def tick(self, t_ns: int) -> None:
        """Compare positions once a second."""
        self._reference.tick(t_ns)
        if t_ns - self._sampled_ns >= SAMPLE_NS:
            self._sampled_ns = t_ns
            self._sample(t_ns)

    def see_mark(self, t_ns: int, mark: PositionMark) -> None:
        """The middle of a profile: the reference is known now."""
        self._mark = mark, self._reference.at(t_ns)
        for each in self._filters.values():
            each.feed_mark(t_ns, mark)

    def see_profile(self, task: MatchTask, fix: TerrainFix, marked: Estimate) -> None:
        """The end of a profile: match it with every method."""
        assert self._mark is not None
        mark, reference = self._mark
        for name, compared in self._methods.items():
            begin = time.process_time()
            found = compared.method.match(task)
            seconds = time.process_time() - begin
            compared.acquisition.drift_mps = drift_sd(marked)
            done = _decide(replace(fix, method=name), found, task, compared.acquisition, marked)
            error, cov = _error(done, marked, reference)
            self.flight.fixes[name].append(MethodFix(done, seconds, error, cov))
            if done.lat is not None and (done.valid or done.reasons == (Reason.REJECTED,)):
                self._filters[name].feed_fix(fix.t_ns, aiding_of(done, mark))
        bound = bound_cov(task, marked, reference) if reference else None
        self.flight.bounds.append(math.nan if bound is None else math.sqrt(np.trace(bound)))
        if bound is not None and reference is not None and np.sqrt(bound.diagonal()).max() < MAX_BOUND_SD_M:
            cov_n = float(bound[1, 1]), float(bound[0, 0]), float(bound[0, 1])
            self._filters[BOUND].feed_fix(fix.t_ns, MarkedPosition(mark, reference.lat, reference.lon, cov_n))

    def _sample(self, t_ns: int) -> None:
        reference = self._reference.at(t_ns)
        if reference is None:
            return
        self.flight.track.append((t_ns, reference))
        estimates = {name: each.estimate(t_ns) for name, each in self._filters.items()}
        known = {name: each for name, each in estimates.items() if each is not None}
        if self._mark is None or len(known) < len(estimates):
            return
        self.flight.outage_ns.append(t_ns)
        for name, estimate in known.items():
            lat, lon, alt = estimate.geodetic
            error = offset_m(lat, lon, alt, reference)
            sd = math.sqrt(np.trace(estimate.cov_n[:2, :2]))
            self.flight.filters[name].append(FilterSample(error, sd))


def _decide(
    fix: TerrainFix, found: MatchFix, task: MatchTask, acquisition: Acquisition, marked: Estimate
) -> TerrainFix:
    """The output of a match with its validity, as in flight."""
    confirmed = acquisition.add(found)
    reasons = refusal_reasons(found, is_confirmed=confirmed is not None or not fix.is_search)
    if not reasons and disagrees(found.shift, found.cov, task.limits, task.priors.position_cov):
        reasons = (Reason.REJECTED,)
    fix = replace(fix, valid=not reasons, reasons=reasons)
    return complete_fix(fix, found, marked, task.heights.ground)


def bound_cov(task: MatchTask, marked: Estimate, reference: ReferencePosition) -> Array | None:
    """Cramer-Rao bound of the position of a profile, east and north (2, 2) [m^2]; None without one.

    It follows from the slopes of the ground at the reference position and from the stated sigmas.
    """
    frame = task.heights.ground.terrain.frame
    alt = marked.geodetic[2]
    shift = (frame.to_local(reference.lat, reference.lon, alt) - frame.to_local(*marked.geodetic))[:2]
    profile, window, _ = task.search_area()
    minimum = Likelihood(window, profile, task.priors.drift_sd).at(shift)
    if not np.isfinite(minimum.information).all() or minimum.step is None:
        return None
    return np.asarray(np.linalg.inv(task.priors.independent_share * minimum.information))


def offset_m(lat: float, lon: float, alt: float, reference: ReferencePosition) -> Array:
    """A position minus the reference, north and east [m]."""
    per_lat, per_lon = metres_per_radian(reference.lat, alt)
    return np.array([(lat - reference.lat) * per_lat, (lon - reference.lon) * per_lon])


def _error(fix: TerrainFix, marked: Estimate, reference: ReferencePosition | None) -> tuple[Array | None, Array | None]:
    if reference is None or fix.lat is None or fix.lon is None:
        return None, None
    return offset_m(fix.lat, fix.lon, marked.geodetic[2], reference), reference.cov
