"""The observed flags of a flight, and the times in which a flag may be missing: pauses of the bench, start of the unit.

Lateness that the unit under test states, and gaps of its recorder, are no such times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fti.hil.tables.limits import ScoreLimits
from fti.post.score.observed_flags import ObservedFlags
from fti.post.score.truth_reader import FlightPause, FlightTruth, merge_pauses, overlap_s

#: A pause up to this time before an interval may be in the window of a test [s].
BEFORE_S = 5.0


@dataclass(frozen=True, slots=True)
class FlightObservation:
    """Observed flags of a flight, and the exempt times.

    pauses    : of the bench, in order
    start_s   : end of the allowed start of the unit [s]
    has_ports : the flight used real ports
    """

    observed_flags: ObservedFlags
    end_s: float
    pauses: Sequence[FlightPause]
    start_s: float
    has_ports: bool

    @classmethod
    def of_flight(
        cls, flight_truth: FlightTruth, observed_flags: ObservedFlags, limits: ScoreLimits
    ) -> FlightObservation:
        """Make the observation of one flight."""
        start_s = min(max(observed_flags.first_report_s, 0.0), start_limit_s(flight_truth, limits))
        return cls(observed_flags, flight_truth.truth.end_s, flight_truth.pauses, start_s, flight_truth.real_time)

    def last_pause_end_s(self, from_s: float, until_s: float) -> float | None:
        """End of the last pause of the bench in an interval [s]; None without a pause."""
        return max((p.until_s for p in self.pauses if p.from_s < until_s and p.until_s > from_s), default=None)

    def exempt_time_s(self, from_s: float, until_s: float) -> float:
        """Part of an interval in which the bench was late or the unit was starting [s]."""
        return overlap_s(merge_pauses((*self.pauses, FlightPause(0.0, self.start_s))), from_s, until_s)


def start_limit_s(flight_truth: FlightTruth, limits: ScoreLimits) -> float:
    """Time that a unit may take until its first report [s]: its processes start while the sensors already send.

    0 in an accelerated flight, which begins after the start.
    """
    return limits.start_s if flight_truth.real_time else 0.0
