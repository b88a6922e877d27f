"""The alarms of a session: each begins with its condition and stays until it has ended and was acknowledged.

Only a report about its subject ends a condition; silence and lateness do not.  If it returns before its alarm was
acknowledged, the count increases, and it must be acknowledged again, as must one that becomes more severe.  A
consequence is listed under its cause while the cause lasts, or when both have ended.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from fti.alarms.condition import Condition, ConditionReport
from fti.messages.notes import AlarmRecord

Json = dict[str, Any]


class AlarmChange(StrEnum):
    """Kind of a change of an alarm."""

    BEGINS = "begins"
    CHANGES = "changes"
    ENDS = "ends"
    ACKNOWLEDGED = "acknowledged"


@dataclass(slots=True)
class Alarm:
    """An alarm.

    first_ns, begin_ns, end_ns : when it began first and last, and when it ended; None while it lasts [ns]
    count           : how many times it has begun since the last acknowledgement
    acknowledged_ns, acknowledged_by : when, and by whom; None before
    """

    condition: Condition
    first_ns: int
    begin_ns: int
    end_ns: int | None = None
    count: int = 1
    acknowledged_ns: int | None = None
    acknowledged_by: str | None = None

    @property
    def is_active(self) -> bool:
        """Its condition has not ended."""
        return self.end_ns is None

    @property
    def is_settled(self) -> bool:
        """It has ended, and was acknowledged if required."""
        return not self.is_active and (self.acknowledged_ns is not None or not self.condition.is_latched)

    @property
    def order(self) -> tuple[Any, ...]:
        """Sort key: not acknowledged, severe, active, new ones first."""
        return self.acknowledged_ns is not None, self.condition.severity.rank, not self.is_active, -self.begin_ns

    def as_json(self) -> Json:
        """Its fields for publishing and recording."""
        found = self.condition
        return {
            "id": found.id,
            "severity": found.severity,
            "title": found.title,
            "cause": found.cause,
            "value": found.value,
            "first_ns": self.first_ns,
            "begin_ns": self.begin_ns,
            "end_ns": self.end_ns,
            "count": self.count,
            "acknowledged_ns": self.acknowledged_ns,
            "acknowledged_by": self.acknowledged_by,
        }


class AlarmList:
    """All alarms that are active or not acknowledged, at most one per identity."""

    def __init__(self) -> None:
        self._alarms: dict[str, Alarm] = {}
        self._present: dict[str, str] = {}  # identity of the condition of each subject
        self._changes: list[AlarmRecord] = []

    def report(self, report: ConditionReport) -> None:
        """Handle the report about a subject."""
        before, now = self._present.get(report.subject), report.condition
        if before is not None and (now is None or now.id != before):
            del self._present[report.subject]
            self._end(before, report.t_ns)
        if now is not None:
            self._present[report.subject] = now.id
            self._begin(now, report.t_ns)

    def record(self, condition: Condition, t_ns: int) -> None:
        """Record a momentary condition: it begins and ends."""
        self._begin(condition, t_ns)
        self._end(condition.id, t_ns)

    def acknowledge(
        self,
        who: str,
        t_ns: int,
        alarm_id: str | None = None,
        since_ns: int | None = None,
        excluded: frozenset[str] = frozenset(),
    ) -> int:
        """Acknowledge an alarm with its consequences (alarm_id), those that have begun since since_ns, or all.

        excluded : identities that are not acknowledged.  Returns the number of newly acknowledged alarms.
        """
        begun = {name for name, alarm in self._alarms.items() if since_ns is None or alarm.begin_ns >= since_ns}
        chosen = begun - excluded
        if alarm_id is not None:
            chosen = {name for name in chosen if alarm_id in (name, self._cause_of(name))}
        open_alarms = [self._alarms[name] for name in sorted(chosen) if self._alarms[name].acknowledged_ns is None]
        for alarm in open_alarms:
            alarm.acknowledged_ns, alarm.acknowledged_by = t_ns, who
            self._change(alarm, AlarmChange.ACKNOWLEDGED, t_ns)
        return len(open_alarms)

    def rows(self) -> list[Json]:
        """The alarms, the most urgent first, each with its consequences and their worst severity."""
        causes = {name: self._cause_of(name) for name in self._alarms}
        rows = []
        for name, alarm in sorted(self._alarms.items(), key=lambda item: item[1].order):
            if causes[name] == name:
                folded = [self._alarms[other] for other, cause in causes.items() if cause == name != other]
                rows.append(_row(alarm, sorted(folded, key=lambda other: other.order)))
        return sorted(rows, key=lambda row: row.pop("order"))

    def take_changes(self) -> list[AlarmRecord]:
        """The changes since the last call, for recording."""
        changes, self._changes = self._changes, []
        return changes

    def _begin(self, condition: Condition, t_ns: int) -> None:
        alarm = self._alarms.get(condition.id)
        if alarm and alarm.is_active:
            self._update(alarm, condition, t_ns)
            return
        if alarm:
            alarm.condition, alarm.begin_ns, alarm.end_ns, alarm.count = condition, t_ns, None, alarm.count + 1
            alarm.acknowledged_ns = alarm.acknowledged_by = None
        else:
            alarm = self._alarms[condition.id] = Alarm(condition, t_ns, t_ns)
        self._change(alarm, AlarmChange.BEGINS, t_ns)

    def _update(self, alarm: Alarm, condition: Condition, t_ns: int) -> None:
        """Update text and severity of an active condition; one that has become more severe is new."""
        rise = alarm.condition.severity.rank - condition.severity.rank
        alarm.condition = condition
        if rise > 0:
            alarm.acknowledged_ns = alarm.acknowledged_by = None
        if rise:
            self._change(alarm, AlarmChange.CHANGES, t_ns)

    def _end(self, name: str, t_ns: int) -> None:
        if name in self._present.values():  # another subject has the same condition
            return
        alarm = self._alarms.get(name)
        if alarm and alarm.is_active:
            alarm.end_ns = max(t_ns, alarm.begin_ns)
            self._change(alarm, AlarmChange.ENDS, t_ns)

    def _change(self, alarm: Alarm, change: AlarmChange, t_ns: int) -> None:
        self._changes.append(AlarmRecord(t_ns=t_ns, change=change, **alarm.as_json()))
        if alarm.is_settled:
            del self._alarms[alarm.condition.id]

    def _cause_of(self, name: str) -> str:
        """The alarm under which this one is listed: the first cause of its causes, or itself."""
        found = self._first_cause(name)
        return found if self._first_cause(found) == found else name  # causes in a circle: each is listed

    def _first_cause(self, name: str) -> str:
        visited = {name}
        while found := self._next_cause(name, visited):
            visited.add(found)
            name = found
        return name

    def _next_cause(self, name: str, visited: Iterable[str]) -> str | None:
        alarm = self._alarms[name]
        for other in alarm.condition.explained_by:
            cause = self._alarms.get(other)
            if cause and other not in visited and (cause.is_active or not alarm.is_active):
                return other
        return None


def _row(alarm: Alarm, folded: list[Alarm]) -> Json:
    alarms = [alarm, *folded]
    is_open = any(each.acknowledged_ns is None for each in alarms)
    severity = min((each.condition.severity for each in alarms), key=lambda severity: severity.rank)
    order = not is_open, severity.rank, not any(each.is_active for each in alarms), -alarm.begin_ns
    return {
        **alarm.as_json(),
        "severity": severity,
        "is_acknowledged": not is_open,
        "consequences": [each.as_json() for each in folded],
        "order": order,
    }
