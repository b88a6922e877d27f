"""The flags of the daemon: words at places, with their intervals.

A word is set from the message that contains it to the first message at the same place without it.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from fti.post.score.truth_reader import FlightPause

#: A device status is valid until the next one, but at most this time: some devices report an event only once [s].
STATUS, HOLD_S = "/device_status", 2.0
#: Intervals of the same word with a shorter gap are merged [s].
MERGE_S = 1.0
#: Tolerance for rounded times [s].
MOMENT_S = 0.05
#: Relative tolerance for numbers that are rounded on the wire.
VALUE_TOLERANCE_SHARE = 0.1

Words = frozenset[str]
NOTHING: Words = frozenset()


@dataclass(slots=True)
class FlagInterval:
    """A word was set from from_s until until_s [s of the flight]; infinity where it did not clear."""

    from_s: float
    until_s: float = math.inf


@dataclass(slots=True)
class FlagTimeline:
    """Words at places.

    spans : (place, word) -> its intervals, in order
    """

    spans: dict[tuple[str, str], list[FlagInterval]] = field(default_factory=lambda: defaultdict(list))
    _current: dict[str, tuple[float, Words]] = field(default_factory=dict)

    def feed(self, t: float, place: str, words: Words) -> None:
        """Add a message at a place, at t [s], with exactly these words."""
        last_s, before = self._current.get(place, (t, NOTHING))
        if place.endswith(STATUS) and t - last_s > HOLD_S:
            self._end(place, before, last_s + HOLD_S)
            before = NOTHING
        self._end(place, before - words, t)
        for word in words - before:
            spans = self.spans[place, word]
            if spans and t - spans[-1].until_s < MERGE_S:
                spans[-1].until_s = math.inf
            else:
                spans.append(FlagInterval(t))
        self._current[place] = t, words

    def finish(self) -> None:
        """End the intervals of the last device status."""
        for place, (last_s, words) in self._current.items():
            if place.endswith(STATUS):
                self._end(place, words, last_s + HOLD_S)

    def _end(self, place: str, words: Words, t: float) -> None:
        for word in words:
            self.spans[place, word][-1].until_s = t

    def intervals(self, place: str, words: Iterable[str]) -> list[FlagInterval]:
        """Intervals of any of these words at this place, or at all places below it when it ends with a slash."""
        wanted = set(words)
        intervals = [
            span
            for (where, word), spans in self.spans.items()
            if word in wanted and (where.startswith(place) if place.endswith("/") else where == place)
            for span in spans
        ]
        return sorted(intervals, key=lambda span: span.from_s)


@dataclass(slots=True)
class ObservedFlags(FlagTimeline):
    """All observations of a flight.

    may_alarm, must_alarm : alarm conditions in outputs and health (``alarm_states``); words are identities of alarms
    values : of the selected channels: channel -> (time [s], value)
    clocks : device -> time from which its clock is known [s]
    ticks  : the first and the last tick of the recorder [s], every 20 ms; tick_gaps : intervals without
    lag_intervals : in which navigation was behind
    first_report_s : of navigation [s]; infinity without a report
    last_report_s : time of the last recent report of navigation [s]
    """

    may_alarm: FlagTimeline = field(default_factory=FlagTimeline)
    must_alarm: FlagTimeline = field(default_factory=FlagTimeline)
    values: dict[str, list[tuple[float, Any]]] = field(default_factory=lambda: defaultdict(list))
    clocks: dict[str, float] = field(default_factory=dict)
    ticks: tuple[float, float] = (-math.inf, math.inf)
    tick_gaps: list[FlightPause] = field(default_factory=list)
    lag_intervals: list[FlightPause] = field(default_factory=list)
    first_report_s: float = 0.0
    last_report_s: float = math.inf

    def intervals_near_value(self, channel: str, value: float) -> list[FlagInterval]:
        """Intervals in which a channel had this value, within ``VALUE_TOLERANCE_SHARE``."""
        spans = list[FlagInterval]()
        for t, number in self.values[channel]:
            is_near = isinstance(number, int | float) and abs(number - value) <= VALUE_TOLERANCE_SHARE * abs(value)
            is_open = bool(spans) and math.isinf(spans[-1].until_s)
            if is_near and not is_open:
                spans.append(FlagInterval(t))
            elif is_open and not is_near:
                spans[-1].until_s = t
        return spans

    def knows_clock(self, device: str, t: float) -> bool:
        """Was the clock of a device known at t [s]?"""
        return self.clocks.get(device, math.inf) <= t


def uncovered_parts(span: FlagInterval, intervals: Iterable[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """The parts of a span that no interval covers; parts shorter than ``MOMENT_S`` count only if the whole span is."""
    min_s, at = min(MOMENT_S, span.until_s - span.from_s), span.from_s
    for from_s, until_s in sorted(intervals):
        if until_s >= at and from_s <= span.until_s:
            if from_s - at > min_s:
                yield at, from_s
            at = max(at, math.nextafter(until_s, math.inf))
    if at <= span.until_s and span.until_s - at >= min_s:
        yield at, span.until_s
