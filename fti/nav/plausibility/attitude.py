"""Compares attitude sources with each other: roll, pitch, heading of three or more, five times a second.

    |a - b| > 5.5 sqrt(sd_a^2 + sd_b^2 + (rate s_t)^2) + limit      for 2 s

Limit: 1 deg of roll and pitch (mounting), 5 deg of heading (magnetic headings are corrected only where the declination
is known).  A source that contradicts two others that agree with each other is refused.  With two sources alone an event
reports the disagreement, and neither is refused.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

from fti.constants import SECOND_NS
from fti.geodesy.formulas import wrap_half_turn
from fti.messages.measurements import Attitude
from fti.messages.reasons import Reason
from fti.nav.plausibility.budget import K_FALSE
from fti.nav.plausibility.finding import PlausibilityFinding
from fti.nav.source_interpolation import ATTITUDE_SD_UNKNOWN, MAX_PART_VALUES
from fti.nav.time_series import Series, Value

LIMITS = {"roll": math.radians(1.0), "pitch": math.radians(1.0), "heading": math.radians(5.0)}
#: Sigma of a heading that states none [rad].
HEADING_SD_UNKNOWN = math.radians(2.0)
#: One sigma of the time difference of two sources [s].
TIME_SD_S = 0.03
STEP_NS, MIN_DURATION_NS = SECOND_NS // 5, 2 * SECOND_NS
MAX_AGE_NS = SECOND_NS // 2
#: Minimum time between stored attitudes [ns].
MIN_STEP_NS = 35_000_000
Pair = tuple[str, str]


@dataclass(slots=True)
class _Dispute:
    """Two sources that disagree.  since_ns : begin; agreed_ns : first comparison within the limit since"""

    since_ns: int
    text: str
    is_lasting: bool = False
    agreed_ns: int | None = None


class AttitudeComparison:
    """Attitudes of several sources, by name."""

    def __init__(self) -> None:
        self._parts: dict[str, dict[str, Series]] = {}
        self._disputes: dict[Pair, _Dispute] = {}
        self._due_ns: int | None = None

    def feed(self, source: str, m: Attitude, t_ns: int) -> None:
        """Add an attitude valid at t_ns."""
        parts = self._parts.get(source)
        if parts is None:
            parts = self._parts[source] = {name: Series(angle=True) for name in LIMITS}
        newest_ns = parts["roll"].newest_ns
        if m.valid and m.roll is not None and newest_ns is not None and 0 <= t_ns - newest_ns < MIN_STEP_NS:
            return
        stated = (("roll", m.roll, m.roll_sd), ("pitch", m.pitch, m.pitch_sd), ("heading", m.heading, m.heading_sd))
        for name, value, sd in stated:
            if value is not None and abs(value) <= MAX_PART_VALUES[name]:
                is_stated = sd is not None and 0.0 < sd < math.inf
                parts[name].push(t_ns, value if m.valid else None, sd if is_stated else None)

    def compare(self, t_ns: int) -> list[tuple[Pair, str, bool]] | None:
        """Disputes that began (True) or ended (False) at a tick; None when no comparison was due."""
        if self._due_ns is not None and 0 <= self._due_ns - t_ns <= STEP_NS:
            return None
        self._due_ns = t_ns + STEP_NS
        changes = [self._update(pair, t_ns) for pair in combinations(sorted(self._parts), 2)]
        return [change for change in changes if change]

    def _update(self, pair: Pair, t_ns: int) -> tuple[Pair, str, bool] | None:
        text, dispute = self._difference(pair, t_ns), self._disputes.get(pair)
        if text is None:
            return None
        if dispute is None:
            if text:
                self._disputes[pair] = _Dispute(t_ns, text)
            return None
        if not text:
            return self._agree(pair, dispute, t_ns)
        dispute.text, dispute.agreed_ns = text, None
        if dispute.is_lasting or t_ns - dispute.since_ns < MIN_DURATION_NS:
            return None
        dispute.is_lasting = True
        return pair, text, True

    def _agree(self, pair: Pair, dispute: _Dispute, t_ns: int) -> tuple[Pair, str, bool] | None:
        if dispute.is_lasting and dispute.agreed_ns is None:
            dispute.agreed_ns = t_ns
        if dispute.is_lasting and t_ns - (dispute.agreed_ns or t_ns) < MIN_DURATION_NS:
            return None
        del self._disputes[pair]
        return (pair, "", False) if dispute.is_lasting else None

    def _difference(self, pair: Pair, t_ns: int) -> str | None:
        """Text of a difference of two sources beyond its limit; "" without one; None if they are not comparable."""
        compared = False
        for name, limit in LIMITS.items():
            series = [self._parts[source][name] for source in pair]
            at_ns = min(one.newest_ns or 0 for one in series)
            first, second = (one.at(at_ns, MAX_AGE_NS) for one in series)
            if first is None or second is None or t_ns - at_ns > 2 * MAX_AGE_NS:
                continue
            compared = True
            unknown = HEADING_SD_UNKNOWN if name == "heading" else ATTITUDE_SD_UNKNOWN
            rate = max(abs(one.slope(at_ns, SECOND_NS // 2, SECOND_NS // 10) or 0.0) for one in series)
            sd = math.hypot(first.sd or unknown, second.sd or unknown, rate * TIME_SD_S)
            if abs(wrap_half_turn(first.value - second.value)) > K_FALSE * sd + limit:
                degrees = math.degrees(wrap_half_turn(first.value - second.value))
                return f"{name} of {pair[0]} and {pair[1]} differ by {degrees:+.1f} deg"
        return "" if compared else None

    def angle(self, source: str, name: str, t_ns: int) -> tuple[Value | None, float]:
        """Roll, pitch or heading of a source at a time [rad], and the magnitude of its rate [rad/s]."""
        series = self._parts[source][name]
        return series.at(t_ns, MAX_AGE_NS), abs(series.slope(t_ns, SECOND_NS // 2, SECOND_NS // 10) or 0.0)

    def are_disputed(self, one: str, other: str) -> bool:
        """Whether two sources disagree at present."""
        return tuple(sorted((one, other))) in self._disputes

    def finding(self, source: str) -> PlausibilityFinding | None:
        """The finding against a source that contradicts two others that agree with each other."""
        against = [pair for pair, dispute in self._disputes.items() if dispute.is_lasting and source in pair]
        others = [name for pair in against for name in pair if name != source]
        if not any(tuple(sorted(two)) not in self._disputes for two in combinations(others, 2)):
            return None
        first = min((self._disputes[pair] for pair in against), key=lambda dispute: dispute.since_ns)
        return PlausibilityFinding(Reason.ATTITUDES_DISAGREE, first.since_ns, first.text)

    @property
    def sources(self) -> tuple[str, ...]:
        """All sources of an attitude so far."""
        return tuple(self._parts)

    def disputes_of(self, source: str) -> bool:
        """Whether a source disagrees with another one at present."""
        return any(dispute.is_lasting and source in pair for pair, dispute in self._disputes.items())
