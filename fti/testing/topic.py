"""Assertions on the messages of one topic, over an interval of the flight.

Times are seconds of the flight; quantities are SI and radians.  A failure is an AssertionError with topic, quantity,
limit, measured value, time of the largest deviation, and session folder.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np

from fti.arrays import Array
from fti.hil.tables.fault_types import Fault
from fti.post.score.series import TopicSeries
from fti.post.score.truth_table import TruthTable
from fti.testing.deviations import TruthDeviations, compare

Condition = Callable[[dict[str, Any]], bool]
#: Fields of a message that list words.
LISTS = ("flags", "reasons")


class FlagSpan(NamedTuple):
    """A flag is set from the message that has it to the first without it; infinity where none follows [s]."""

    from_s: float
    until_s: float


def spans_of(times_s: Sequence[float], rows: Sequence[dict[str, Any]], flag: str | Condition) -> list[FlagSpan]:
    """Intervals in which a flag is set, in order.  times_s : of the rows, ascending"""
    is_set: Condition = flag if callable(flag) else lambda row: any(flag in (row.get(name) or ()) for name in LISTS)
    spans = list[FlagSpan]()
    begin: float | None = None
    for t_s, row in zip(times_s, rows, strict=True):
        if is_set(row):
            begin = t_s if begin is None else begin
        elif begin is not None:
            spans.append(FlagSpan(begin, t_s))
            begin = None
    return spans if begin is None else [*spans, FlagSpan(begin, math.inf)]


def show(flag: str | Condition) -> str:
    """A flag as text for a failure message."""
    return repr(flag) if isinstance(flag, str) else "of the given condition"


class FlightContext(NamedTuple):
    """Shared by all topics of a flight.  failure_context : text below each failure message"""

    truth: TruthTable
    faults: Sequence[Fault]
    failure_context: str


class Topic:
    """The messages of a topic in an interval.

    series : of the whole flight; interval : from and until [s]; where : fields that the messages must have
    """

    def __init__(
        self,
        series: TopicSeries,
        background: FlightContext,
        interval: tuple[float, float],
        where: Mapping[str, object],
    ) -> None:
        self.name = series.topic + "".join(f" [{key} = {value}]" for key, value in where.items())
        self._truth, self._faults, self._failure_context = background
        self.from_s, self.until_s = interval
        t_s = self._truth.seconds(series.log_ns)
        selected = (t_s >= self.from_s) & (t_s <= self.until_s)
        for key, value in where.items():
            selected &= np.array([one == value for one in series.values(key)], dtype=bool)
        self.series, self.times_s = series.pick(selected), t_s[selected]

    def __len__(self) -> int:
        return len(self.series)

    @property
    def rows(self) -> Sequence[dict[str, Any]]:
        """The messages as tables."""
        return self.series.rows

    # --------------------------------------------------------------------------------------------------- arrival times

    def assert_rate(self, at_least_hz: float, at_most_hz: float | None = None) -> None:
        """Messages come at a mean rate within these limits [Hz]."""
        __tracebackhide__ = True
        rate = len(self) / (self.until_s - self.from_s)
        if rate < at_least_hz or (at_most_hz is not None and rate > at_most_hz):
            upper = "" if at_most_hz is None else f", at most {at_most_hz:g} Hz"
            gap, at_s = self._longest_gap()
            self._fail(
                f"rate {rate:.2f} Hz ({len(self)} messages); limit at least {at_least_hz:g} Hz{upper}; "
                f"longest gap {gap:.3f} s, from {at_s:.2f} s on"
            )

    def assert_longest_gap(self, limit_s: float) -> None:
        """No gap between messages, or between them and an end of the interval, is longer [s]."""
        __tracebackhide__ = True
        gap, at_s = self._longest_gap()
        if gap > limit_s:
            self._fail(f"longest gap {gap:.3f} s, from {at_s:.2f} s on; limit {limit_s:g} s")

    def _longest_gap(self) -> tuple[float, float]:
        """Length and begin of the longest gap [s]."""
        edges = np.array([self.from_s, *self.times_s, self.until_s])
        gaps = np.diff(edges)
        k = int(np.argmax(gaps))
        return float(gaps[k]), float(edges[k])

    # --------------------------------------------------------------------------------------------------------- content

    def assert_valid_share(self, at_least: float) -> None:
        """At least this share (0 to 1) of the messages is flagged valid."""
        __tracebackhide__ = True
        self._assert_any(self.series)
        valid = self.series.valid
        share = float(valid.mean())
        if share < at_least:
            first_s = float(self.times_s[~valid][0])
            self._fail(
                f"{share:.1%} of {len(self)} messages are valid; limit at least {at_least:.1%}; first invalid message "
                f"at {first_s:.2f} s"
            )

    def assert_error(self, quantity: str, limit: float, *, truth: str | None = None, share: float = 1.0) -> None:
        """The error against the ground truth is within +-limit in this share (0 to 1) of the valid messages.

        A message is compared with the truth at its time of validity; a delay of the unit is an error of the unit,
        unless the recorder's configuration states it (``latency_ms``, or the time in the message).
        limit : in SI, angles in rad, lat and lon in metres along the ground
        truth : quantity of the truth file (``fti.hil.truth_log.QUANTITIES``); None : the same name
        """
        __tracebackhide__ = True
        found = self._compare(quantity, truth)
        self._assert_within(quantity, found, np.full(len(found.error), float(limit)), share)

    def assert_error_within_sigma(
        self, quantity: str, sd: str, k: float = 3.0, *, truth: str | None = None, share: float = 1.0
    ) -> None:
        """The same, and the limit is k times the standard deviation that each message states in the field ``sd``."""
        __tracebackhide__ = True
        found = self._compare(quantity, truth)
        stated = self.series.column(sd)[found.rows]
        missing = np.flatnonzero(~(stated > 0.0))
        if len(missing):
            self._fail(f"{quantity}: {len(missing)} messages state no {sd}, the first at {found.t_s[missing[0]]:.2f} s")
        self._assert_within(quantity, found, k * stated, share, f"{k:g} {sd} = ")

    def _compare(self, quantity: str, truth: str | None) -> TruthDeviations:
        __tracebackhide__ = True
        self._assert_any(self.series)
        fields = sorted({name for row in self.rows for name in row if name != "stamp"})
        if quantity not in fields:
            self._fail(f"no message has a field {quantity!r}; fields: {', '.join(fields)}")
        found = compare(self.series, quantity, self._truth, truth)
        if found.name not in self._truth.columns:
            names = ", ".join(self._truth.columns)
            self._fail(f"{quantity}: the truth has no {found.name!r}; select a quantity with truth=: {names}")
        if not len(found.error):
            valid = int(self.series.valid.sum())
            self._fail(f"{quantity}: nothing to compare: {valid} of {len(self)} messages are valid, none with a number")
        return found

    def _assert_within(
        self, quantity: str, found: TruthDeviations, limits: Array, share: float, factor: str = ""
    ) -> None:
        """limits : of each message, shape (n,); factor : text of the factor, where they differ"""
        __tracebackhide__ = True
        beyond = ~(np.abs(found.error) <= limits)
        if 1.0 - float(beyond.mean()) >= share:
            return
        k = int(np.argmax(np.abs(found.error) / limits))
        allowed = f" for {share:.1%} of the messages" if share < 1.0 else ""
        self._fail(
            f"{quantity}: error {found.error[k]:+.4g} {found.unit} at {found.t_s[k]:.2f} s "
            f"({found.value[k]:.9g}, truth {found.truth[k]:.9g}); "
            f"limit +-{factor}{limits[k]:.4g} {found.unit}{allowed}; "
            f"{int(beyond.sum())} of {len(beyond)} valid messages are beyond"
        )

    # ----------------------------------------------------------------------------------------------------------- flags

    def assert_flag(
        self,
        flag: str | Condition,
        *,
        raised_within_s: float,
        cleared_within_s: float | None = None,
        fault: int | None = None,
        cause_s: tuple[float, float] | None = None,
    ) -> None:
        """A flag is raised in time after its cause begins, not before, and cleared in time after the cause ends.

        flag : a word in the ``flags`` or ``reasons`` of a message, or a condition: ``lambda row: not row["valid"]``
        raised_within_s, cleared_within_s : after begin and end of the cause; None : it may stay
        fault : the cause is this fault of the scenario, counted from 0; or cause_s : its begin and end
        """
        __tracebackhide__ = True
        begin_s, end_s = self._cause(fault, cause_s)
        spans, name = spans_of(self.times_s.tolist(), self.rows, flag), f"flag {show(flag)}"
        due_s = begin_s + raised_within_s
        raised = next((span for span in spans if span.from_s <= due_s and span.until_s > begin_s), None)
        if raised is None:
            later = [f"; it was raised at {span.from_s:.2f} s" for span in spans if span.from_s > due_s]
            remark = later[0] if later else "; it was never raised" if not spans else ""
            self._fail(f"{name}: not raised between {begin_s:.2f} s and {due_s:.2f} s{remark}")
        if raised.from_s < begin_s:
            self._fail(f"{name}: raised at {raised.from_s:.2f} s, before its cause at {begin_s:.2f} s")
        if cleared_within_s is None:
            return
        for span in spans:
            if span.until_s > end_s + cleared_within_s and span.from_s >= begin_s:
                end = "is not cleared" if span.until_s == float("inf") else f"is cleared at {span.until_s:.2f} s"
                self._fail(
                    f"{name}: raised at {span.from_s:.2f} s, {end}; its cause ended at {end_s:.2f} s, limit "
                    f"{cleared_within_s:g} s after it"
                )

    def assert_no_flag(self, flag: str | Condition) -> None:
        """A flag is never raised."""
        __tracebackhide__ = True
        self._assert_any(self.series)
        if spans := spans_of(self.times_s.tolist(), self.rows, flag):
            self._fail(f"flag {show(flag)}: raised at {spans[0].from_s:.2f} s; limit never")

    def _cause(self, fault: int | None, cause_s: tuple[float, float] | None) -> tuple[float, float]:
        if cause_s is not None:
            return cause_s
        if fault is None or not 0 <= fault < len(self._faults):
            raise ValueError(f"fault = {fault}: give cause_s, or one of the {len(self._faults)} faults from 0")
        one = self._faults[fault]
        return getattr(one, "from_s", 0.0), getattr(one, "to_s", self.until_s)

    # -------------------------------------------------------------------------------------------------------- failures

    def _assert_any(self, series: TopicSeries) -> None:
        __tracebackhide__ = True
        if not len(series):
            self._fail("no message")

    def _fail(self, text: str) -> NoReturn:
        __tracebackhide__ = True
        raise AssertionError(f"{self.name}, {self.from_s:g} to {self.until_s:g} s: {text}{self._failure_context}")
