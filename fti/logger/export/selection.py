"""What is to be exported: topics, a time window, rates."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase

from fti.constants import SECOND_NS
from fti.logger.export.resampled import has_signals


@dataclass(frozen=True, slots=True)
class ExportSelection:
    """Selection of topics that match one of the patterns (all without patterns), from begin_s to end_s [s after the
    first message of the session].

    raw : also received and sent frames of the links;  degrees : angles in degrees;  points : also those of scans
    thin_hz : at most so many measurements of each kind in a second;  resample_hz : one table with so many rows in one
    """

    topics: tuple[str, ...] = ()
    begin_s: float = 0.0
    end_s: float = float("inf")
    raw: bool = False
    degrees: bool = False
    thin_hz: float | None = None
    resample_hz: float | None = None
    points: bool = False

    def matches(self, topic: str) -> bool:
        """Does the topic match?"""
        if self.resample_hz and not has_signals(topic):
            return False
        return not self.topics or any(fnmatchcase(topic, pattern) for pattern in self.topics)


class TimeWindow:
    """The selected part of the session."""

    def __init__(self, start_ns: int, selection: ExportSelection) -> None:
        self.start_ns = start_ns
        self.begin_s, self.end_s = selection.begin_s, selection.end_s

    def seconds(self, t_ns: int) -> float | None:
        """Time since the start [s]; None outside."""
        t_s = (t_ns - self.start_ns) / SECOND_NS
        return t_s if self.begin_s <= t_s <= self.end_s else None

    def has_ended(self, t_ns: int) -> bool:
        """Is the time after the end?"""
        return (t_ns - self.start_ns) / SECOND_NS > self.end_s
