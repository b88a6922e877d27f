"""One table on a common time grid: measurements, outputs and events.

A cell has the last sample at or before the time of its row, by the time of validity.  It is unknown where that sample
is invalid, or older than the maximum age.  Nothing is interpolated, so no angle is averaged across 360 degrees and no
state lies between two.  A message that carries only a part of its fields leaves the others unchanged.
"""

from __future__ import annotations

import dataclasses
import math
from array import array
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import structs

from fti.constants import SECOND_NS
from fti.errors import RecordingError
from fti.logger.derived_log import STREAM_FIELD
from fti.logger.export.columns import Column, Type
from fti.logger.export.units import class_of
from fti.logger.reading.limits import MAX_COLUMNS
from fti.messages.measurements import Ack, Calibration, DeviceTime, Ephemeris, Pseudoranges, Reading
from fti.messages.outputs import HeightAboveGround, NavSolution
from fti.messages.topics import EVENT_TOPIC, OUTPUT_CLASSES, OUTPUT_MAX_AGE_MS

NAME = "resampled"
#: Rows of a table: a day at 1000 Hz.
MAX_ROWS = 86_400_000
#: Rows that are composed at once.
CHUNK_ROWS = 4096
#: Maximum age where the configuration is not known [ns]: the default of the configuration.
MAX_AGE_NS = SECOND_NS
TIMES = (Column("t_s", Type.FLOAT, "s", nullable=False), Column("utc", Type.UTC, nullable=False))
EVENTS = Column("events", Type.TEXT)
#: Classes that are not samples of a signal, and columns: times, lists, and what identifies the signal.
NO_SIGNALS = frozenset({Ack, Calibration, DeviceTime, Ephemeris, Pseudoranges})
NO_SIGNAL_COLUMNS = frozenset({"t_ns", "t_valid_ns", "satellites", "unit", "source", *STREAM_FIELD.values()})
#: Fields of the navigation solution that ``attitude_valid`` declares valid.
ATTITUDE_FIELDS = frozenset({"roll", "pitch", "heading", "tilt_pl", "heading_pl"})
Ints = npt.NDArray[np.int64]


def has_signals(topic: str) -> bool:
    """Does the table have the messages of this topic: samples of signals, or events?"""
    kind = class_of(topic)
    return topic == EVENT_TOPIC or (kind is not None and kind not in NO_SIGNALS)


class Signal:
    """The samples of a column, at most one for each interval of the grid, and their times of validity."""

    def __init__(self, column: Column, max_age_ns: int) -> None:
        self.column, self._max_age_ns = column, max_age_ns
        self._times = array("q")
        self._values: Any = array("d") if column.type is Type.FLOAT else []
        self._interval = -1

    def add(self, interval: int, t_ns: int, value: Any) -> None:
        """Add a sample; it replaces an earlier one of the same interval of the grid.  value : None if unknown"""
        if value is None and self.column.type is Type.FLOAT:
            value = math.nan
        if interval == self._interval and t_ns >= self._times[-1]:
            self._times[-1], self._values[-1] = t_ns, value
        else:
            self._times.append(t_ns)
            self._values.append(value)
            self._interval = interval

    def at(self, grid_ns: Ints) -> Iterator[Any]:
        """The values at some times; None for unknown ones."""
        times, order = self._by_time
        index = np.searchsorted(times, grid_ns, side="right", sorter=order) - 1
        samples = order[np.maximum(index, 0)]
        are_known = (index >= 0) & (grid_ns - times[samples] <= self._max_age_ns)
        for sample, is_known in zip(samples.tolist(), are_known.tolist(), strict=True):
            value = self._values[sample]
            yield value if is_known and value == value else None  # noqa: PLR0124  NaN is unknown

    @cached_property
    def _by_time(self) -> tuple[Ints, Ints]:
        """The times, and the indices of the samples in their order; when all samples are there."""
        times = np.array(self._times)
        return times, np.argsort(times, kind="stable")


class _Fields:
    """The columns of a topic that are signals.

    validity : index of the column that declares a number valid, by the index of the number
    parts    : indices of the columns that a message may leave out
    """

    def __init__(self, kind: type, columns: Sequence[Column]) -> None:
        index = {column.name: n for n, column in enumerate(columns)}
        self.signals = [
            (n, column)
            for n, column in enumerate(columns)
            if column.name not in NO_SIGNAL_COLUMNS and not column.name.startswith("stamp.")
        ]
        self.stream = index.get(STREAM_FIELD.get(kind, ""))
        self.unit = index.get("unit") if kind is Reading else None
        self.validity = {}
        for n, column in self.signals:
            of_attitude = kind is NavSolution and column.name in ATTITUDE_FIELDS
            valid = index.get("attitude_valid" if of_attitude else "valid", index.get("valid"))
            if valid is not None and column.type in (Type.FLOAT, Type.INT):
                self.validity[n] = valid
        defaults = {field.name: field.default for field in structs.fields(kind)}
        is_partial = kind not in OUTPUT_CLASSES.values()
        self.parts = {n for n, c in self.signals if is_partial and defaults.get(c.name.partition(".")[0], 0) is None}

    def samples(self, cells: Sequence[Any]) -> Iterator[tuple[int, Column, Any]]:
        """The signals of which a row has a sample: None for unknown and invalid numbers."""
        has_numbers = any(cells[n] is not None for n in self.validity)
        for n, column in self.signals:
            is_invalid = n in self.validity and cells[self.validity[n]] is False
            if cells[n] is None and n in self.parts and (has_numbers or not is_invalid):
                continue
            yield n, column, None if is_invalid else cells[n]


class ResampledTable:
    """Collects the rows of topics and makes one table of them.

    rate_hz : rows in a second; they are at whole multiples of the period since 1970
    ages    : maximum age of the values of each device [ns]
    name_of : name of a topic in the columns
    """

    def __init__(self, rate_hz: float, ages: Mapping[str, int], name_of: Callable[[str], str]) -> None:
        self._period_ns = SECOND_NS / Fraction(str(rate_hz))
        self._ages, self._name_of = ages, name_of
        self._fields: dict[str, _Fields] = {}
        self._signals: dict[tuple[str, int, Any], Signal] = {}
        self._events: dict[int, list[str]] = defaultdict(list)
        self._event_text = self._last = 0

    def open(self, topic: str, columns: Sequence[Column]) -> None:
        """Begin with a topic that has signals, or events."""
        if topic == EVENT_TOPIC:
            self._event_text = next((n for n, column in enumerate(columns) if column.name == "message"), 0)
        elif kind := class_of(topic):
            self._fields[topic] = _Fields(kind, columns)

    def write(self, topic: str, times: tuple[int, int], cells: Sequence[Any]) -> None:
        """Add a row of a topic.  times : log time and publish time, the time of validity [ns]"""
        t_valid_ns = times[1]
        interval = self._interval(t_valid_ns)
        if topic == EVENT_TOPIC:
            self._events[interval].append(str(cells[self._event_text]))
            return
        fields = self._fields[topic]
        self._last = max(self._last, interval)
        stream = None if fields.stream is None else cells[fields.stream]
        for n, column, value in fields.samples(cells):
            key = topic, n, stream
            if key not in self._signals:
                unit = cells[fields.unit] if fields.unit is not None and column.unit == "unit" else column.unit
                self._signals[key] = self._begin(topic, stream, dataclasses.replace(column, unit=unit))
            self._signals[key].add(interval, t_valid_ns, value)

    def _interval(self, t_ns: int) -> int:
        """Number of the first row at or after a time."""
        return -(-t_ns * self._period_ns.denominator // self._period_ns.numerator)

    def _begin(self, topic: str, stream: str | None, column: Column) -> Signal:
        parts = [self._name_of(topic), *([] if stream is None else [stream]), column.name]
        device, kind = topic.split("/")[1], class_of(topic)
        max_age_ns = self._ages.get(device, MAX_AGE_NS)
        if kind is HeightAboveGround:
            max_age_ns = self._ages.get(topic.rpartition("/")[2], MAX_AGE_NS)
        elif kind in OUTPUT_CLASSES.values():
            max_age_ns = round(OUTPUT_MAX_AGE_MS * 1e6)
        return Signal(dataclasses.replace(column, name=".".join(parts)), max_age_ns)

    @property
    def columns(self) -> list[Column]:
        """The columns: times, events, signals."""
        return [*TIMES, EVENTS, *(signal.column for signal in self._signals.values())]

    def rows(self, start_ns: int, begin_s: float, end_s: float) -> Iterator[Sequence[Any]]:
        """The rows from begin_s to end_s after the start of the session, at most to the last sample.

        Raises RecordingError above a limit of rows or columns.
        """
        first = self._interval(start_ns + round(begin_s * SECOND_NS))
        last = self._last
        if math.isfinite(end_s):
            last = min(last, self._interval(start_ns + round(end_s * SECOND_NS) + 1) - 1)
        if last - first > MAX_ROWS or len(self._signals) > MAX_COLUMNS:
            size = f"{last - first} rows, {len(self._signals)} columns"
            raise RecordingError(f"--resample: the table would have {size}; at most {MAX_ROWS} and {MAX_COLUMNS}")
        for begin in range(first, last + 1, CHUNK_ROWS):
            numbers = range(begin, min(begin + CHUNK_ROWS, last + 1))
            grid = [math.floor(number * self._period_ns) for number in numbers]
            events = ("; ".join(self._events.get(number, ())) or None for number in numbers)
            times = [(t_ns - start_ns) / SECOND_NS for t_ns in grid]
            signals = [signal.at(np.array(grid)) for signal in self._signals.values()]
            yield from zip(times, grid, events, *signals, strict=True)
