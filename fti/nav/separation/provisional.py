"""Provisional filters: what the filter would give if an unconfirmed source were right.

A source is unconfirmed when it is refused, its own tests pass again for 30 s and 30 fixes, and nothing proves it right.
A copy of the filter then begins with the covariance that a readmission by the operator would give it, and is aided by
the source, too.  The filter goes on without the source, and navigation does not use the copy:

    HPL = |z - C| + max( 3.72 sigma_C, max over all copies of (|d| + 3.72 sigma_i) ) + tolerance       radial
    VPL = |z - C| + max( 3.09 sigma_C, max over all copies of (|d| + 3.09 sigma_i) ) + tolerance       one axis

z : position of the provisional filter;  C : that of the filter;  d, sigma_i, tolerance : as in ``protection``, where
the filter has copies.  If the source lies, the error is |z - C| and the error of the filter.

It ends when the source is readmitted, is silent for MAX_GAP_NS, or when the filter begins anew; also when the source is
outside the gate of its own provisional filter for REFUSED_NS, and then for HOLD_OFF_NS no other one begins.
Source: the specification in docs/fault-detection.md.  Checked against: tests/nav/test_provisional.py.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.one_point import radii
from fti.nav.filter.aiding import Aiding
from fti.nav.filter.estimate import Estimate, inflate_covariance
from fti.nav.filter.exclusion import NOT_EXCLUDED
from fti.nav.filter.innovation_gate import with_exclusion
from fti.nav.filter.segment import AidingEntry, FilterSegment, Piece, cut
from fti.nav.separation.copies import FilterCopy
from fti.nav.separation.monitor import QUANTITY_AXES, REFUSED_NS
from fti.nav.separation.protection import ProtectionLevels
from fti.nav.separation.readmission import AGREED_NS, MAX_GAP_NS
from fti.types import FilterSolution, ProvisionalSolution, Reason

Array = NDArray[np.float64]

HOLD_OFF_NS = AGREED_NS
#: Measurements that wait for the segment in which they were true, a second or two of three receivers of 100 Hz.
MAX_WAITING = 1024
#: A source that is farther from the filter has no provisional filter [m]: gravity there has another direction, by more
#: than the filter's errors of attitude.
MAX_DISTANCE = 2000.0


class Offset(NamedTuple):
    """A provisional filter against the filter at the time of an output.

    offset_n : ndarray, shape (6,)   its position [m] and velocity [m/s] minus those of the filter, north, east, down
    sd_n     : ndarray, shape (6,)   sigmas of the provisional filter
    names    : of ``Aiding``, with which the source aids here alone
    """

    offset_n: Array
    sd_n: Array
    names: frozenset[str]


class ProvisionalResult(NamedTuple):
    """One for its output.  readmission : what would readmit the source"""

    device: str
    offset: Offset
    levels: ProtectionLevels
    readmission: str


class _OwnRefusal(NamedTuple):
    """An unconfirmed source that its own tests refuse: names of ``Aiding``, what would readmit it, its newest fix."""

    names: frozenset[str]
    readmission: str
    newest_ns: int


@dataclass(slots=True)
class ProvisionalFilter:
    """Of one source.  names : of ``Aiding``;  heard_ns : newest fix of the source;  distance : from the filter [m]"""

    names: frozenset[str]
    copy: FilterCopy
    last_fix_ns: int
    distance: float

    @classmethod
    def begin(cls, segment: FilterSegment, names: frozenset[str], disagreement: float) -> ProvisionalFilter:
        """At the end of a segment.  disagreement : so far the source is from the filter [m]"""
        here, gate_states = segment.end
        books = with_exclusion(gate_states, [(name, NOT_EXCLUDED) for name in names])
        copy = FilterCopy(here.t_ns, inflate_covariance(here, disagreement), books, frozenset())
        return cls(names, copy, here.t_ns, disagreement)

    @property
    def is_aided(self) -> bool:
        """Whether a fix of the source has aided it; before, it is the filter with a wide covariance."""
        books = (self.copy.gate_states[name] for name in self.names if name in self.copy.gate_states)
        return any(book.accepted_ns is not None and book.bounds for book in books)

    @property
    def is_contradicted(self) -> bool:
        """Whether the source is outside the gate of this filter for so long that it does not agree with itself."""
        books = (self.copy.gate_states[name] for name in self.names if name in self.copy.gate_states)
        since_ns = (book.refused_since_ns for book in books if book.refused_since_ns is not None)
        return any(self.copy.estimate.t_ns - t_ns >= REFUSED_NS for t_ns in since_ns)

    def find_offset(self, final: Estimate, lag_s: float) -> Offset:
        """Against the filter at the same time, moved on by ``lag_s``."""
        to_n, here = final.mat_en.T, self.copy.estimate
        vel = to_n @ (here.y[3:6] - final.y[3:6])
        pos = to_n @ (here.y[:3] - final.y[:3]) + lag_s * vel
        sd = here.sd_n
        moved = np.hypot(sd[:3], lag_s * sd[3:6])
        return Offset(np.concatenate((pos, vel)), np.concatenate((moved, sd[3:6])), self.names)


class ProvisionalFilters:
    """Of all unconfirmed sources of one filter, by device."""

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

        names : of ``Aiding``, with which the source is unconfirmed; others of ``parts`` are left out
        """
        self._own[device] = _OwnRefusal(names, readmission, t_ns)
        there = {(entry.t_ns, entry.aiding.name) for entry in self._waiting}
        new = (part for part in parts if part.name in names and (t_ns, part.name) not in there)
        self._waiting.extend(AidingEntry(t_ns, part) for part in new)

    def distance(self, device: str) -> float | None:
        """Of the provisional filter of a source from the filter, at the last segment [m]; None: it has none."""
        found = self._filters.get(device)
        return found.distance if found else None

    def end(self, device: str) -> list[AidingEntry]:
        """The source is readmitted; its measurements that were not yet used, in order of time."""
        self._filters.pop(device, None)
        self._own.pop(device, None)
        mine = [entry for entry in self._waiting if _device_of(entry) == device]
        self._waiting = deque((e for e in self._waiting if _device_of(e) != device), maxlen=MAX_WAITING)
        return sorted(mine, key=lambda entry: entry.t_ns)

    def clear(self) -> None:
        """The filter has begun again."""
        self._filters.clear()
        self._own.clear()
        self._waiting.clear()
        self._held_off_ns.clear()

    def follow(self, segment: FilterSegment, pieces: Sequence[Piece], excluded: Mapping[str, frozenset[str]]) -> None:
        """Follow the filter through a segment; begin and end provisional filters.

        excluded : names of receivers that the filter excludes and that are unconfirmed, by device
        """
        waiting = self._take_waiting(segment)
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
        here = self._filters.get(device)
        if here is None:
            return
        here.copy.advance(pieces)
        end_ns = segment.end.estimate.t_ns
        here.last_fix_ns = end_ns if fixes else here.last_fix_ns
        here.distance = float(np.linalg.norm(here.copy.estimate.y[:3] - segment.end.estimate.y[:3]))
        if here.is_contradicted:
            self._held_off_ns[device] = end_ns + HOLD_OFF_NS
        if here.is_contradicted or end_ns - here.last_fix_ns >= MAX_GAP_NS or not names <= here.names:
            del self._filters[device]

    def _take_waiting(self, segment: FilterSegment) -> dict[str, list[AidingEntry]]:
        """Measurements that were true in a segment, by device, in order of time; older ones came too late."""
        end_ns, found = segment.end.estimate.t_ns, dict[str, list[AidingEntry]]()
        if not self._waiting:
            return found
        for entry in sorted((e for e in self._waiting if segment.begin_ns < e.t_ns <= end_ns), key=lambda e: e.t_ns):
            found.setdefault(_device_of(entry), []).append(entry)
        self._waiting = deque((e for e in self._waiting if e.t_ns > end_ns), maxlen=MAX_WAITING)
        return found

    def own_readmission(self, device: str) -> str:
        """What would readmit a source that its own tests refuse; "" where they do not."""
        own = self._own.get(device)
        return own.readmission if own and self._end_ns - own.newest_ns < MAX_GAP_NS else ""

    def find_offsets(self, final: Estimate, lag_s: float) -> list[tuple[str, Offset]]:
        """By device, at the time of the final estimate of the filter.  lag_s : how old that is"""
        found = {d: f for d, f in self._filters.items() if f.is_aided and f.copy.estimate.t_ns == final.t_ns}
        return [(device, found[device].find_offset(final, lag_s)) for device in sorted(found)]


def make_solution(here: FilterSolution, found: ProvisionalResult) -> ProvisionalSolution:
    """The output beside a valid solution of the filter at the same time."""
    assert here.lat is not None and here.lon is not None and here.alt is not None
    assert here.vel_north is not None and here.vel_east is not None and here.vel_down is not None
    north, east, down, *vel = found.offset.offset_n.tolist()
    sd = found.offset.sd_n.tolist()
    meridian, normal = radii(here.lat)
    return ProvisionalSolution(
        t_ns=here.t_ns,
        t_valid_ns=here.t_valid_ns,
        source=found.device,
        valid=False,
        reasons=(Reason.UNCONFIRMED,),
        quantities=tuple(name for name in QUANTITY_AXES if f"{found.device}.{name}" in found.offset.names),
        lat=here.lat + north / (meridian + here.alt),
        lon=here.lon + east / ((normal + here.alt) * math.cos(here.lat)),
        alt=here.alt - down,
        horizontal_sd=max(sd[:2]),
        vertical_sd=sd[2],
        vel_north=here.vel_north + vel[0],
        vel_east=here.vel_east + vel[1],
        vel_down=here.vel_down + vel[2],
        vel_sd=max(sd[3:]),
        distance=math.hypot(north, east),
        height_difference=-down,
        hpl=found.levels.horizontal,
        vpl=found.levels.vertical,
        readmission=found.readmission,
    )


def _device_of(entry: AidingEntry) -> str:
    return entry.aiding.name.rpartition(".")[0]


def _merge_entries(segment: FilterSegment, more: Sequence[AidingEntry]) -> FilterSegment:
    return segment._replace(entries=tuple(sorted((*segment.entries, *more), key=lambda entry: entry.t_ns)))


def _distance(segment: FilterSegment, fixes: Iterable[AidingEntry]) -> float:
    """The largest innovation of fixes against the filter [m], each at the inertial sample next to its time."""
    found = 0.0
    for fix in fixes:
        here = min((m.estimate for m in segment.moments), key=lambda estimate: abs(estimate.t_ns - fix.t_ns))
        found = max(found, float(np.linalg.norm(fix.aiding.compute_matrices(here)[0])))
    return found
