"""Conditions: faults of a subject; and reports: the present condition of a subject, or none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

#: A report as JSON.
Json = dict[str, Any]


def device_id(name: str) -> str:
    """Identity of the alarm of a device that is silent, has damaged data, or the wrong rate."""
    return f"device:{name}"


def in_title(name: str) -> str:
    """A name of the configuration, for a title."""
    return name.upper().replace("_", " ")


class Severity(StrEnum):
    """Required reaction: immediate action; immediate awareness and later action; awareness."""

    WARNING = "warning"
    CAUTION = "caution"
    ADVISORY = "advisory"

    @property
    def rank(self) -> int:
        """0 for the most severe."""
        return list(Severity).index(self)


@dataclass(frozen=True, slots=True)
class Condition:
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


@dataclass(frozen=True, slots=True)
class ConditionReport:
    """The condition of a subject from t_ns [ns] on; None: no fault."""

    t_ns: int
    subject: str
    condition: Condition | None

    def as_json(self) -> Json:
        """The report as a record of ``/fti/alarm_report``."""
        found = self.condition
        return {
            "t_ns": self.t_ns,
            "subject": self.subject,
            "id": found and found.id,
            "severity": found and found.severity,
            "title": found and found.title,
            "cause": found and found.cause,
            "value": found and found.value,
            "explained_by": list(found.explained_by) if found else [],
            "is_latched": bool(found and found.is_latched),
        }

    @classmethod
    def from_json(cls, fields: Mapping[str, Any]) -> ConditionReport:
        """The report from such a record.  Raises KeyError or ValueError."""
        condition = None
        if fields["id"] is not None:
            condition = Condition(
                str(fields["id"]),
                Severity(fields["severity"]),
                str(fields["title"]),
                str(fields["cause"]),
                fields["value"],
                tuple(fields["explained_by"]),
                bool(fields["is_latched"]),
            )
        return cls(int(fields["t_ns"]), str(fields["subject"]), condition)
