"""Test of attitude sources against the attitude of the filter, which velocities of satellites have levelled.

    |a - filter| > limit + 5.5 sqrt(sd_filter^2 + (rate s_t)^2)      for 5 s

Limit: 2 deg of roll and pitch, 5 deg of heading: an attitude that is farther off is wrong, whatever sigma it states.
The filter counts when satellites have aided it for 30 s, with a sigma of tilt below 0.5 deg.  Two sources that
contradict it alike agree with each other: then the filter is outvoted and refuses neither.  A unit whose gyros and
accelerometers the filter uses is tested like any other: its attitude is its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fti.nav.plausibility.attitude import TIME_SD_S, AttitudeComparison
from fti.nav.plausibility.budget import K_FALSE
from fti.nav.plausibility.finding import PlausibilityFinding
from fti.nav.time_series import SECOND_NS, wrap
from fti.types import FilterMode, FilterSolution, Reason

LIMITS = {"roll": math.radians(2.0), "pitch": math.radians(2.0), "heading": math.radians(5.0)}
#: A filter whose tilt is less certain refuses nothing [rad].
TILT_SD = math.radians(0.5)
MIN_AIDING_NS, MIN_DURATION_NS = 30 * SECOND_NS, 5 * SECOND_NS


@dataclass(slots=True)
class _Contradiction:
    """An attitude beyond its limit.  since_ns : from when on without a break"""

    since_ns: int
    text: str
    is_lasting: bool = False


class FilterAttitudeTest:
    """All sources of a comparison, each against the filter."""

    def __init__(self, comparison: AttitudeComparison) -> None:
        self._comparison = comparison
        self._aided_since_ns: int | None = None
        self._found: dict[str, _Contradiction] = {}

    def take(self, solution: FilterSolution) -> None:
        """Take a solution of the filter: compare with it what each source said at its time."""
        t_ns, aided = solution.t_ns, solution.valid and solution.mode is FilterMode.AIDED
        self._aided_since_ns = (self._aided_since_ns or t_ns) if aided else None
        is_level = solution.tilt_sd is not None and solution.tilt_sd < TILT_SD
        counts = self._aided_since_ns is not None and t_ns - self._aided_since_ns >= MIN_AIDING_NS and is_level
        if not counts:  # what it has refused stays refused until it can compare again
            self._found = {source: found for source, found in self._found.items() if found.is_lasting}
            return
        for source in self._comparison.sources:
            self._update(source, self._difference(source, solution), t_ns)

    def _update(self, source: str, text: str | None, t_ns: int) -> None:
        found = self._found.get(source)
        if not text:
            if text is not None:
                self._found.pop(source, None)
        elif found is None:
            self._found[source] = _Contradiction(t_ns, text)
        else:
            found.text, found.is_lasting = text, t_ns - found.since_ns >= MIN_DURATION_NS

    def _difference(self, source: str, solution: FilterSolution) -> str | None:
        """What a source differs in from the filter, in words; "" for nothing; None when it cannot be compared."""
        compared = False
        for name, limit in LIMITS.items():
            own = getattr(solution, name)
            sd = solution.heading_sd if name == "heading" else solution.tilt_sd
            value, rate = self._comparison.angle(source, name, solution.t_valid_ns or solution.t_ns)
            if value is None or own is None or sd is None:
                continue
            compared = True
            allowed, off = limit + K_FALSE * math.hypot(sd, rate * TIME_SD_S), wrap(value.value - own)
            if abs(off) > allowed:
                return (
                    f"{name} {math.degrees(off):+.1f} deg beside that of the filter, limit {math.degrees(allowed):.1f}"
                )
        return "" if compared else None

    def finding(self, source: str) -> PlausibilityFinding | None:
        """Against a source: it contradicts the filter, and no other source does so alike."""
        found = self._found.get(source)
        if found is None or not found.is_lasting:
            return None
        others = [name for name, one in self._found.items() if one.is_lasting and name != source]
        if any(not self._comparison.are_disputed(source, other) for other in others):
            return None
        return PlausibilityFinding(Reason.ATTITUDES_DISAGREE, found.since_ns, found.text)
