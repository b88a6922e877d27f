"""The daemon's alarms: conditions reported by navigation and health, latched until acknowledged.

The supervisor holds them, so that they survive restarts of navigation and display.  Each change is recorded on
``/fti/alarm``; the list is published on ``/alarms`` with each change and with each health message.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msgspec.structs import replace

from fti.alarms.alarm_list import AlarmList
from fti.alarms.condition import Condition, ConditionReport, Severity
from fti.bus.message import encode
from fti.clock import Clock
from fti.constants import SECOND_NS
from fti.messages.notes import AlarmReportRecord
from fti.messages.topics import BUS_ALARMS
from fti.service.supervisor.event_publisher import Publish, RecordNote
from fti.service.supervisor.health_conditions import SYSTEM_CONDITIONS, HealthConditions, find_losses

#: Frames that wait longer make navigation late; below the second limit it is in time again [ns].
LATE_NS, IN_TIME_NS = 500_000_000, 250_000_000
NO_FRAME_TAKEN = -1
#: Subjects of navigation that do not depend on devices.
GROUND_SUBJECTS = frozenset({"terrain"})
#: Alarms that began within this time before a new flight belong to the end of the last one [ns].
FLIGHT_END_NS = 5_000_000_000


class AlarmBoard:
    """All alarms of a session.

    oldest_waiting_ns : arrival time of the oldest frame that navigation has not finished [ns]; None if all are
                        finished, ``NO_FRAME_TAKEN`` before its first frame
    """

    def __init__(
        self, clock: Clock, publish: Publish, record_note: RecordNote, oldest_waiting_ns: Callable[[], int | None]
    ) -> None:
        self._clock, self._publish, self._record_note = clock, publish, record_note
        self._oldest_waiting_ns = oldest_waiting_ns
        self._alarms = AlarmList()
        self._health = HealthConditions(clock.now_ns())
        self._last: dict[str, Any] | None = None
        self._was_in_time = self._is_late = self._is_ending = False
        self._suppressed_ns: tuple[int, int | None] | None = None  # devices are switched off from, until [ns]

    def handle_report(self, report: AlarmReportRecord) -> None:
        """Handle a condition report of navigation."""
        if self._is_ending:
            return
        found = ConditionReport.from_record(report)
        self._alarms.report(replace(found, condition=None) if self._is_expected(found) else found)
        self._publish_changes()

    def _is_expected(self, report: ConditionReport) -> bool:
        """Is it a consequence of devices that are switched off, at the time of the report?"""
        if self._suppressed_ns is None or report.subject in GROUND_SUBJECTS:
            return False
        from_ns, until_ns = self._suppressed_ns
        return report.t_ns >= from_ns and (until_ns is None or report.t_ns < until_ns)

    def handle_health(self, health: dict[str, Any]) -> None:
        """Derive conditions from health, and publish the list."""
        for report in () if self._is_ending else self._health.reports(health):
            self._alarms.report(report)
        for lost in find_losses(self._last or health, health):
            self._alarms.record(lost, health["t_ns"])
        self._last = health
        self._record_changes()
        self.publish()

    def check_navigation_latency(self) -> None:
        """Report lateness of navigation; before it was in time once, it is starting."""
        if self._is_ending:
            return
        now = self._clock.now_ns()
        oldest_ns = self._oldest_waiting_ns()
        late_ns = 0 if oldest_ns is None else now - oldest_ns
        self._was_in_time = self._was_in_time or (oldest_ns != NO_FRAME_TAKEN and late_ns < IN_TIME_NS)
        self._is_late = self._was_in_time and late_ns > (IN_TIME_NS if self._is_late else LATE_NS)
        found = None
        if self._is_late:
            cause = "navigation has not processed the received frames; its values are struck out"
            late_s = round(late_ns / SECOND_NS, 1)
            found = Condition(
                "navigation_late", Severity.CAUTION, "NAVIGATION LATE", cause, late_s, explained_by=("navigation",)
            )
        self._alarms.report(ConditionReport(now, "navigation lateness", found))
        self._publish_changes()

    def on_recorder_replaced(self, cause: str) -> None:
        """A new recorder has started, and counts from zero."""
        self._last = None
        self.record(Condition("recorder", Severity.CAUTION, "RECORDER REPLACED", cause))

    def record(self, condition: Condition) -> None:
        """Record a condition that happened now."""
        self._alarms.record(condition, self._clock.now_ns())
        self._publish_changes()

    def suppress_device_alarms(self) -> None:
        """Suppress alarms of links and devices and their consequences in navigation until ``resume_device_alarms``.

        Navigation must be reset meanwhile: it reports only changes, and suppressed reports are not repeated.
        """
        if self._suppressed_ns is None or self._suppressed_ns[1] is not None:
            self._suppressed_ns = self._clock.now_ns(), None
        self._health.suppress_device_alarms()

    def resume_device_alarms(self) -> None:
        """All devices are switched on."""
        now = self._clock.now_ns()
        if self._suppressed_ns is not None:
            self._suppressed_ns = self._suppressed_ns[0], now
        self._health.resume_device_alarms(now)

    def start_new_flight(self, who: str) -> None:
        """A new flight begins, started by ``who``; acknowledge the alarms from the end of the last one."""
        now = self._clock.now_ns()
        self._health.start_new_flight(now)
        self._alarms.acknowledge(who, now, since_ns=now - FLIGHT_END_NS, excluded=SYSTEM_CONDITIONS)
        self._publish_changes()

    def end(self) -> None:
        """The session ends: silence is expected from now on."""
        self._is_ending = True

    def acknowledge(self, who: str, alarm_id: str | None) -> int:
        """Acknowledge an alarm, or all; returns the number of newly acknowledged alarms."""
        count = self._alarms.acknowledge(who, self._clock.now_ns(), alarm_id)
        self._publish_changes()
        return count

    def publish(self) -> None:
        """Publish the list on the bus."""
        self._publish(BUS_ALARMS, encode({"t_ns": self._clock.now_ns(), "alarms": self._alarms.rows()}))

    def _publish_changes(self) -> None:
        if self._record_changes():
            self.publish()

    def _record_changes(self) -> bool:
        changes = self._alarms.take_changes()
        for change in changes:
            self._record_note(change)
        return bool(changes)
