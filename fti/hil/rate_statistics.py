"""How late the messages of a device went out, and whether it held its rate.

A device holds its rate when 99 of 100 of its messages are less than half a period late and its line carries what it
sends.  Later than that, a message is nearer to the instant of the next one than to its own: the rate is then a claim.
"""

from __future__ import annotations

from dataclasses import dataclass

from fti.latency_histogram import LatencyHistogram, LatencySummary


@dataclass(frozen=True, slots=True)
class Rate:
    """What was asked of a device and what it did.

    asked_hz : of the configuration, or of the device's kind; sent_hz : None before the second message
    """

    name: str
    link: str
    asked_hz: float
    sent_hz: float | None
    lateness: LatencySummary

    @property
    def is_held(self) -> bool:
        """Was it punctual enough for its rate?"""
        return self.lateness.p99_ms < 0.5e3 / self.asked_hz


class Meter:
    """Measures one device.  name, link : of the configuration; asked_hz : its rate"""

    def __init__(self, name: str, link: str, asked_hz: float) -> None:
        self.name, self.link = name, link
        self.late = LatencyHistogram()
        self._asked_hz = asked_hz
        self._cycles = 0
        self._first_s: float | None = None
        self._last_s = 0.0

    def note(self, due_s: float, late_s: float, *, is_cycle: bool = True) -> None:
        """A message that was due at due_s [s] goes out so much later.

        is_cycle : it is one of the device's own, not one that something had held back and that does not count as rate
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
        """What may be said so far."""
        lasted_s = self._last_s - (self._first_s or 0.0)
        sent_hz = (self._cycles - 1) / lasted_s if self._cycles > 1 and lasted_s > 0.0 else None
        return Rate(self.name, self.link, self._asked_hz, sent_hz, self.late.lateness)
