"""Records the kernel's clocks once a second, and reports steps of the real-time clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fti.clock import SystemClock
from fti.constants import SECOND_NS
from fti.messages.control import ClockStepNotice
from fti.messages.notes import ClockRecord
from fti.messages.topics import note_message

#: Topic, FTI time [ns] and content of a note.
RecordNote = Callable[[str, int, dict[str, Any]], None]
Send = Callable[[ClockStepNotice], object]
#: Level, source and text of an event.
ReportEvent = Callable[[str, str, str], None]


def report_clocks(clock: SystemClock, record_note: RecordNote, report_event: ReportEvent, send: Send) -> None:
    """Record the clocks on ``/fti/clock``; report each step of the real-time clock since the last call.

    send : sends a message to the supervisor, which raises the alarm
    """
    record_note(*note_message(ClockRecord(**clock.sample())))
    for step in clock.take_steps():
        text = f"the real-time clock was stepped by {step.size_ns / SECOND_NS:+.3f} s; FTI time is not affected"
        report_event("warning", "clock", text)
        send(ClockStepNotice(text))
