"""The rows of a score: expected flags, unexpected flags, ``[[expect]]``, and findings."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from fti.hil.tables.schema import Expectation


class Result(StrEnum):
    """The result of an expectation."""

    FOUND = "found"
    LATE = "late"
    MISSING = "missing"
    STAYS = "does not clear"
    UNKNOWN = "not known yet"
    COMPARED = "outputs compared"
    NOT_FLOWN = "not flown"
    PORTS = "needs real ports"
    NOT_DUE = "nothing is due"
    NOT_CONFIGURED = "not configured"
    START = "not compared: start"
    LATE_BENCH = "bench was late"
    HOLDS = "holds"
    FAILS = "does not hold"
    NOT_COMPARED = "not compared"


FAILURES = frozenset((Result.LATE, Result.MISSING, Result.STAYS, Result.NOT_CONFIGURED, Result.FAILS))


@dataclass(frozen=True, slots=True)
class FlagRow:
    """One flag of one fault.

    from_s, until_s : of its cause [s of the flight]; after_s : delay until it was raised, clear_s : delay until it
    cleared; within_s, clears_s : limits of both delays
    """

    fault: int
    what: str
    subject: str
    flag: str
    from_s: float
    until_s: float
    result: Result
    after_s: float | None = None
    within_s: float | None = None
    clear_s: float | None = None
    clears_s: float | None = None


@dataclass(frozen=True, slots=True)
class UnexpectedFlag:
    """A flag that no fault explains."""

    place: str
    word: str
    from_s: float
    until_s: float


@dataclass(frozen=True, slots=True)
class ExpectationRow:
    """A row of ``[[expect]]``.  after_s : delay until it was met; value : last value until then"""

    expectation: Expectation
    result: Result
    after_s: float | None
    value: object


@dataclass(frozen=True, slots=True)
class FlightFinding:
    """A check of every flight, independent of its scenario.

    about : UNIT, BENCH or CONFIGURATION; text : the finding, and the limit
    """

    about: str
    name: str
    result: Result
    text: str


UNIT, BENCH, CONFIGURATION = "unit", "bench", "configuration"
