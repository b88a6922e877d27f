"""The rows of ``[[expect]]``: was the value reached in time?"""

from __future__ import annotations

from fti.hil.tables.schema import Expectation
from fti.post.score.evidence import BEFORE_S, ScoreEvidence
from fti.post.score.rows import ExpectationRow, Verdict


def meet_expectation(expectation: Expectation, evidence: ScoreEvidence) -> ExpectationRow:
    """Score a row of ``[[expect]]``."""
    begin, end = expectation.at_s, expectation.at_s + expectation.within_s
    if end > evidence.end_s:
        return ExpectationRow(expectation, Verdict.NOT_FLOWN, None, None)
    during = [(t, value) for t, value in evidence.observed_flags.values[expectation.channel] if begin <= t <= end]
    for t, value in during:
        if _is_met(expectation, value):
            return ExpectationRow(expectation, Verdict.FOUND, t - begin, value)
    verdict = Verdict.MISSING
    if begin < evidence.start_s:
        verdict = Verdict.START
    elif evidence.pause_time_s(begin - BEFORE_S, end):
        verdict = Verdict.LATE_BENCH
    return ExpectationRow(expectation, verdict, None, during[-1][1] if during else None)


def _is_met(expectation: Expectation, value: object) -> bool:
    expected = expectation.value
    if isinstance(value, list):
        return expected in value
    if isinstance(expected, bool | str) or isinstance(value, bool) or not isinstance(value, int | float):
        return value == expected
    return expected - expectation.minus <= value <= expected + expectation.plus
