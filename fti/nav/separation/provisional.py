"""Provisional filters: results of the filter under the assumption that an unconfirmed source is correct.

A refused source is unconfirmed when its own tests pass again for 30 s and 30 fixes without independent proof.  A copy
of the filter then starts with the covariance of a readmission by the operator, and is aided by the source, too.  The
filter continues without the source, and navigation does not use the copy:

    HPL = |z - C| + max( 3.72 sigma_C, max over all copies of (|d| + 3.72 sigma_i) ) + tolerance       radial
    VPL = |z - C| + max( 3.09 sigma_C, max over all copies of (|d| + 3.09 sigma_i) ) + tolerance       one axis

z : position of the provisional filter;  C : that of the filter;  d, sigma_i, tolerance : as in ``protection``, if the
filter has copies.  If the source is wrong, the error is |z - C| plus the error of the filter.

It ends when the source is readmitted or silent for MAX_GAP_NS, or the filter restarts.  It also ends when the source is
outside the gate of its own provisional filter for REFUSED_NS; then no other one starts for HOLD_OFF_NS.
Source: the specification in docs/fault-detection.md.  Checked against: tests/nav/test_provisional.py.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.geodesy.formulas import metres_per_radian
from fti.messages.outputs import FilterSolution, ProvisionalSolution
from fti.messages.reasons import Reason
from fti.nav.filter.aiding import Aiding
from fti.nav.filter.estimate import Estimate, inflate_covariance
from fti.nav.filter.exclusion import NOT_EXCLUDED
from fti.nav.filter.innovation_gate import with_exclusion
from fti.nav.filter.segment import AidingEntry, FilterSegment, Piece, cut
from fti.nav.separation.copies import FilterCopy
from fti.nav.separation.monitor import QUANTITY_AXES, REFUSED_NS
from fti.nav.separation.protection import ProtectionLevels
from fti.nav.separation.readmission import AGREED_NS, MAX_GAP_NS

HOLD_OFF_NS = AGREED_NS
#: Maximum number of measurements that wait for their segment: 1 s to 2 s of three receivers of 100 Hz.
MAX_WAITING = 1024
#: Maximum distance of a source from the filter [m]: farther away the direction of gravity differs by more than the
#: filter's attitude errors.
MAX_DISTANCE = 2000.0


class Offset(NamedTuple):
    """A provisional filter against the filter at the time of an output.

    offset_n : ndarray, shape (6,)   its position [m] and velocity [m/s] minus those of the filter, north, east, down
    sd_n     : ndarray, shape (6,)   sigmas of the provisional filter
    names    : of the ``Aiding`` of the source that aids only here
    """

    offset_n: Array
    sd_n: Array
    names: frozenset[str]


class ProvisionalResult(NamedTuple):
    """A provisional filter for output.  readmission : the ways to readmit the source"""

    device: str
    offset: Offset
    levels: ProtectionLevels
    readmission: str


class _OwnRefusal(NamedTuple):
    """An unconfirmed source that its own tests refuse: names of ``Aiding``, ways to readmit it, its newest fix."""

    names: frozenset[str]
    readmission: str
    newest_ns: int


@dataclass(slots=True)
class ProvisionalFilter:
    """Of one source.  names : of ``Aiding``;  last_fix_ns : its newest fix;  distance : from the filter [m]"""

    names: frozenset[str]
    copy: FilterCopy
    last_fix_ns: int
    distance: float

    @classmethod
    def begin(cls, segment: FilterSegment, names: frozenset[str], disagreement: float) -> ProvisionalFilter:
        """Start at the end of a segment.  disagreement : distance of the source from the filter [m]"""
        estimate, gate_states = segment.end
        gate_states = with_exclusion(gate_states, [(name, NOT_EXCLUDED) for name in names])
        copy = FilterCopy(estimate.t_ns, inflate_covariance(estimate, disagreement), gate_states, frozenset())
        return cls(names, copy, estimate.t_ns, disagreement)

    @property
    def is_aided(self) -> bool:
        """Whether a fix of the source has aided it; before, it equals the filter with a wide covariance."""
        states = (self.copy.gate_states[name] for name in self.names if name in self.copy.gate_states)
        return any(state.accepted_ns is not None and state.bounds for state in states)

    @property
    def is_contradicted(self) -> bool:
        """Whether the source is outside the gate of this filter for REFUSED_NS."""
        states = (self.copy.gate_states[name] for name in self.names if name in self.copy.gate_states)
        since_ns = (state.refused_since_ns for state in states if state.refused_since_ns is not None)
        return any(self.copy.estimate.t_ns - t_ns >= REFUSED_NS for t_ns in since_ns)

    def find_offset(self, final: Estimate, lag_s: float) -> Offset:
        """Offset from the filter at the same time, extrapolated by ``lag_s``."""
        to_n, estimate = final.mat_en.T, self.copy.estimate
        vel = to_n @ (estimate.y[3:6] - final.y[3:6])
        pos = to_n @ (estimate.y[:3] - final.y[:3]) + lag_s * vel
        sd = estimate.sd_n
        position_sd = np.hypot(sd[:3], lag_s * sd[3:6])
        return Offset(np.concatenate((pos, vel)), np.concatenate((position_sd, sd[3:6])), self.names)


class ProvisionalFilters:
    """Provisional filters of all unconfirmed sources, by device."""

    def __init__(self) -> None:
        self._filters: dict[str, ProvisionalFilter] = {}
        self._waiting: deque[AidingEntry] = deque(maxlen=MAX_WAITING)
        self._own: dict[str, _OwnRefusal] = {}
        self._end_ns = 0
        self._held_off_ns: dict[str, int] = {}

    @property
    def is_any(self) -> bool:
        """Whether any source is unconfirmed and has a provisional filter."""
        return bool(self._filters)

    def feed_aiding(
        self, device: str, names: frozenset[str], readmission: str, t_ns: int, parts: Iterable[Aiding]
    ) -> None:
        """Take a measurement of an unconfirmed source that its own tests refuse; it does not aid the filter.

        names : of the unconfirmed ``Aiding``; other ``parts`` are ignored
        """
        self._own[device] = _OwnRefusal(names, readmission, t_ns)
        known = {(entry.t_ns, entry.aiding.name) for entry in self._waiting}
        new = (part for part in parts if part.name in names and (t_ns, part.name) not in known)
        self._waiting.extend(AidingEntry(t_ns, part) for part in new)

    def distance(self, device: str) -> float | None:
        """Distance of a provisional filter from the filter at the last segment [m]; None: the source has none."""
        provisional = self._filters.get(device)
        return provisional.distance if provisional else None

    def end(self, device: str) -> list[AidingEntry]:
        """The source is readmitted: returns its unused measurements, in order of time."""
        self._filters.pop(device, None)
        self._own.pop(device, None)
        mine = [entry for entry in self._waiting if _device_of(entry) == device]
        self._waiting = deque((e for e in self._waiting if _device_of(e) != device), maxlen=MAX_WAITING)
        return sorted(mine, key=lambda entry: entry.t_ns)

    def clear(self) -> None:
        """The filter has restarted."""
        self._filters.clear()
        self._own.clear()
        self._waiting.clear()
        self._held_off_ns.clear()

    def follow(self, segment: FilterSegment, pieces: Sequence[Piece], excluded: Mapping[str, frozenset[str]]) -> None:
        """Follow the filter through a segment; start and end provisional filters.

        excluded : names of unconfirmed receivers that the filter excludes, by device
        """
        waiting = self._drain_waiting(segment)
        if not (waiting or excluded or self._filters):
            return
        end_ns = self._end_ns = segment.end.estimate.t_ns
        for device in dict.fromkeys((*self._filters, *excluded, *waiting)):
            mine = waiting.get(device, [])
            names = excluded.get(device, frozenset())
            if mine and (own := self._own.get(device)):
                names |= own.names
            fixes = [e for e in (*segment.entries, *mine) if e.aiding.name in names and e.aiding.bounds]
            self._advance(device, names, segment, pieces if not mine else cut(_merge_entries(segment, mine)), fixes)
            if device not in self._filters and fixes and end_ns >= self._held_off_ns.get(device, end_ns):
                self._begin(device, names, segment, _distance(segment, fixes))

    def _begin(self, device: str, names: frozenset[str], segment: FilterSegment, distance: float) -> None:
        if distance <= MAX_DISTANCE:
            self._filters[device] = ProvisionalFilter.begin(segment, names, distance)

    def _advance(
        self,
        device: str,
        names: frozenset[str],
        segment: FilterSegment,
        pieces: Sequence[Piece],
        fixes: Sequence[AidingEntry],
    ) -> None:
        trial = self._filters.get(device)
        if trial is None:
            return
        trial.copy.advance(pieces)
        end_ns = segment.end.estimate.t_ns
        trial.last_fix_ns = end_ns if fixes else trial.last_fix_ns
        trial.distance = float(np.linalg.norm(trial.copy.estimate.y[:3] - segment.end.estimate.y[:3]))
        if trial.is_contradicted:
            self._held_off_ns[device] = end_ns + HOLD_OFF_NS
        if trial.is_contradicted or end_ns - trial.last_fix_ns >= MAX_GAP_NS or not names <= trial.names:
            del self._filters[device]

    def _drain_waiting(self, segment: FilterSegment) -> dict[str, list[AidingEntry]]:
        """Measurements valid in a segment, by device, in order of time; older ones came too late."""
        end_ns, entries = segment.end.estimate.t_ns, dict[str, list[AidingEntry]]()
        if not self._waiting:
            return entries
        for entry in sorted((e for e in self._waiting if segment.begin_ns < e.t_ns <= end_ns), key=lambda e: e.t_ns):
            entries.setdefault(_device_of(entry), []).append(entry)
        self._waiting = deque((e for e in self._waiting if e.t_ns > end_ns), maxlen=MAX_WAITING)
        return entries

    def own_readmission(self, device: str) -> str:
        """The ways to readmit a source that its own tests refuse; "" if they do not refuse it."""
        own = self._own.get(device)
        return own.readmission if own and self._end_ns - own.newest_ns < MAX_GAP_NS else ""

    def find_offsets(self, final: Estimate, lag_s: float) -> list[tuple[str, Offset]]:
        """Offsets by device, at the time of the final estimate of the filter.  lag_s : its age"""
        filters = {d: f for d, f in self._filters.items() if f.is_aided and f.copy.estimate.t_ns == final.t_ns}
        return [(device, filters[device].find_offset(final, lag_s)) for device in sorted(filters)]


def make_solution(solution: FilterSolution, result: ProvisionalResult) -> ProvisionalSolution:
    """The provisional output for a valid solution of the filter at the same time."""
    assert solution.lat is not None and solution.lon is not None and solution.alt is not None
    assert solution.vel_north is not None and solution.vel_east is not None and solution.vel_down is not None
    north, east, down, *vel = result.offset.offset_n.tolist()
    sd = result.offset.sd_n.tolist()
    per_lat, per_lon = metres_per_radian(solution.lat, solution.alt)
    return ProvisionalSolution(
        t_ns=solution.t_ns,
        t_valid_ns=solution.t_valid_ns,
        source=result.device,
        valid=False,
        reasons=(Reason.UNCONFIRMED,),
        quantities=tuple(name for name in QUANTITY_AXES if f"{result.device}.{name}" in result.offset.names),
        lat=solution.lat + north / per_lat,
        lon=solution.lon + east / per_lon,
        alt=solution.alt - down,
        horizontal_sd=max(sd[:2]),
        vertical_sd=sd[2],
        vel_north=solution.vel_north + vel[0],
        vel_east=solution.vel_east + vel[1],
        vel_down=solution.vel_down + vel[2],
        vel_sd=max(sd[3:]),
        distance=math.hypot(north, east),
        height_difference=-down,
        hpl=result.levels.horizontal,
        vpl=result.levels.vertical,
        readmission=result.readmission,
    )


def _device_of(entry: AidingEntry) -> str:
    return entry.aiding.name.rpartition(".")[0]


def _merge_entries(segment: FilterSegment, more: Sequence[AidingEntry]) -> FilterSegment:
    return segment._replace(entries=tuple(sorted((*segment.entries, *more), key=lambda entry: entry.t_ns)))


def _distance(segment: FilterSegment, fixes: Iterable[AidingEntry]) -> float:
    """The largest innovation of fixes with the filter [m], each at the inertial sample nearest to its time."""
    largest = 0.0
    for fix in fixes:
        estimate = min((m.estimate for m in segment.moments), key=lambda estimate: abs(estimate.t_ns - fix.t_ns))
        largest = max(largest, float(np.linalg.norm(fix.aiding.compute_matrices(estimate)[0])))
    return largest
