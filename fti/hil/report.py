"""Transmission statistics of an emulator or replay: counters, rates and lateness, as text, JSON and live status.

A device holds its rate when 99 of 100 of its messages are less than half a period late and its line dropped none.
A message that is later is closer to the due time of the next one than to its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import groupby
from typing import Any

from fti.hil.ports.counters import EndpointCounters
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


@dataclass(frozen=True, slots=True)
class TransmissionReport:
    """Counters and lateness per link.

    rates : of the devices, if any; remarks : other problems
    """

    links: Mapping[str, EndpointCounters]
    lateness: LatencySummary
    link_lateness: Mapping[str, LatencySummary] = field(default_factory=dict)
    rates: Sequence[Rate] = ()
    remarks: Sequence[str] = ()

    @property
    def problems(self) -> list[str]:
        """Requirements that were not met, with the reason."""
        return [*self.remarks, *(why for rate in self.rates if (why := self._rate_problem(rate)))]

    def _rate_problem(self, rate: Rate) -> str:
        counters = self.links.get(rate.link)
        if counters is not None and counters.too_slow_messages:
            return f"{rate.name}: its line {rate.link} is too slow: {counters.too_slow_messages} messages were dropped"
        if rate.is_held:
            return ""
        limit_ms = 0.5e3 / rate.asked_hz
        return f"{rate.name}: p99 lateness is {rate.lateness.p99_ms:.2f} ms, above half a period of {limit_ms:.2f} ms"

    def as_json(self) -> dict[str, Any]:
        """The report as JSON types."""
        return {
            "lateness": asdict(self.lateness),
            "links": {
                name: {
                    **asdict(counters),
                    "lateness": asdict(self.link_lateness[name]) if name in self.link_lateness else None,
                }
                for name, counters in self.links.items()
            },
            "devices": {rate.name: {**asdict(rate), "held": not self._rate_problem(rate)} for rate in self.rates},
            "not_held": self.problems,
        }


def lateness_by_link(meters: Sequence[Meter]) -> dict[str, LatencySummary]:
    """Lateness of each link over all its devices."""
    ordered = sorted(meters, key=lambda meter: meter.link)
    return {
        link: LatencyHistogram.merge(meter.late for meter in group).summary
        for link, group in groupby(ordered, key=lambda meter: meter.link)
    }
