"""Rows of topics, on their way to a file for each topic or to another sink."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from fti.logger.export.angles import AngleColumns
from fti.logger.export.columns import Column, Type, cell
from fti.logger.export.names import table_names
from fti.logger.export.row_spool import JsonRow
from fti.logger.export.selection import TimeWindow
from fti.logger.export.table_files import TableFiles

TIMES = (
    Column("log_time_ns", Type.INT, "ns", nullable=False),
    Column("publish_time_ns", Type.INT, "ns", nullable=False),
    Column("t_s", Type.FLOAT, "s", nullable=False),
    Column("utc", Type.UTC, nullable=False),
)


class Names:
    """Names of the files of topics."""

    def __init__(self, topics: Sequence[str]) -> None:
        self._names = table_names(topics)

    def of(self, topic: str) -> str:
        """The name of a topic, without suffix."""
        if topic not in self._names:
            self._names = table_names([*self._names, topic])
        return self._names[topic]


class Sink(Protocol):
    """Receives the rows of topics."""

    def open(self, topic: str, columns: Sequence[Column]) -> None:
        """Begin with a topic."""

    def write(self, topic: str, times: tuple[int, int], cells: Sequence[Any]) -> None:
        """Add a row.  times : log time and publish time [ns]"""


class TopicFiles:
    """A table for each topic."""

    def __init__(self, files: TableFiles, window: TimeWindow, names: Names) -> None:
        self._files, self._window, self._names = files, window, names

    def open(self, topic: str, columns: Sequence[Column]) -> None:
        """Begin a table."""
        self._files.open(self._names.of(topic), [*TIMES, *columns])

    def write(self, topic: str, times: tuple[int, int], cells: Sequence[Any]) -> None:
        """Add a row, if it is in the window."""
        t_s = self._window.seconds(times[0])
        if t_s is not None:
            self._files.write(self._names.of(topic), [*times, t_s, times[1], *cells])


class Tables:
    """The topics being exported.  columns : of each topic, without the times"""

    def __init__(self, sink: Sink, *, degrees: bool) -> None:
        self._sink, self._degrees = sink, degrees
        self._angles: dict[str, AngleColumns] = {}
        self.columns: dict[str, Sequence[Column]] = {}

    def open(self, topic: str, columns: Sequence[Column]) -> None:
        """Begin with a topic."""
        self.columns[topic] = columns
        if self._degrees:
            self._angles[topic] = AngleColumns(columns)
            columns = self._angles[topic].columns
        self._sink.open(topic, columns)

    def write(self, topic: str, times: tuple[int, int], cells: list[Any]) -> None:
        """Add a row."""
        if self._degrees:
            self._angles[topic].convert(cells)
        self._sink.write(topic, times, cells)

    def write_found(self, row: JsonRow) -> None:
        """Add the row of a message; cells that it does not have are unknown."""
        self.write(row.topic, row.times, [cell(row.cells.get(c.name), c.type) for c in self.columns[row.topic]])
