"""Records the kernel's clocks once a second, and reports steps of the real-time clock."""

from __future__ import annotations

from collections.abc import Callable

from fti.clock import SystemClock
from fti.constants import SECOND_NS
from fti.messages.control import ClockStepNotice
from fti.messages.notes import ClockRecord
from fti.messages.topics import note_message
from fti.service.fault_guard import ReportEvent
from fti.service.recorder.log_source import RecordNote

Send = Callable[[ClockStepNotice], object]


def report_clocks(clock: SystemClock, record_note: RecordNote, report_event: ReportEvent, send: Send) -> None:
    """Record the clocks on ``/fti/clock``; report each step of the real-time clock since the last call.

    send : sends a message to the supervisor, which raises the alarm
    """
    record_note(*note_message(ClockRecord(**clock.sample())))
    for step in clock.take_steps():
        text = f"the real-time clock was stepped by {step.size_ns / SECOND_NS:+.3f} s; FTI time is not affected"
        report_event("warning", "clock", text)
        send(ClockStepNotice(text))
