"""What became of everything that was sent, and how late it was: for the person, for programs, and live."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import groupby
from typing import Any

from fti.hil.ports.sent import Sent
from fti.hil.rates import Meter, Rate
from fti.lateness import Histogram, Lateness


@dataclass(frozen=True, slots=True)
class Report:
    """What was sent, per link, and how late.

    rates : of the devices, where devices have any; remarks : what else may not be claimed
    """

    links: Mapping[str, Sent]
    lateness: Lateness
    by_link: Mapping[str, Lateness] = field(default_factory=dict)
    rates: Sequence[Rate] = ()
    remarks: Sequence[str] = ()

    @property
    def not_held(self) -> list[str]:
        """What may not be claimed, and why not."""
        return [*self.remarks, *(why for rate in self.rates if (why := self._why_not(rate)))]

    def _why_not(self, rate: Rate) -> str:
        sent = self.links.get(rate.link)
        if sent is not None and sent.too_slow_messages:
            return f"{rate.name}: its line {rate.link} is too slow: {sent.too_slow_messages} messages were dropped"
        if rate.held:
            return ""
        limit_ms = 0.5e3 / rate.asked_hz
        return f"{rate.name}: p99 of its lateness is {rate.lateness.p99_ms:.2f} ms, half a period is {limit_ms:.2f} ms"

    def as_json(self) -> dict[str, Any]:
        """The same, for programs."""
        return {
            "lateness": asdict(self.lateness),
            "links": {
                name: {**asdict(sent), "lateness": asdict(self.by_link[name]) if name in self.by_link else None}
                for name, sent in self.links.items()
            },
            "devices": {rate.name: {**asdict(rate), "held": not self._why_not(rate)} for rate in self.rates},
            "not_held": self.not_held,
        }


def lateness_by_link(meters: Sequence[Meter]) -> dict[str, Lateness]:
    """Of each link, over all its devices."""
    ordered = sorted(meters, key=lambda meter: meter.link)
    return {
        link: Histogram.merged(meter.late for meter in group).lateness
        for link, group in groupby(ordered, key=lambda meter: meter.link)
    }
