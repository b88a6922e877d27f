"""One check of one output."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from fti.post.score.rows import Result


class OutputCheck(StrEnum):
    """Kinds of output checks."""

    RATE = "rate"
    GAP = "longest gap"
    TIMES = "order and times"
    VALID = "valid"
    ERROR = "error"
    FAULT_ERROR = "error during a fault"
    SIGMA = "sigma"
    MEASURED = "as sent"
    RECORDED = "recorded"
    CONSISTENT = "consistent"
    PROTECTED = "protection level"


@dataclass(frozen=True, slots=True)
class OutputRow:
    """One check of one topic.

    what  : the quantity, if the check has one
    found, limit : as text with units; at_s : time of the largest deviation [s of the flight], if any
    """

    topic: str
    check: OutputCheck
    what: str
    result: Result
    found: str
    limit: str
    at_s: float | None = None


def result_of(holds: bool) -> Result:
    """HOLDS or FAILS."""
    return Result.HOLDS if holds else Result.FAILS
