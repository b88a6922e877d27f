"""Satellites and drifts over the ground watch each other, and the inertial unit watches the drifts.

Two rings of copies of the filter, each without one of them:

    without satellites   the inertial unit and the drifts: the position of the last satellites, moved over the ground
    without drifts       all other sources; without satellites it is the inertial unit alone, for some ten seconds

While satellites aid, a contradiction of either ring may be a fault of satellites or of drifts: none is excluded.  The
copies of the satellites without both (``source_class``) show which one it is when the fault is large enough.
Without satellites only the drifts can be wrong, and they are excluded.

After a long absence of satellites both rings give the protection level, in place of copies that coast since then: the
first one for faults of the satellites before the absence, the second one for faults of the drifts.  Like the level with
one receiver, it holds for faults of the drifts that began within the age of the oldest copy.

Source: Brenner 1996 (solution separation); the specification in docs/fault-detection.md.
Checked against: tests/nav/test_drift_watch.py.
"""

from __future__ import annotations

from collections.abc import Sequence

from fti.config import Filter
from fti.constants import SECOND_NS
from fti.nav.filter.innovation_gate import GateDecision
from fti.nav.filter.look_mark import MAX_GAP_NS, SCAN_DRIFT
from fti.nav.filter.segment import FilterSegment, Piece
from fti.nav.separation.copy_ring import CopyRing, RingSettings
from fti.nav.separation.monitor import HORIZONTAL_AXES, Refusals, SeparationMonitor, SourceFault
from fti.nav.separation.protection import ProtectionLevels, copy_levels
from fti.nav.separation.source_class import (
    COPIES,
    QUANTITIES,
    STEPS_NS,
    is_recently_accepted,
    names_beside_satellites,
    names_of,
)

#: Copies of each ring, and age of the younger one without satellites when the next one begins [ns].
RING_COPIES, WITHOUT_SATELLITES_NS = 2, 60 * SECOND_NS
#: A drift that was used within so long bounds the filter [ns].
USED_NS = MAX_GAP_NS


class DriftWatch:
    """Both rings.  settings : the aiding sources of the filter

    monitors : of the ring without satellites, and of that without drifts
    has_satellites : whether they aided the filter in the last segment
    """

    def __init__(self, settings: Filter) -> None:
        self._satellites = names_of(settings.gnss, QUANTITIES)
        without_satellites = self._satellites | names_beside_satellites(settings)
        self.monitors = tuple(
            SeparationMonitor(CopyRing(names, frozenset(), RingSettings(RING_COPIES, step_ns)), HORIZONTAL_AXES)
            for names, step_ns in (
                (without_satellites, WITHOUT_SATELLITES_NS),
                (frozenset({SCAN_DRIFT}), COPIES // RING_COPIES * STEPS_NS[settings.unit]),
            )
        )
        self._used_ns: int | None = None  # of the last drift that aided
        self.has_satellites = False

    def clear(self) -> None:
        """Remove all copies."""
        for monitor in self.monitors:
            monitor.clear()
        self._used_ns = None

    @property
    def is_complete(self) -> bool:
        """Whether both rings have a copy."""
        return all(monitor.copy_ring.copies for monitor in self.monitors)

    def follow(self, segment: FilterSegment, pieces: Sequence[Piece]) -> None:
        """Compare at the end of a segment; copies begin while drifts aid, those without satellites while these aid."""
        for entry in segment.entries:
            is_aid = entry.aiding.name == SCAN_DRIFT and not entry.aiding.own_states  # on trial it has own states
            if is_aid and entry.decision is GateDecision.ACCEPTED:
                self._used_ns = entry.t_ns
        is_used = self._used_ns is not None and segment.end.estimate.t_ns - self._used_ns <= USED_NS
        self.has_satellites = is_recently_accepted(segment.end, self._satellites)
        for monitor, is_comparable in zip(self.monitors, (self.has_satellites, is_used), strict=True):
            monitor.copy_ring.advance(pieces)
            monitor.follow(segment.end, may_renew=is_used and is_comparable, is_comparable=is_comparable)

    def levels(self, lag_s: float) -> ProtectionLevels:
        """Protection level of all copies, horizontally; zero without any.  lag_s : their age"""
        levels = [copy_levels(monitor.separations, lag_s)[0] for monitor in self.monitors]
        return ProtectionLevels(max(levels), 0.0)

    def find(self, segment: FilterSegment) -> SourceFault | None:
        """The contradiction of satellites and drifts; None without one, or without satellites."""
        if not self.has_satellites:
            return None
        findings = [monitor.find(segment.end.estimate.t_ns, Refusals()) for monitor in self.monitors]
        finding = next((each for each in findings if each is not None), None)
        return None if finding is None else finding._replace(text=f"satellites against drifts: {finding.text}")

    def find_wrong_drift(self, segment: FilterSegment) -> SourceFault | None:
        """Why the drifts are faulty; None while they are not, and while satellites aid."""
        if self.has_satellites:
            return None
        return self.monitors[1].find(segment.end.estimate.t_ns, Refusals())
