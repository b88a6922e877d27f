"""Lateness of the messages of a device, and whether it held its rate.

A device holds its rate when 99 of 100 of its messages are less than half a period late and its line dropped none.
A message that is later is closer to the due time of the next one than to its own.
"""

from __future__ import annotations

from dataclasses import dataclass

from fti.latency_histogram import LatencyHistogram, LatencySummary


@dataclass(frozen=True, slots=True)
class Rate:
    """Requested and achieved rate of a device.

    asked_hz : rate of the configuration, or default of the driver; sent_hz : None before the second message
    """

    name: str
    link: str
    asked_hz: float
    sent_hz: float | None
    lateness: LatencySummary

    @property
    def is_held(self) -> bool:
        """Whether the p99 lateness is below half a period."""
        return self.lateness.p99_ms < 0.5e3 / self.asked_hz


class Meter:
    """Measures the lateness and rate of one device.  name, link : of the configuration; asked_hz : its rate"""

    def __init__(self, name: str, link: str, asked_hz: float) -> None:
        self.name, self.link = name, link
        self.late = LatencyHistogram()
        self._asked_hz = asked_hz
        self._cycles = 0
        self._first_s: float | None = None
        self._last_s = 0.0

    def note(self, due_s: float, late_s: float, *, is_cycle: bool = True) -> None:
        """Record a message that was due at due_s [s] and leaves late_s later.

        is_cycle : the message is a cycle of the device, not one that a fault held back; only cycles count for the rate
        """
        self.late.add(late_s)
        if not is_cycle:
            return
        self._cycles += 1
        self._last_s = due_s + late_s
        if self._first_s is None:
            self._first_s = self._last_s

    @property
    def rate(self) -> Rate:
        """The rate so far."""
        lasted_s = self._last_s - (self._first_s or 0.0)
        sent_hz = (self._cycles - 1) / lasted_s if self._cycles > 1 and lasted_s > 0.0 else None
        return Rate(self.name, self.link, self._asked_hz, sent_hz, self.late.summary)
