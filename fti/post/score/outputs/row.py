"""One check of one output."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from fti.post.score.rows import Verdict


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
    verdict: Verdict
    found: str
    limit: str
    at_s: float | None = None


def verdict_of(holds: bool) -> Verdict:
    """HOLDS or FAILS."""
    return Verdict.HOLDS if holds else Verdict.FAILS
