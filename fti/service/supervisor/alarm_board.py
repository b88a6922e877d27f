"""The daemon's alarms: what navigation and health report, latched until a person acknowledges it.

The supervisor keeps them, so they outlast a restart of navigation and of every display.  Each change is recorded on
``/fti/alarm``; the list is published on ``/alarms`` with each change, and with each health message.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from fti.alarms.alarm_list import AlarmList
from fti.alarms.condition import Condition, ConditionReport, Json, Severity
from fti.bus.message import encode
from fti.clock import SECOND_NS, Clock
from fti.logger.schemas import ALARM_TOPIC
from fti.service.supervisor.event_publisher import Publish, RecordNote
from fti.service.supervisor.health_conditions import SYSTEM_CONDITIONS, HealthConditions, find_losses

#: What waits for longer is late for every consumer; below the second limit navigation is in time again [ns].
LATE_NS, IN_TIME_NS = 500_000_000, 250_000_000
NO_FRAME_TAKEN = -1
ALARMS_TOPIC = "/alarms"
#: Subjects of navigation that have nothing to do with devices.
GROUND_SUBJECTS = frozenset({"terrain"})
#: What falls silent so long before another flight begins belongs to the end of the last one [ns].
FLIGHT_END_NS = 5_000_000_000


class AlarmBoard:
    """All alarms of a session.

    oldest_waiting_ns : when the oldest frame arrived that navigation has not finished [ns]; None when it has finished
                        all, NEVER when it has taken none yet
    """

    def __init__(
        self, clock: Clock, publish: Publish, note: RecordNote, oldest_waiting_ns: Callable[[], int | None]
    ) -> None:
        self._clock, self._publish, self._note = clock, publish, note
        self._oldest_waiting_ns = oldest_waiting_ns
        self._alarms = AlarmList()
        self._health = HealthConditions(clock.now_ns())
        self._last: Json | None = None
        self._was_in_time = self._is_late = self._is_ending = False
        self._expected: tuple[int, int | None] | None = None  # devices are switched off from, until [ns]

    def handle_report(self, report: Json) -> None:
        """What navigation reports."""
        if self._is_ending:
            return
        found = ConditionReport.from_json(report)
        self._alarms.report(replace(found, condition=None) if self._is_expected(found) else found)
        self._publish_changes()

    def _is_expected(self, report: ConditionReport) -> bool:
        """Does it follow from devices that are switched off?  What comes late is of its own time."""
        if self._expected is None or report.subject in GROUND_SUBJECTS:
            return False
        from_ns, until_ns = self._expected
        return report.t_ns >= from_ns and (until_ns is None or report.t_ns < until_ns)

    def handle_health(self, health: Json) -> None:
        """What follows from health; the list is published with it."""
        for report in () if self._is_ending else self._health.reports(health):
            self._alarms.report(report)
        for lost in find_losses(self._last or health, health):
            self._alarms.record(lost, health["t_ns"])
        self._last = health
        self._record_changes()
        self.publish()

    def check_navigation_latency(self) -> None:
        """Is navigation late?  Until it has taken frames and was in time once, it is starting."""
        if self._is_ending:
            return
        now = self._clock.now_ns()
        oldest_ns = self._oldest_waiting_ns()
        late_ns = 0 if oldest_ns is None else now - oldest_ns
        self._was_in_time = self._was_in_time or (oldest_ns != NO_FRAME_TAKEN and late_ns < IN_TIME_NS)
        self._is_late = self._was_in_time and late_ns > (IN_TIME_NS if self._is_late else LATE_NS)
        found = None
        if self._is_late:
            cause = "frames arrive, and navigation has not worked on them; its values are struck out"
            late_s = round(late_ns / SECOND_NS, 1)
            found = Condition(
                "navigation_late", Severity.CAUTION, "NAVIGATION LATE", cause, late_s, explained_by=("navigation",)
            )
        self._alarms.report(ConditionReport(now, "navigation lateness", found))
        self._publish_changes()

    def on_recorder_replaced(self, cause: str) -> None:
        """Another recorder goes on, and counts from zero."""
        self._last = None
        self.record(Condition("recorder", Severity.CAUTION, "RECORDER REPLACED", cause))

    def record(self, condition: Condition) -> None:
        """Something has happened now."""
        self._alarms.record(condition, self._clock.now_ns())
        self._publish_changes()

    def suppress_device_alarms(self) -> None:
        """Links and devices, and what navigation makes of their silence, are no alarm until ``resume_device_alarms``.

        Navigation must begin anew meanwhile: it reports changes, and what it has reported is not asked for again.
        """
        if self._expected is None or self._expected[1] is not None:
            self._expected = self._clock.now_ns(), None
        self._health.suppress_device_alarms()

    def resume_device_alarms(self) -> None:
        """Somebody has switched all of them on."""
        now = self._clock.now_ns()
        if self._expected is not None:
            self._expected = self._expected[0], now
        self._health.resume_device_alarms(now)

    def start_new_flight(self, who: str) -> None:
        """Another flight begins, as ``who`` says, and has seen what the end of the last one was."""
        now = self._clock.now_ns()
        self._health.start_new_flight(now)
        self._alarms.acknowledge(who, now, since_ns=now - FLIGHT_END_NS, excluded=SYSTEM_CONDITIONS)
        self._publish_changes()

    def end(self) -> None:
        """The session ends: what falls silent from now on is expected."""
        self._is_ending = True

    def acknowledge(self, who: str, alarm_id: str | None) -> int:
        """A person has seen an alarm, or all of them; returns how many were not acknowledged before."""
        count = self._alarms.acknowledge(who, self._clock.now_ns(), alarm_id)
        self._publish_changes()
        return count

    def publish(self) -> None:
        """Put the list on the bus."""
        self._publish(ALARMS_TOPIC, encode({"t_ns": self._clock.now_ns(), "alarms": self._alarms.rows()}))

    def _publish_changes(self) -> None:
        if self._record_changes():
            self.publish()

    def _record_changes(self) -> bool:
        changes: list[dict[str, Any]] = self._alarms.take_changes()
        for change in changes:
            self._note(ALARM_TOPIC, change["t_ns"], change)
        return bool(changes)
