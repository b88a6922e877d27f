"""Transmission statistics of an emulator or replay: counters and lateness, as text, JSON and live status."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import groupby
from typing import Any

from fti.hil.ports.counters import EndpointCounters
from fti.hil.rate_statistics import Meter, Rate
from fti.latency_histogram import LatencyHistogram, LatencySummary


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
