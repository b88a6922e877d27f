"""The outcome of a flight, and the lateness of the bench in it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from fti.post.score.flight_observation import FlightObservation
from fti.post.score.rows import BENCH, FAILURES, FlightFinding, Result
from fti.post.score.truth_reader import FlightPause, length_s
from fti.post.score.unexpected_flags import AFTER_PAUSE_S, WINDOW_S

#: The bench may be late for this part of a flight; four fifths of a flight are enough for a score.
MAX_LATE_SHARE = 0.2
#: After each pause of the bench, unexplained flags are not compared for some seconds.  Limit for the sum of these
#: times: otherwise a bench with a short pause every ten seconds would explain every flag.
MAX_UNCOMPARED_SHARE = 0.5


class FlightOutcome(StrEnum):
    """The outcome of a flight."""

    HOLDS = "holds"
    FAILED = "failed"
    INCONCLUSIVE = "inconclusive"


@dataclass(frozen=True, slots=True)
class UnscoredFlight:
    """Why there is no score.

    name : of the scenario or session; reason : one sentence; exit_code : of the command
    """

    name: str
    reason: str
    exit_code: int


@dataclass(frozen=True, slots=True)
class BenchLateness:
    """Pauses of the bench in a flight.

    share : part of the flight, 0 to 1; number : of pauses; longest_s : [s]; total_s : sum [s]
    uncompared_share : part in which unexplained flags are not compared because of them
    compared_s     : time in which they are compared [s]
    """

    share: float
    number: int
    longest_s: float
    total_s: float
    uncompared_share: float
    compared_s: float


def measure_lateness(observation: FlightObservation) -> BenchLateness:
    """Measure the pauses of the bench in a flight."""
    end_s, pauses = observation.end_s, observation.pauses
    total_s = _in_flight(pauses, end_s)
    after = [FlightPause(p.from_s, p.until_s + AFTER_PAUSE_S) for p in pauses]
    start = FlightPause(0.0, observation.start_s + WINDOW_S)
    longest_s = max((p.until_s - p.from_s for p in pauses), default=0.0)
    return BenchLateness(
        total_s / end_s,
        len(pauses),
        longest_s,
        total_s,
        _in_flight(after, end_s) / end_s,
        end_s - _in_flight([start, *after], end_s),
    )


def _in_flight(pauses: Iterable[FlightPause], end_s: float) -> float:
    cut = (FlightPause(max(p.from_s, 0.0), min(p.until_s, end_s)) for p in pauses)
    return length_s(p for p in cut if p.until_s > p.from_s)


def bench_finding(lateness: BenchLateness, results: Sequence[Result]) -> FlightFinding:
    """Check that the bench was in time for most of the flight.  results : of flags and of ``[[expect]]``"""
    late, found = results.count(Result.LATE_BENCH), results.count(Result.FOUND)
    text = f"the bench was late for {lateness.share:.0%} of the flight; {MAX_LATE_SHARE:.0%} are allowed"
    holds = lateness.share <= MAX_LATE_SHARE
    if holds and lateness.uncompared_share > MAX_UNCOMPARED_SHARE:
        holds = False
        text = (
            f"the bench was late {lateness.number} times, so that unexpected flags are not compared in "
            f"{lateness.uncompared_share:.0%} of the flight; {MAX_UNCOMPARED_SHARE:.0%} are allowed"
        )
    elif holds and late > found:
        holds, text = False, f"the bench was late for {late} expected flags, and {found} were found"
    elif holds and lateness.compared_s <= 0.0 and not found:
        holds, text = False, "nothing was compared: the flight is too short"
    return FlightFinding(BENCH, "bench in time", Result.HOLDS if holds else Result.LATE_BENCH, text)


def truth_finding(complete: bool) -> FlightFinding | None:
    """The finding on an incomplete truth file, which makes the flight inconclusive; None where it is complete."""
    if complete:
        return None
    return FlightFinding(
        BENCH, "bench in time", Result.LATE_BENCH, "the truth file lacks rows, or the end of its flight"
    )


def decide(results: Iterable[Result], unexpected: bool, bench: FlightFinding) -> FlightOutcome:
    """The outcome.  A miss fails the flight, even if the bench was late at other times.

    results : of all rows; unexpected : there was an unexplained flag
    """
    if unexpected or not FAILURES.isdisjoint(results):
        return FlightOutcome.FAILED
    return FlightOutcome.HOLDS if bench.result is Result.HOLDS else FlightOutcome.INCONCLUSIVE
