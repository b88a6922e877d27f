"""One check of one output."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Check(StrEnum):
    """What is checked of an output."""

    RATE = "rate"
    GAP = "longest gap"
    TIMES = "order and times"
    VALID = "valid"
    ERROR = "error"
    SIGMA = "sigma"
    MEASURED = "as sent"
    CONSISTENT = "consistent"
    PROTECTED = "protection level"


class OutputVerdict(StrEnum):
    """Result of a check."""

    HOLDS = "holds"
    FAILS = "does not hold"
    NOT_JUDGED = "not judged"


@dataclass(frozen=True, slots=True)
class OutputRow:
    """One check of one topic.

    what  : the quantity, where the check is of one
    found, limit : as text with units; at_s : time of the worst [s of the flight], where there is one
    """

    topic: str
    check: Check
    what: str
    verdict: OutputVerdict
    found: str
    limit: str
    at_s: float | None = None


def verdict_of(holds: bool) -> OutputVerdict:
    """HOLDS or FAILS."""
    return OutputVerdict.HOLDS if holds else OutputVerdict.FAILS
