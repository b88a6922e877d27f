"""A condition is what is wrong with a subject; a report is what is wrong with it now, or that nothing is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

#: Of a report, in JSON.
Json = dict[str, Any]


def device_id(name: str) -> str:
    """Identity of the alarm of a device that is silent, damaged, or has the wrong rate."""
    return f"device:{name}"


def in_title(name: str) -> str:
    """A name of the configuration as it stands in a title."""
    return name.upper().replace("_", " ")


class Severity(StrEnum):
    """What a person must do: act at once; know at once and act soon; know."""

    WARNING = "warning"
    CAUTION = "caution"
    ADVISORY = "advisory"

    @property
    def rank(self) -> int:
        """0 for the most severe."""
        return list(Severity).index(self)


@dataclass(frozen=True, slots=True)
class Condition:
    """What is wrong with a subject.

    id    : identity of its alarm; a subject has one condition at a time, other conditions of it have other identities
    title : in capitals, at most five words;  cause : why, for the person who must act
    value : the quantity that the title speaks of, in its SI unit; None where there is none
    explained_by : identities of conditions of which this one is a consequence while one of them lasts
    is_latched   : its alarm stays until it is acknowledged; not that of a start, which ends by itself
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
    """What is wrong with a subject from t_ns [ns] on; condition None: nothing is."""

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
        """The report in such a record.  Raises KeyError or ValueError."""
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
