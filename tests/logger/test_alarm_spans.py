"""Alarms of a recording, from their changes: each with its begin, its end, and who has acknowledged it."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.alarms.alarm_list import AlarmList
from fti.alarms.condition import Condition, ConditionReport, Severity
from fti.logger.statistics.alarm_spans import MAX_ALARMS, AlarmSpans
from fti.messages.tables import to_table

ALERT = Condition("integrity_alert", Severity.WARNING, "GROUND CLEARANCE ALERT", "obstacle")


def spans_of(alarms: AlarmList) -> list[tuple[str, int, int | None, str | None]]:
    alarm_spans = AlarmSpans()
    for change in alarms.take_changes():
        alarm_spans.feed(to_table(change))
    return [(span.id, span.begin_ns, span.end_ns, span.acknowledged_by) for span in alarm_spans.spans]


def test_each_begin_is_a_span_of_its_own() -> None:
    alarms = AlarmList()
    for begin in (10, 30):
        alarms.report(ConditionReport(begin, "integrity", ALERT))
        alarms.report(ConditionReport(begin + 16, "integrity", None))
    alarms.acknowledge("anna", 50)
    alarms.report(ConditionReport(60, "integrity", ALERT))
    assert spans_of(alarms) == [
        ("integrity_alert", 10, 26, None),
        ("integrity_alert", 30, 46, "anna"),
        ("integrity_alert", 60, None, None),
    ]


def test_one_that_was_acknowledged_while_it_lasted_has_its_end_too() -> None:
    alarms = AlarmList()
    alarms.report(ConditionReport(10, "integrity", ALERT))
    alarms.acknowledge("anna", 12)
    alarms.report(ConditionReport(20, "integrity", None))
    assert spans_of(alarms) == [("integrity_alert", 10, 20, "anna")]


def test_they_are_bounded() -> None:
    alarms, found = AlarmList(), AlarmSpans()
    for t_ns in range(0, 2 * MAX_ALARMS + 20, 2):
        alarms.record(ALERT, t_ns)
    for change in alarms.take_changes():
        found.feed(to_table(change))
    assert (len(found.spans), found.more_alarms) == (MAX_ALARMS, 10)


values = st.one_of(st.none(), st.integers(), st.floats(), st.text(max_size=5), st.lists(st.integers(), max_size=2))
names = st.sampled_from(["id", "change", "t_ns", "severity", "title", "cause", "acknowledged_by"])
right = {"id": "a", "change": "begins", "t_ns": 1, "severity": "warning", "title": "A", "cause": "", "x": 1}


@given(st.dictionaries(names, values), st.sampled_from(["begins", "ends", "acknowledged", "changes", "else"]))
def test_a_record_that_is_none_is_refused(wrong: dict[str, Any], change: str) -> None:
    alarm_spans = AlarmSpans()
    alarm_spans.feed(right)
    record = {**right, "change": change, **wrong}
    try:
        alarm_spans.feed(record)
    except ValueError:
        return
    assert isinstance(record["t_ns"], int)


@pytest.mark.parametrize("missing", ["id", "change", "t_ns", "severity"])
def test_a_record_without_what_it_needs_is_refused(missing: str) -> None:
    with pytest.raises((ValueError, TypeError)):
        AlarmSpans().feed({key: value for key, value in right.items() if key != missing})
