"""What the daemon said: at each place words, and from when until when they stood.

A word stands from the message that has it until the first at the same place that has not.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from fti.post.score.truth_reader import FlightPause

#: A device's status stands until the next one, but some devices say only once what has happened [s].
STATUS, HOLD_S = "/device_status", 2.0
#: The same word again after a shorter time has stood all along [s].
MERGE_S = 1.0
#: What stands for less beyond what is allowed is a matter of rounding [s].
MOMENT_S = 0.05
#: What is rounded on the wire is the same number within this share.
VALUE_TOLERANCE_SHARE = 0.1

Words = frozenset[str]
NOTHING: Words = frozenset()


@dataclass(slots=True)
class FlagInterval:
    """A word stood from from_s until until_s [s of the flight]; infinity where it did not go."""

    from_s: float
    until_s: float = math.inf


@dataclass(slots=True)
class FlagTimeline:
    """Words at places.

    spans : (place, word) -> when it stood, in order
    """

    spans: dict[tuple[str, str], list[FlagInterval]] = field(default_factory=lambda: defaultdict(list))
    _stand: dict[str, tuple[float, Words]] = field(default_factory=dict)

    def feed(self, t: float, place: str, words: Words) -> None:
        """A message at a place, at t [s], that says these words and no others."""
        told_s, before = self._stand.get(place, (t, NOTHING))
        if place.endswith(STATUS) and t - told_s > HOLD_S:
            self._end(place, before, told_s + HOLD_S)
            before = NOTHING
        self._change(t, place, before, words)
        self._stand[place] = t, words

    def finish(self) -> None:
        """No message comes any more."""
        for place, (told_s, words) in self._stand.items():
            if place.endswith(STATUS):
                self._end(place, words, told_s + HOLD_S)

    def _end(self, place: str, words: Words, t: float) -> None:
        for word in words:
            self.spans[place, word][-1].until_s = t

    def _change(self, t: float, place: str, before: Words, words: Words) -> None:
        self._end(place, before - words, t)
        for word in words - before:
            spans = self.spans[place, word]
            if spans and t - spans[-1].until_s < MERGE_S:
                spans[-1].until_s = math.inf
            else:
                spans.append(FlagInterval(t))

    def at(self, place: str, words: Iterable[str]) -> list[FlagInterval]:
        """When one of these words stood at places that are this one, or below it when it ends with a slash."""
        wanted = set(words)
        found = [spans for (where, word), spans in self.spans.items() if word in wanted and _is_at(where, place)]
        return sorted((span for spans in found for span in spans), key=lambda span: span.from_s)


@dataclass(slots=True)
class ObservedFlags(FlagTimeline):
    """Everything that was said.

    may_alarm, must_alarm : what outputs and health say of alarms (``alarm_states``); words are identities of alarms
    values : what is asked for: channel -> (time [s], value)
    clocks : device -> since when its clock is known [s]
    ticks  : the first and the last tick of the recorder [s], which come every 20 ms; tick_gaps : where they did not
    behind : in which navigation was later than it may be
    began_s : when navigation said something of itself for the first time [s]; infinity when it never did
    spoke_s : when it had said something lately for the last time [s]
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
        """When this number, or one within a tenth of it, stood at a channel of which the values are kept."""
        spans = list[FlagInterval]()
        for t, observed_flags in self.values[channel]:
            is_near = isinstance(observed_flags, int | float) and abs(
                observed_flags - value
            ) <= VALUE_TOLERANCE_SHARE * abs(value)
            is_paused = bool(spans) and math.isinf(spans[-1].until_s)
            if is_near and not is_paused:
                spans.append(FlagInterval(t))
            elif is_paused and not is_near:
                spans[-1].until_s = t
        return spans

    def knows_clock(self, device: str, t: float) -> bool:
        """Was the clock of a device known at t [s]?"""
        return self.clocks.get(device, math.inf) <= t


def uncovered_parts(span: FlagInterval, intervals: Iterable[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """The parts of a span that no interval covers; what is shorter than a moment is none, unless the whole span is."""
    least, at = min(MOMENT_S, span.until_s - span.from_s), span.from_s
    for from_s, until_s in sorted(intervals):
        if until_s >= at and from_s <= span.until_s:
            if from_s - at > least:
                yield at, from_s
            at = max(at, math.nextafter(until_s, math.inf))
    if at <= span.until_s and span.until_s - at >= least:
        yield at, span.until_s


def _is_at(where: str, place: str) -> bool:
    return where.startswith(place) if place.endswith("/") else where == place
