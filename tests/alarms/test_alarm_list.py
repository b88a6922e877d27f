"""An alarm begins with its condition, and goes when that has ended and a person has acknowledged it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from fti.alarms.alarm_list import AlarmList
from fti.alarms.condition import Condition, ConditionReport, Severity
from fti.messages.notes import AlarmRecord

ALERT = Condition("integrity_alert", Severity.WARNING, "GROUND CLEARANCE ALERT", "obstacle")
CAUTION = Condition("integrity_caution", Severity.CAUTION, "GROUND CLEARANCE CAUTION", "shifted")
LINK = Condition("link:ins", Severity.CAUTION, "LINK INS SILENT")
DEVICE = Condition("device:ins", Severity.CAUTION, "DEVICE INS SILENT", explained_by=("link:ins",))
POSITION = Condition("position", Severity.WARNING, "POSITION NOT VALID", explained_by=("device:ins", "source:ins"))


class RecordedAlarms(AlarmList):
    """A list with what it has recorded."""

    def __init__(self) -> None:
        super().__init__()
        self.recorded: list[AlarmRecord] = []

    def report_condition(self, t_ns: int, subject: str, condition: Condition | None) -> None:
        self.report(ConditionReport(t_ns, subject, condition))
        self.recorded += self.take_changes()

    @property
    def ids(self) -> list[str]:
        return [row["id"] for row in self.rows()]

    def changes_of(self, name: str) -> list[tuple[int, str]]:
        self.recorded += self.take_changes()
        return [(change.t_ns, change.change) for change in self.recorded if change.id == name]


def test_it_stays_after_its_end_until_it_is_acknowledged() -> None:
    alarms = RecordedAlarms()
    alarms.report_condition(10, "integrity", ALERT)
    alarms.report_condition(26, "integrity", None)
    (row,) = alarms.rows()
    assert (row["id"], row["begin_ns"], row["end_ns"], row["is_acknowledged"]) == ("integrity_alert", 10, 26, False)
    assert alarms.acknowledge("anna", 30) == 1
    assert alarms.rows() == []
    assert alarms.changes_of("integrity_alert") == [(10, "begins"), (26, "ends"), (30, "acknowledged")]
    assert alarms.recorded[-1].acknowledged_by == "anna"


def test_it_stays_after_its_acknowledgement_until_it_ends() -> None:
    alarms = RecordedAlarms()
    alarms.report_condition(10, "integrity", ALERT)
    alarms.acknowledge("anna", 12)
    (row,) = alarms.rows()
    assert (row["end_ns"], row["is_acknowledged"], row["acknowledged_by"]) == (None, True, "anna")
    alarms.report_condition(20, "integrity", None)
    assert alarms.rows() == []


def test_another_condition_of_the_subject_ends_it_and_begins() -> None:
    alarms = RecordedAlarms()
    alarms.report_condition(10, "integrity", ALERT)
    alarms.report_condition(15, "integrity", CAUTION)
    assert {row["id"]: row["end_ns"] for row in alarms.rows()} == {"integrity_alert": 15, "integrity_caution": None}
    assert alarms.ids == ["integrity_alert", "integrity_caution"], "a warning that nobody has seen stays above"


def test_one_that_returns_counts_and_must_be_acknowledged_anew() -> None:
    alarms = RecordedAlarms()
    for begin in (10, 20, 30):
        alarms.report_condition(begin, "integrity", ALERT)
        alarms.report_condition(begin + 5, "integrity", None)
    (row,) = alarms.rows()
    assert (row["first_ns"], row["begin_ns"], row["end_ns"], row["count"]) == (10, 30, 35, 3)
    alarms.report_condition(40, "integrity", ALERT)
    alarms.acknowledge("anna", 41)
    alarms.report_condition(42, "integrity", None)
    alarms.report_condition(50, "integrity", ALERT)
    (row,) = alarms.rows()
    assert (row["first_ns"], row["count"], row["is_acknowledged"]) == (50, 1, False)


def test_the_same_condition_again_changes_its_words_and_is_not_recorded() -> None:
    alarms = RecordedAlarms()
    alarms.report_condition(10, "integrity", ALERT)
    before = alarms.rows()
    alarms.report_condition(11, "integrity", ALERT)
    assert alarms.rows() == before
    alarms.report_condition(12, "integrity", Condition(ALERT.id, ALERT.severity, ALERT.title, "height error"))
    assert alarms.rows() != before
    assert alarms.rows()[0]["cause"] == "height error"
    assert alarms.changes_of(ALERT.id) == [(10, "begins")]


def test_a_change_of_severity_is_recorded() -> None:
    alarms = RecordedAlarms()
    alarms.report_condition(10, "position", POSITION)
    alarms.report_condition(12, "position", Condition(POSITION.id, Severity.CAUTION, POSITION.title))
    assert alarms.changes_of(POSITION.id) == [(10, "begins"), (12, "changes")]


def test_one_that_becomes_more_severe_must_be_acknowledged_anew() -> None:
    alarms = RecordedAlarms()
    lesser = Condition(POSITION.id, Severity.CAUTION, POSITION.title)
    for condition, is_acknowledged in ((lesser, True), (POSITION, False), (lesser, False)):
        alarms.report_condition(10, "position", condition)
        if condition is lesser and is_acknowledged:
            alarms.acknowledge("anna", 11)
        assert [row["is_acknowledged"] for row in alarms.rows()] == [is_acknowledged]
    alarms.acknowledge("anna", 12)
    alarms.report_condition(13, "position", lesser)
    assert [row["is_acknowledged"] for row in alarms.rows()] == [True]


def test_what_happened_at_a_moment_is_listed_until_it_is_acknowledged() -> None:
    alarms = RecordedAlarms()
    for t_ns in (5, 9):
        alarms.record(Condition("losses", Severity.CAUTION, "DATA LOST"), t_ns)
    (row,) = alarms.rows()
    assert (row["begin_ns"], row["end_ns"], row["count"]) == (9, 9, 2)
    alarms.acknowledge("anna", 10)
    assert not alarms.rows()


def test_consequences_are_shown_with_their_cause_and_make_it_as_severe() -> None:
    alarms = RecordedAlarms()
    for subject, condition in (("position", POSITION), ("device", DEVICE), ("link", LINK), ("integrity", CAUTION)):
        alarms.report_condition(10, subject, condition)
    first, second = alarms.rows()
    assert (first["id"], first["severity"]) == ("link:ins", "warning")
    assert {each["id"] for each in first["consequences"]} == {"device:ins", "position"}
    assert second["id"] == "integrity_caution"


def test_a_consequence_that_outlasts_its_cause_stands_alone() -> None:
    alarms = RecordedAlarms()
    for subject, condition in (("link", LINK), ("device", DEVICE)):
        alarms.report_condition(10, subject, condition)
    alarms.report_condition(20, "link", None)
    assert sorted(alarms.ids) == ["device:ins", "link:ins"]
    alarms.report_condition(30, "device", None)
    assert alarms.ids == ["link:ins"], "both have ended"


def test_an_alarm_is_acknowledged_with_its_consequences_and_not_with_others() -> None:
    alarms = RecordedAlarms()
    for subject, condition in (("link", LINK), ("device", DEVICE), ("integrity", CAUTION)):
        alarms.report_condition(10, subject, condition)
    assert alarms.acknowledge("anna", 11, "link:ins") == 2
    assert {row["id"]: row["is_acknowledged"] for row in alarms.rows()} == {
        "link:ins": True,
        "integrity_caution": False,
    }
    assert alarms.acknowledge("anna", 12, "no such alarm") == 0


def test_what_ends_by_itself_needs_no_acknowledgement() -> None:
    alarms = RecordedAlarms()
    alarms.report_condition(
        1, "terrain", Condition("terrain_loading", Severity.ADVISORY, "TERRAIN LOADING", is_latched=False)
    )
    assert alarms.ids == ["terrain_loading"]
    alarms.report_condition(5, "terrain", None)
    assert alarms.ids == []


def test_those_that_have_begun_since_a_time_are_acknowledged() -> None:
    alarms = RecordedAlarms()
    alarms.report_condition(10, "link", LINK)
    alarms.report_condition(20, "integrity", CAUTION)
    assert alarms.acknowledge("anna", 21, since_ns=15) == 1
    assert {row["id"]: row["is_acknowledged"] for row in alarms.rows()} == {
        "link:ins": False,
        "integrity_caution": True,
    }


def test_causes_in_a_circle_are_shown_all_the_same() -> None:
    alarms = RecordedAlarms()
    alarms.report_condition(1, "a", Condition("a", Severity.CAUTION, "A", explained_by=("b",)))
    alarms.report_condition(1, "b", Condition("b", Severity.CAUTION, "B", explained_by=("a",)))
    shown = [each["id"] for row in alarms.rows() for each in (row, *row["consequences"])]
    assert sorted(shown) == ["a", "b"]


def test_a_report_comes_through_json_as_it_was() -> None:
    for condition in (POSITION, Condition("space", Severity.CAUTION, "SPACE", "why", 12.5, is_latched=False), None):
        report = ConditionReport(7, "subject", condition)
        assert ConditionReport.from_record(report.as_record()) == report
    with pytest.raises(ValueError, match="severity"):
        ConditionReport.from_record(replace(ConditionReport(7, "a", ALERT).as_record(), severity="severity"))


steps = st.lists(
    st.one_of(
        st.tuples(st.just("report"), st.integers(0, 3), st.one_of(st.none(), st.integers(0, 2))),
        st.tuples(st.just("acknowledge"), st.integers(0, 11), st.none()),
        st.tuples(st.just("acknowledge all"), st.just(0), st.none()),
    ),
    max_size=40,
)


@given(steps)
def test_nothing_that_lasts_or_was_not_seen_is_ever_missing(taken: list[tuple[str, int, int | None]]) -> None:
    """Against a plain account: what lasts by subject, and what began since it was acknowledged last."""
    alarms, lasting, unseen = AlarmList(), dict[int, str](), set[str]()
    for t_ns, (what, number, kind) in enumerate(taken):
        if what == "report":
            name = None if kind is None else f"{number}.{kind}"
            if name is not None and lasting.get(number) != name:
                unseen.add(name)
            condition = name and Condition(name, Severity.CAUTION, name)
            alarms.report(ConditionReport(t_ns, str(number), condition or None))
            if name is None:
                lasting.pop(number, None)
            else:
                lasting[number] = name
        elif what == "acknowledge":
            name = f"{number // 3}.{number % 3}"
            alarms.acknowledge("anna", t_ns, name)
            unseen.discard(name)
        else:
            alarms.acknowledge("anna", t_ns)
            unseen.clear()
        rows = {row["id"]: row for row in alarms.rows()}
        assert set(rows) == unseen | set(lasting.values())
        assert {name for name, row in rows.items() if row["end_ns"] is None} == set(lasting.values())
        assert {name for name, row in rows.items() if not row["is_acknowledged"]} == unseen
