"""What the recorder says of the kernel's clocks: once a second into the file, and a word when somebody set one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fti.clock import SECOND_NS, SystemClock

#: Topic, FTI time [ns] and content of a note.
RecordNote = Callable[[str, int, dict[str, Any]], None]
Send = Callable[[dict[str, Any]], object]
#: Level, source and text of an event.
ReportEvent = Callable[[str, str, str], None]


def report_clocks(clock: SystemClock, note: RecordNote, report_event: ReportEvent, send: Send) -> None:
    """Note the clocks on ``/fti/clock``; tell each step of the real-time clock since the last call.

    send : tells the supervisor, whose alarm it is
    """
    sample = clock.sample()
    note("/fti/clock", sample["t_ns"], sample)
    for step in clock.take_steps():
        text = f"the real-time clock was stepped by {step.size_ns / SECOND_NS:+.3f} s; FTI time goes on"
        report_event("warning", "clock", text)
        send({"clock_step": text})
