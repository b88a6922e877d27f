"""The alarms of a recording from ``/fti/alarm``: their time spans and acknowledgements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fti.alarms.condition import Severity
from fti.logger.reading.json_message import whole_number
from fti.logger.reading.limits import MAX_TEXT_LENGTH

MAX_ALARMS = 1000


@dataclass(slots=True)
class AlarmSpan:
    """An alarm from its begin to its end [ns]; end_ns None: active at the end of the recording.

    severity : the worst severity
    """

    id: str
    severity: Severity
    title: str
    cause: str
    begin_ns: int
    end_ns: int | None = None
    acknowledged_ns: int | None = None
    acknowledged_by: str | None = None


@dataclass(slots=True)
class AlarmSpans:
    """The first thousand alarms, in order of their begin; more_alarms : number of further ones."""

    spans: list[AlarmSpan] = field(default_factory=list)
    more_alarms: int = 0
    _newest: dict[str, AlarmSpan] = field(default_factory=dict)

    def feed(self, record: Mapping[str, Any]) -> None:
        """Add a record of ``/fti/alarm``.  Raises ValueError for another record."""
        name, change = _text(record, "id"), _text(record, "change")
        t_ns = whole_number(record.get("t_ns"))
        severity = Severity(_text(record, "severity"))
        if change == "begins":
            self._begin(AlarmSpan(name, severity, _text(record, "title"), _text(record, "cause"), begin_ns=t_ns))
            return
        span = self._newest.get(name)
        if span is None:
            return
        if change == "ends":
            span.end_ns = t_ns
        elif change == "acknowledged":
            span.acknowledged_ns, span.acknowledged_by = t_ns, _text(record, "acknowledged_by")
        elif severity.rank < span.severity.rank:
            span.severity = severity

    def _begin(self, span: AlarmSpan) -> None:
        if len(self.spans) >= MAX_ALARMS:
            self.more_alarms += 1
            self._newest.pop(span.id, None)
            return
        self.spans.append(span)
        self._newest[span.id] = span


def _text(record: Mapping[str, Any], key: str) -> str:
    value = record.get(key)
    if not isinstance(value, str):
        raise ValueError(f"{key} is not a text")
    return value[:MAX_TEXT_LENGTH]
