"""Compares attitude sources with the attitude of the filter, which is levelled by GNSS velocities.

    |a - filter| > limit + 5.5 sqrt(sd_filter^2 + (rate s_t)^2)      for 5 s

Limit: 2 deg of roll and pitch, 5 deg of heading: an attitude beyond is wrong for any stated sigma.  The filter is used
when satellites have aided it for 30 s and the sigma of its tilt is below 0.5 deg.  If two sources agree with each other
and contradict the filter, it is outvoted and refuses neither.  A unit whose gyros and accelerometers the filter uses is
tested as well, because its attitude solution is independent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fti.constants import SECOND_NS
from fti.geodesy.formulas import wrap_half_turn
from fti.messages.outputs import FilterMode, FilterSolution
from fti.messages.reasons import Reason
from fti.nav.plausibility.attitude import TIME_SD_S, AttitudeComparison
from fti.nav.plausibility.budget import K_FALSE
from fti.nav.plausibility.finding import PlausibilityFinding

LIMITS = {"roll": math.radians(2.0), "pitch": math.radians(2.0), "heading": math.radians(5.0)}
#: Maximum sigma of the tilt of a filter that refuses [rad].
TILT_SD = math.radians(0.5)
MIN_AIDING_NS, MIN_DURATION_NS = 30 * SECOND_NS, 5 * SECOND_NS


@dataclass(slots=True)
class _Contradiction:
    """An attitude beyond its limit.  since_ns : begin, without interruption since"""

    since_ns: int
    text: str
    is_lasting: bool = False


class FilterAttitudeTest:
    """All sources of a comparison, each against the filter."""

    def __init__(self, comparison: AttitudeComparison) -> None:
        self._comparison = comparison
        self._aided_since_ns: int | None = None
        self._contradictions: dict[str, _Contradiction] = {}

    def feed(self, solution: FilterSolution) -> None:
        """Compare each source at the time of a filter solution with it."""
        t_ns, aided = solution.t_ns, solution.valid and solution.mode is FilterMode.AIDED
        self._aided_since_ns = (self._aided_since_ns or t_ns) if aided else None
        is_level = solution.tilt_sd is not None and solution.tilt_sd < TILT_SD
        counts = self._aided_since_ns is not None and t_ns - self._aided_since_ns >= MIN_AIDING_NS and is_level
        if not counts:  # a refusal stays until the next comparison
            self._contradictions = {source: c for source, c in self._contradictions.items() if c.is_lasting}
            return
        for source in self._comparison.sources:
            self._update(source, self._difference(source, solution), t_ns)

    def _update(self, source: str, text: str | None, t_ns: int) -> None:
        contradiction = self._contradictions.get(source)
        if not text:
            if text is not None:
                self._contradictions.pop(source, None)
        elif contradiction is None:
            self._contradictions[source] = _Contradiction(t_ns, text)
        else:
            contradiction.text, contradiction.is_lasting = text, t_ns - contradiction.since_ns >= MIN_DURATION_NS

    def _difference(self, source: str, solution: FilterSolution) -> str | None:
        """Text of a difference of a source from the filter; "" without one; None if it is not comparable."""
        compared = False
        for name, limit in LIMITS.items():
            own = getattr(solution, name)
            sd = solution.heading_sd if name == "heading" else solution.tilt_sd
            value, rate = self._comparison.angle(source, name, solution.t_valid_ns or solution.t_ns)
            if value is None or own is None or sd is None:
                continue
            compared = True
            allowed, off = limit + K_FALSE * math.hypot(sd, rate * TIME_SD_S), wrap_half_turn(value.value - own)
            if abs(off) > allowed:
                return f"{name} {math.degrees(off):+.1f} deg from that of the filter, limit {math.degrees(allowed):.1f}"
        return "" if compared else None

    def finding(self, source: str) -> PlausibilityFinding | None:
        """The finding against a source that contradicts the filter, unless another source agrees with it."""
        contradiction = self._contradictions.get(source)
        if contradiction is None or not contradiction.is_lasting:
            return None
        others = [name for name, one in self._contradictions.items() if one.is_lasting and name != source]
        if any(not self._comparison.are_disputed(source, other) for other in others):
            return None
        return PlausibilityFinding(Reason.ATTITUDES_DISAGREE, contradiction.since_ns, contradiction.text)
