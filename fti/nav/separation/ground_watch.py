"""Satellites and ground watch each other: the filter against a copy of it without satellites, which the ground bounds.

The copy begins when the filter has accepted a position from the ground, uses every later one and all aids but the
satellites, and is not replaced while the filter runs.  A slow ramp of the satellites, which the filter follows,
separates the filter from it.  A displaced map does the same: which of both is wrong is not known, so neither is
excluded.  The copy counts for the protection level while its own sigma is small enough to be a position.

Copies of the ring of the satellites use the ground as well.  They show a change in their short time, and the error of a
map does not change so fast: the satellites are excluded then.

Source: Brenner 1996 (solution separation).  Checked against: fti study ground-watch.
"""

from __future__ import annotations

from collections.abc import Sequence

from fti.config import Filter
from fti.nav.filter.position_mark import TERRAIN_POSITION
from fti.nav.filter.segment import FilterSegment, Piece
from fti.nav.separation.copy_ring import CopyRing
from fti.nav.separation.monitor import HORIZONTAL_AXES, Refusals, SeparationMonitor, SourceFault
from fti.nav.separation.protection import ProtectionLevels, copy_levels
from fti.nav.separation.source_class import QUANTITIES, RECEIVER_RING, is_recently_accepted, names_of

#: A copy with a larger sigma is no position: the alert limit of 200 m over twice the factor of the level [m].
MAX_SD_M = 27.0


class GroundWatch:
    """The copy without satellites.  settings : the aiding sources of the filter"""

    def __init__(self, settings: Filter) -> None:
        self._satellites = names_of(settings.gnss, QUANTITIES)
        ring = CopyRing(self._satellites, frozenset(), RECEIVER_RING)
        self.monitors = (SeparationMonitor(ring, HORIZONTAL_AXES),)

    @property
    def _monitor(self) -> SeparationMonitor:
        return self.monitors[0]

    @property
    def is_bounded(self) -> bool:
        """Whether the ground bounds the copy."""
        return any(separation.radial_sd <= MAX_SD_M for separation in self._monitor.separations)

    def clear(self) -> None:
        """Remove the copy."""
        self._monitor.clear()

    def follow(self, segment: FilterSegment, pieces: Sequence[Piece]) -> None:
        """Compare at the end of a segment; begin a copy after a position from the ground was accepted."""
        self._monitor.copy_ring.advance(pieces)
        ground = segment.end.gate_states.get(TERRAIN_POSITION)
        has_fix = ground is not None and ground.accepted_ns is not None and ground.refused_since_ns is None
        has_satellites = is_recently_accepted(segment.end, self._satellites)
        self._monitor.follow(segment.end, may_renew=has_fix and has_satellites, is_comparable=has_satellites)

    def levels(self, lag_s: float) -> ProtectionLevels:
        """Protection level of the copy, horizontally; zero while it is not bounded.  lag_s : its age"""
        if not self.is_bounded:
            return ProtectionLevels(0.0, 0.0)
        return ProtectionLevels(copy_levels(self._monitor.separations, lag_s)[0], 0.0)

    def find(self, segment: FilterSegment) -> SourceFault | None:
        """The contradiction at the end of a segment; None without one."""
        finding = self._monitor.find(segment.end.estimate.t_ns, Refusals())
        return None if finding is None else finding._replace(text=f"satellites against the ground: {finding.text}")
