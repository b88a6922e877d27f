"""The clocks go into the file once a second; a real-time clock that was set is an event, and FTI time goes on."""

from __future__ import annotations

import time
from typing import Any

import pytest

from fti.clock import SystemClock
from fti.messages.control import ClockStepNotice
from fti.service.recorder.clock_monitor import report_clocks

SECOND_NS = 1_000_000_000


class Log:
    def __init__(self) -> None:
        self.notes: list[tuple[str, int, dict[str, Any]]] = []
        self.events: list[tuple[str, str, str]] = []
        self.sent: list[ClockStepNotice] = []

    def note(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        self.notes.append((topic, t_ns, content))

    def report_event(self, level: str, source: str, text: str) -> None:
        self.events.append((level, source, text))

    def send(self, message: ClockStepNotice) -> None:
        self.sent.append(message)


@pytest.mark.parametrize(("step_ns", "step_text"), [(3_200_000_000, "+3.200 s"), (-5_000_000_000, "-5.000 s")])
def test_a_step_is_reported_once_and_fti_time_goes_on(
    monkeypatch: pytest.MonkeyPatch, step_ns: int, step_text: str
) -> None:
    real = time.clock_gettime_ns
    added = 0

    def read(clock_id: int) -> int:
        return real(clock_id) + (added if clock_id == time.CLOCK_REALTIME else 0)

    monkeypatch.setattr("fti.clock.time.clock_gettime_ns", read)
    clock, log = SystemClock(epoch_ns=7 * SECOND_NS), Log()
    report_clocks(clock, log.note, log.report_event, log.send)
    assert log.events == []
    added = step_ns
    report_clocks(clock, log.note, log.report_event, log.send)
    report_clocks(clock, log.note, log.report_event, log.send)
    assert log.events == [
        ("warning", "clock", f"the real-time clock was stepped by {step_text}; FTI time is not affected")
    ]
    assert log.sent == [ClockStepNotice(log.events[0][2])]
    assert [topic for topic, *_ in log.notes] == ["/fti/clock"] * 3
    times = [t_ns for _, t_ns, _ in log.notes]
    assert times == sorted(times)
    assert times[-1] - times[0] < SECOND_NS
    before, after = (content["realtime_ns"] - content["t_ns"] for _, _, content in log.notes[:2])
    assert after - before == pytest.approx(step_ns, abs=SECOND_NS / 10)
