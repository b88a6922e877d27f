"""Conditions: faults of a subject; and reports: the present condition of a subject, or none."""

from __future__ import annotations

from enum import StrEnum

from msgspec import Struct

from fti.messages.notes import AlarmReportRecord


def device_id(name: str) -> str:
    """Identity of the alarm of a device that is silent, has damaged data, or the wrong rate."""
    return f"device:{name}"


def in_title(name: str) -> str:
    """A name of the configuration, for a title."""
    return name.upper().replace("_", " ")


#: Conditions of a start, which are not latched.
START_CONDITIONS = frozenset({"navigation_starting", "terrain_loading"})


class Severity(StrEnum):
    """Required reaction: immediate action; immediate awareness and later action; awareness."""

    WARNING = "warning"
    CAUTION = "caution"
    ADVISORY = "advisory"

    @property
    def rank(self) -> int:
        """0 for the most severe."""
        return list(Severity).index(self)


class Condition(Struct, frozen=True, gc=False):
    """A fault of a subject.

    id    : identity of its alarm; a subject has one condition at a time, each kind with its own identity
    title : in capitals, at most five words;  cause : the reason, for the operator
    value : the quantity in the title, in its SI unit; None if there is none
    explained_by : identities of possible causes; this condition is a consequence while one of them lasts
    is_latched   : the alarm stays until it is acknowledged; false for a start, which ends by itself
    """

    id: str
    severity: Severity
    title: str
    cause: str = ""
    value: float | None = None
    explained_by: tuple[str, ...] = ()
    is_latched: bool = True


class ConditionReport(Struct, frozen=True, gc=False):
    """The condition of a subject from t_ns [ns] on; None: no fault."""

    t_ns: int
    subject: str
    condition: Condition | None

    def as_record(self) -> AlarmReportRecord:
        """The report as a record of ``/fti/alarm_report``."""
        found = self.condition
        return AlarmReportRecord(
            t_ns=self.t_ns,
            subject=self.subject,
            id=found.id if found else None,
            severity=found.severity if found else None,
            title=found.title if found else None,
            cause=found.cause if found else None,
            value=found.value if found else None,
            explained_by=found.explained_by if found else (),
            is_latched=bool(found and found.is_latched),
        )

    @classmethod
    def from_record(cls, record: AlarmReportRecord) -> ConditionReport:
        """The report of a record.  Raises ValueError for an unknown severity."""
        condition = None
        if record.id is not None and record.severity is not None:
            condition = Condition(
                record.id,
                Severity(record.severity),
                record.title or "",
                record.cause or "",
                record.value,
                record.explained_by,
                record.is_latched,
            )
        return cls(record.t_ns, record.subject, condition)
