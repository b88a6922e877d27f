"""The daemon's alarms: recorded with each change, published whole, and not ended by lateness."""

from __future__ import annotations

import json
from typing import Any

import pytest

from fti.alarms.condition import Condition, ConditionReport, Severity
from fti.clock import FakeClock
from fti.messages.notes import AlarmRecord
from fti.service.supervisor.alarm_board import IN_TIME_NS, LATE_NS, NO_FRAME_TAKEN, AlarmBoard
from tests.service.test_health_conditions import health

ALERT = Condition("integrity_alert", Severity.WARNING, "GROUND CLEARANCE ALERT", "obstacle")
START_NS = 1_000 * 10**9


class Rig:
    """A board, what it has published and recorded, and how long a frame has waited for navigation [ns]."""

    def __init__(self) -> None:
        self.clock = FakeClock(START_NS)
        self.published: list[dict[str, Any]] = []
        self.recorded: list[Any] = []
        self.waited_ns: int | None = None
        self.board = AlarmBoard(
            self.clock,
            lambda topic, payload: self.published.append({"topic": topic, **json.loads(payload)}),
            self.recorded.append,
            lambda: None if self.waited_ns is None else self.clock.now_ns() - self.waited_ns,
        )

    def check_latency(self, waited_ns: int | None) -> list[str]:
        """The alarms that last when navigation is that late."""
        self.waited_ns = waited_ns
        self.board.check_navigation_latency()
        self.board.publish()
        return [row["id"] for row in self.published[-1]["alarms"] if row["end_ns"] is None]


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_each_change_is_recorded_and_published(rig: Rig) -> None:
    rig.board.handle_report(ConditionReport(START_NS + 5, "integrity", ALERT).as_record())
    assert [row["id"] for row in rig.published[-1]["alarms"]] == ["integrity_alert"]
    rig.board.handle_report(ConditionReport(START_NS + 9, "integrity", None).as_record())
    assert rig.board.acknowledge("anna", None) == 1
    assert rig.published[-1]["alarms"] == []
    assert {type(note) for note in rig.recorded} == {AlarmRecord}
    assert [note.change for note in rig.recorded] == ["begins", "ends", "acknowledged"]
    assert len(rig.published) == 3


def test_what_follows_from_devices_that_are_switched_off_is_no_alarm(rig: Rig) -> None:
    """Late reports are about an earlier time, and the terrain does not depend on devices."""
    late = Condition("height", Severity.CAUTION, "HEIGHT NOT VALID", "stale")
    terrain = Condition("terrain", Severity.CAUTION, "NO TERRAIN", "no file")
    reports = [
        ConditionReport(START_NS - 1, "integrity", ALERT),
        ConditionReport(START_NS + 1, "height", late),
        ConditionReport(START_NS + 1, "terrain", terrain),
    ]
    rig.board.suppress_device_alarms()
    for report in reports:
        rig.board.handle_report(report.as_record())
    assert {row["id"] for row in rig.published[-1]["alarms"]} == {"integrity_alert", "terrain"}
    unmonitored = Condition("integrity_unavailable", Severity.CAUTION, "GROUND CLEARANCE NOT MONITORED", "stale")
    rig.board.handle_report(ConditionReport(START_NS + 2, "integrity", unmonitored).as_record())
    rig.clock.advance(1.0)
    rig.board.suppress_device_alarms()  # again: it began before
    rig.clock.advance(1.0)
    rig.board.resume_device_alarms()
    begin_ns = rig.clock.now_ns()
    for t_ns in (START_NS + 3, begin_ns - 1):
        rig.board.handle_report(ConditionReport(t_ns, "height", late).as_record())
        assert lasting(rig) == {"terrain"}
    rig.board.handle_report(ConditionReport(begin_ns, "height", late).as_record())
    assert lasting(rig) == {"height", "terrain"}


def lasting(rig: Rig) -> set[str]:
    """The alarms that last, as published."""
    return {row["id"] for row in rig.published[-1]["alarms"] if row["end_ns"] is None}


def test_a_health_publishes_the_list_also_when_nothing_has_changed(rig: Rig) -> None:
    """A display that has just joined must not wait for a change."""
    for count in (1, 2):
        rig.board.handle_health(health(1000.0 + count))
        assert len(rig.published) == count
    assert rig.published[-1]["alarms"] == []


def test_what_was_lost_is_an_alarm_that_has_ended(rig: Rig) -> None:
    rig.board.handle_health(health(1001.0))
    lost = {"line": {"state": "good", "hint": "", "dropped_frames": 3, "stamp_refused": 0}}
    rig.board.handle_health(health(1002.0, links=lost))
    (row,) = rig.published[-1]["alarms"]
    assert (row["id"], row["end_ns"], row["value"]) == ("losses", 1002 * 10**9, 3.0)


def test_navigation_is_late_when_frames_wait_for_longer_than_a_value_may_be_old(rig: Rig) -> None:
    rig.board._oldest_waiting_ns = lambda: NO_FRAME_TAKEN
    assert rig.check_latency(None) == [], "it has taken nothing yet"
    rig.board._oldest_waiting_ns = lambda: None if rig.waited_ns is None else rig.clock.now_ns() - rig.waited_ns
    assert rig.check_latency(3 * LATE_NS) == [], "it starts"
    assert rig.check_latency(None) == []
    assert rig.check_latency(LATE_NS) == []
    assert rig.check_latency(LATE_NS + 1) == ["navigation_late"]
    assert rig.check_latency(IN_TIME_NS + 1) == ["navigation_late"]
    assert rig.check_latency(IN_TIME_NS) == []


@pytest.mark.parametrize("late_s", [0.55, 1.0, 5.0])
def test_lateness_in_an_alert_never_shows_fewer_alarms(rig: Rig, late_s: float) -> None:
    rig.check_latency(None)
    rig.board.handle_report(ConditionReport(START_NS, "integrity", ALERT).as_record())
    waited_ns = 0
    while waited_ns < late_s * 1e9:
        rig.clock.advance(0.05)
        waited_ns += 50_000_000
        texts = rig.check_latency(waited_ns)
        assert "integrity_alert" in texts
        assert ("navigation_late" in texts) == (waited_ns > LATE_NS)
    assert rig.check_latency(None) == ["integrity_alert"], "only a fresh result ends it"


def test_a_navigation_that_was_started_again_ends_nothing_that_it_does_not_know(rig: Rig) -> None:
    """Its first reports are about assessed conditions; the alert lasts until it reports that the ground matches."""
    rig.board.handle_report(ConditionReport(START_NS, "integrity", ALERT).as_record())
    rig.board.handle_report(ConditionReport(START_NS + 10, "comparison", None).as_record())
    assert "integrity_alert" in rig.check_latency(None)
    rig.board.handle_report(ConditionReport(START_NS + 20, "integrity", None).as_record())
    assert rig.check_latency(None) == []


def test_another_flight_acknowledges_what_the_end_of_the_last_one_was(rig: Rig) -> None:
    rig.board.handle_report(ConditionReport(START_NS, "integrity", ALERT).as_record())
    rig.clock.advance(60.0)
    lost = Condition("position", Severity.CAUTION, "POSITION NOT VALID")
    rig.board.handle_report(ConditionReport(rig.clock.now_ns(), "position", lost).as_record())
    rig.clock.advance(1.0)
    rig.board.start_new_flight("the demonstration")
    rig.board.handle_report(ConditionReport(rig.clock.now_ns(), "position", None).as_record())
    assert rig.check_latency(None) == ["integrity_alert"]
    assert [row["id"] for row in rig.published[-1]["alarms"]] == ["integrity_alert"]


def test_another_flight_acknowledges_nothing_of_the_recording(rig: Rig) -> None:
    rig.board.record(Condition("losses", Severity.CAUTION, "DATA LOST"))
    rig.board.start_new_flight("the demonstration")
    assert [row["id"] for row in rig.published[-1]["alarms"]] == ["losses"]


def test_what_another_recorder_drops_counts_from_zero(rig: Rig) -> None:
    def lost(count: int) -> dict[str, Any]:
        return {"line": {"state": "good", "hint": "", "dropped_frames": count, "stamp_refused": 0}}

    rig.board.handle_health(health(1001.0, links=lost(9)))
    rig.board.on_recorder_replaced("killed")
    rig.board.handle_health(health(1002.0, links=lost(0)))
    rig.board.handle_health(health(1003.0, links=lost(4)))
    assert {row["id"]: row["value"] for row in rig.published[-1]["alarms"]} == {"recorder": None, "losses": 4.0}


def test_what_falls_silent_at_the_end_of_a_session_is_no_alarm(rig: Rig) -> None:
    rig.check_latency(None)
    rig.board.end()
    rig.board.handle_report(ConditionReport(START_NS, "integrity", ALERT).as_record())
    rig.board.handle_health(health(processes={"navigation": {"state": "stopped"}}))
    assert rig.check_latency(10 * LATE_NS) == []
    assert rig.recorded == []
