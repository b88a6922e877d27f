"""Test ``undulation``: a stated undulation of the geoid against EGM96 at the stated position."""

from __future__ import annotations

import math

from fti.geodesy.coarse_geoid import undulation
from fti.messages.measurements import Position
from fti.messages.reasons import Reason
from fti.nav.plausibility.finding import PlausibilityFinding

#: Consecutive fixes that make a finding.
MIN_FIXES = 3


def stated_undulation(m: Position) -> float | None:
    """The undulation of a message [m]: its own, or the difference of both of its heights."""
    if m.undulation is not None:
        return m.undulation
    return m.alt - m.alt_msl if m.alt is not None and m.alt_msl is not None else None


class UndulationTest:
    """Undulations of one source.  limit_m : maximum difference from the model [m]"""

    def __init__(self, limit_m: float) -> None:
        self._limit = limit_m
        self._beyond = 0
        self._since_ns = 0

    def update(self, t_ns: int, m: Position) -> list[PlausibilityFinding]:
        """Test a fix with position and undulation."""
        stated = stated_undulation(m)
        if stated is None or m.lat is None or m.lon is None or not math.isfinite(stated):
            return []
        known = undulation(m.lat, m.lon)
        if abs(stated - known) <= self._limit:
            self._beyond = 0
            return []
        if self._beyond == 0:
            self._since_ns = t_ns
        self._beyond += 1
        if self._beyond < MIN_FIXES:
            return []
        text = f"undulation {stated:.1f} m, EGM96 has {known:.1f} m there, limit {self._limit:.1f} m"
        return [PlausibilityFinding(Reason.UNDULATION, self._since_ns, text)]
