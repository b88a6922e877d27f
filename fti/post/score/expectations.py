"""The rows of ``[[expect]]``: was the value reached in time?"""

from __future__ import annotations

from fti.hil.tables.schema import Expectation
from fti.post.score.flight_observation import BEFORE_S, FlightObservation
from fti.post.score.rows import ExpectationRow, Result


def meet_expectation(expectation: Expectation, observation: FlightObservation) -> ExpectationRow:
    """Score a row of ``[[expect]]``."""
    begin, end = expectation.at_s, expectation.at_s + expectation.within_s
    if end > observation.end_s:
        return ExpectationRow(expectation, Result.NOT_FLOWN, None, None)
    during = [(t, value) for t, value in observation.observed_flags.values[expectation.channel] if begin <= t <= end]
    for t, value in during:
        if _is_met(expectation, value):
            return ExpectationRow(expectation, Result.FOUND, t - begin, value)
    result = Result.MISSING
    if begin < observation.start_s:
        result = Result.START
    elif observation.pause_time_s(begin - BEFORE_S, end):
        result = Result.LATE_BENCH
    return ExpectationRow(expectation, result, None, during[-1][1] if during else None)


def _is_met(expectation: Expectation, value: object) -> bool:
    expected = expectation.value
    if isinstance(value, list):
        return expected in value
    if isinstance(expected, bool | str) or isinstance(value, bool) or not isinstance(value, int | float):
        return value == expected
    return expected - expectation.minus <= value <= expected + expectation.plus
