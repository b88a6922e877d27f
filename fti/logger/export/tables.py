"""Export of a recording to one table per topic.  Files are read twice, for the columns and for the rows.

A table gets its name when it is complete.  Existing files are not overwritten.  ``session.json`` in the same folder
identifies the session and marks a snapshot.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

from fti.errors import MissingError, RecordingError, StorageError
from fti.logger.export import session_file
from fti.logger.export.columns import Column, ColumnFinder, Type, cell, flatten
from fti.logger.export.names import table_names
from fti.logger.note_changes import ENTRY_TABLES
from fti.logger.reading.json_message import parse_json
from fti.logger.reading.limits import MAX_COLUMNS, check_topic_count
from fti.logger.reading.mcap_file import McapMessage
from fti.logger.reading.note_states import NoteStates
from fti.logger.reading.recording import KINDS, Recording
from fti.logger.reading.session_metadata import session_metadata
from fti.messages.topics import RAW_PREFIX, SENT_PREFIX

SECOND_NS = 1_000_000_000
JSON = "json"
TIMES = (
    Column("log_time_ns", Type.INT, "ns"),
    Column("publish_time_ns", Type.INT, "ns"),
    Column("t_s", Type.FLOAT, "s"),
)
RAW_COLUMNS = (
    Column("seq", Type.INT),
    Column("t_rx_ns", Type.INT, "ns"),
    Column("t_s", Type.FLOAT, "s"),
    Column("length", Type.INT, "B"),
    Column("data", Type.BYTES),
)


class TableWriter(Protocol):
    """A table that is being written.  ``close`` completes it."""

    def write(self, row: Sequence[Any]) -> None:
        """Add a row, in the order of the columns."""

    def close(self) -> None:
        """Write the waiting rows and close the file."""


@dataclass(frozen=True, slots=True)
class Format:
    """A table format.  open : creates a writer from a path, columns and session metadata; raises OSError."""

    suffix: str
    open: Callable[[Path, Sequence[Column], Mapping[str, str]], TableWriter]


@dataclass(frozen=True, slots=True)
class ExportSelection:
    """Selection of topics that match one of the patterns (all without patterns), from begin_s to end_s [s after the
    first message of the session]; raw : also received and sent frames of the links.
    """

    topics: tuple[str, ...] = ()
    begin_s: float = 0.0
    end_s: float = float("inf")
    raw: bool = False

    def matches(self, topic: str) -> bool:
        """Does the topic match?"""
        return not self.topics or any(fnmatchcase(topic, pattern) for pattern in self.topics)


@dataclass(slots=True)
class _Contents:
    """Result of the first reading.  start_ns : time of the first message of all [ns]."""

    start_ns: int | None = None
    tables: dict[str, tuple[ColumnFinder, int]] = field(default_factory=dict)  # topic: columns, number of rows
    links: dict[str, int] = field(default_factory=dict)  # topic of a link: number of frames


def export(recording: Recording, folder: Path, table_format: Format, selection: ExportSelection) -> dict[Path, int]:
    """Write the tables; returns the rows of each file.

    Raises MissingError when a pattern matches nothing, StorageError when a file exists or cannot be written, or when
    the folder has tables of another session.
    """
    contents = _find_contents(recording, raw=selection.raw)
    _check_patterns(selection, contents)
    span = _TimeWindow(contents.start_ns or 0, selection)
    names = table_names(sorted((*contents.tables, *contents.links)))
    with _Tables(folder, table_format, session_metadata(recording), names) as tables:
        for topic, (finder, _) in contents.tables.items():
            if selection.matches(topic):
                tables.open(topic, (*TIMES, *finder.columns()))
        for topic in filter(selection.matches, contents.links):
            tables.open(topic, RAW_COLUMNS)
        _write_messages(recording, tables, contents, span)
        if any(selection.matches(topic) for topic in contents.links):
            _write_frames(recording, tables, span)
    return tables.rows


def _find_contents(recording: Recording, *, raw: bool) -> _Contents:
    contents, states = _Contents(), NoteStates()
    columns = 0
    for item in _items(recording):
        topic = item.topic.name
        contents.start_ns = min(contents.start_ns or item.log_time, item.log_time)
        if item.topic.encoding == JSON:
            finder, count = contents.tables.get(topic) or (ColumnFinder(topic), 0)
            columns += finder.add(_parse(item, states))
            contents.tables[topic] = finder, count + 1
            check_topic_count(len(contents.tables), recording.path)
            if columns > MAX_COLUMNS:
                text = f"with this topic the tables have more than {MAX_COLUMNS} columns"
                raise RecordingError(f"{recording.path}: {topic}: {text}")
        elif raw and topic.startswith((RAW_PREFIX, SENT_PREFIX)):
            contents.links[topic] = contents.links.get(topic, 0) + 1
    return contents


def _items(recording: Recording) -> Iterator[McapMessage]:
    """All messages, each once: with raw files, the notes and most frames of snapshots are copies."""
    for kind in KINDS:
        has_raw_files = kind == "snapshot" and bool(recording.raw_files)
        if not has_raw_files or recording.is_snapshot_session:
            yield from (item for item in recording.items(kind) if not (has_raw_files and item.topic.encoding == JSON))


def _parse(item: McapMessage, states: NoteStates) -> Any:
    """The content of a message; for a record of changes the complete note.  Raises RecordingError."""
    try:
        content = parse_json(item.data)
    except ValueError as error:
        raise RecordingError(f"{item.topic.name}: a message at {item.log_time} ns is not JSON: {error}") from None
    return states.feed(item.topic.name, item.log_time, content).table


def _check_patterns(selection: ExportSelection, contents: _Contents) -> None:
    topics = sorted((*contents.tables, *contents.links))
    for pattern in selection.topics:
        if not any(fnmatchcase(topic, pattern) for topic in topics):
            more = "" if selection.raw else " (with --raw also those of the links)"
            raise MissingError(f"--topic {pattern}: matches nothing; topics: {', '.join(topics) or 'none'}{more}")


class _TimeWindow:
    """The selected part of the session."""

    def __init__(self, start_ns: int, selection: ExportSelection) -> None:
        self._start_ns = start_ns
        self._begin_s, self._end_s = selection.begin_s, selection.end_s

    def seconds(self, t_ns: int) -> float | None:
        """Time since the start [s]; None outside."""
        t_s = (t_ns - self._start_ns) / SECOND_NS
        return t_s if self._begin_s <= t_s <= self._end_s else None


def _write_messages(recording: Recording, tables: _Tables, contents: _Contents, span: _TimeWindow) -> None:
    """Write the messages of the first reading only: the recording may have grown since."""
    left, states = {topic: count for topic, (_, count) in contents.tables.items()}, NoteStates()
    for item in _items(recording):
        topic = item.topic.name
        if not left.get(topic) or topic not in tables:
            continue
        left[topic] -= 1
        t_s = span.seconds(item.log_time)
        if t_s is None and topic not in ENTRY_TABLES:
            continue
        content = _parse(item, states)
        if t_s is not None:
            tables.write(topic, (item.log_time, item.publish_time, t_s), flatten(content))


def _write_frames(recording: Recording, tables: _Tables, span: _TimeWindow) -> None:
    for seq, item in recording.numbered_messages():
        t_s = span.seconds(item.log_time)
        if t_s is not None and item.topic.name in tables:
            tables.write(item.topic.name, (seq, item.log_time, t_s, len(item.data), item.data))


class _Tables:
    """The tables being written, as drafts in the target folder; an error removes all of them."""

    def __init__(
        self, folder: Path, table_format: Format, session_metadata: Mapping[str, str], names: Mapping[str, str]
    ) -> None:
        self._folder = folder
        self._names = names
        self._form = table_format
        self._session_metadata = session_metadata
        self._open: dict[str, tuple[Path, TableWriter, Sequence[Column]]] = {}
        self.rows: dict[Path, int] = {}

    def __enter__(self) -> _Tables:
        session_file.check(self._folder, self._session_metadata)
        return self

    def __contains__(self, topic: str) -> bool:
        return topic in self._open

    def open(self, topic: str, columns: Sequence[Column]) -> None:
        """Begin a table.  Raises StorageError."""
        path = self._folder / (self._names[topic] + self._form.suffix)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if path in self.rows or os.path.lexists(path):
                raise FileExistsError(None, "it exists already")
            self.rows[path] = 0  # from here on its draft is removed at the end
            self._open[topic] = path, self._form.open(_draft(path), columns, self._session_metadata), columns
        except OSError as error:
            raise _refusal(path, error) from error

    def write(self, topic: str, first: Sequence[Any], cells: dict[str, Any] | None = None) -> None:
        """Add a row: its first columns, and the others by name.  Raises StorageError."""
        path, writer, columns = self._open[topic]
        others = columns[len(first) :]
        try:
            writer.write([*first, *(cell(cells.get(c.name), c.type) for c in others)] if cells is not None else first)
        except OSError as error:
            raise _refusal(path, error) from error
        self.rows[path] += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            for path, writer, _ in self._open.values():
                _close_writer(path, writer, quietly=error is not None)
            if error is None:
                self._rename_drafts()
        finally:
            for path in self.rows:
                _draft(path).unlink(missing_ok=True)

    def _rename_drafts(self) -> None:
        """Write ``session.json``, then give the complete tables their names.  Raises StorageError."""
        try:
            if self.rows:
                session_file.write(self._folder, self._session_metadata)
            for path in self.rows:
                _draft(path).rename(path)
        except OSError as error:
            raise _refusal(self._folder, error) from error


def _draft(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def _close_writer(path: Path, writer: TableWriter, *, quietly: bool) -> None:
    try:
        writer.close()
    except OSError as error:
        if not quietly:
            raise _refusal(path, error) from error


def _refusal(path: Path, error: OSError) -> StorageError:
    return StorageError(f"{path}: cannot be written: {error.strerror or error}")
