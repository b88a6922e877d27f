"""What was said until the end of a flight, and what excuses that it was not said: the truth file's pauses, a start.

The unit under test has no say in it: neither how late it calls itself nor what its recorder left out is an excuse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fti.hil.tables.limits import ScoreLimits
from fti.post.score.observed_flags import ObservedFlags
from fti.post.score.truth_reader import FlightPause, FlightTruth, merge_pauses, overlap_s

#: What is judged over a window may have a pause in it from so long before [s].
BEFORE_S = 5.0


@dataclass(frozen=True, slots=True)
class ScoreEvidence:
    """What was said until the end of the flight.

    pauses    : of the bench, in order
    start_s   : until then the unit was starting, and might [s]
    has_ports : it was flown over real ports
    """

    observed_flags: ObservedFlags
    end_s: float
    pauses: Sequence[FlightPause]
    start_s: float
    has_ports: bool

    @classmethod
    def of_flight(cls, flight_truth: FlightTruth, observed_flags: ObservedFlags, limits: ScoreLimits) -> ScoreEvidence:
        """Of one flight."""
        start_s = min(max(observed_flags.first_report_s, 0.0), start_limit_s(flight_truth, limits))
        return cls(observed_flags, flight_truth.truth.end_s, flight_truth.pauses, start_s, flight_truth.real_time)

    def pause_time_s(self, from_s: float, until_s: float) -> float:
        """The bench was late for so much of an interval [s]."""
        return overlap_s(self.pauses, from_s, until_s)

    def last_pause_end_s(self, from_s: float, until_s: float) -> float | None:
        """When the bench had caught up with the last of its pauses in an interval [s]; None where it has none."""
        return max((p.until_s for p in self.pauses if p.from_s < until_s and p.until_s > from_s), default=None)

    def excused(self, from_s: float, until_s: float) -> float:
        """The same, and what of the interval is in the start [s]."""
        return overlap_s(merge_pauses((*self.pauses, FlightPause(0.0, self.start_s))), from_s, until_s)


def start_limit_s(flight_truth: FlightTruth, limits: ScoreLimits) -> float:
    """How long a unit may take until its first word [s]: its processes start while the sensors speak already.

    An accelerated one is there before.
    """
    return limits.start_s if flight_truth.real_time else 0.0
