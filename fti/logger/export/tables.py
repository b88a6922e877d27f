"""Export of a recording to one table per topic, or to one table on a common time grid.

Files are read twice, for the columns and for the rows.  Measurements come from the decoder of their frames, every one;
where there are no frames, and for a recording without, they are those of the derived files.  ``session.json`` in the
same folder identifies the session and marks a snapshot.
"""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path

from fti.errors import MissingError
from fti.logger.export.columns import Column, Type
from fti.logger.export.contents import Contents, find_contents, parse_item, read_items
from fti.logger.export.measurements import Decoded, MeasurementWriter
from fti.logger.export.recorded_measurements import RecordedMeasurements
from fti.logger.export.resampled import NAME, ResampledTable
from fti.logger.export.selection import ExportSelection, TimeWindow
from fti.logger.export.table_files import Format, TableFiles
from fti.logger.export.topic_tables import Names, Tables, TopicFiles
from fti.logger.note_changes import ENTRY_TABLES
from fti.logger.reading.note_states import NoteStates
from fti.logger.reading.recording import Recording
from fti.logger.reading.session_metadata import session_metadata
from fti.messages.topics import MEASUREMENT_CLASSES, measurement_topic

RAW_COLUMNS = (
    Column("seq", Type.INT, nullable=False),
    Column("t_rx_ns", Type.INT, "ns", nullable=False),
    Column("t_s", Type.FLOAT, "s", nullable=False),
    Column("utc", Type.UTC, nullable=False),
    Column("length", Type.INT, "B", nullable=False),
    Column("data", Type.BYTES, nullable=False),
)


def export(
    recording: Recording, folder: Path, table_format: Format, selection: ExportSelection, decoded: Decoded | None = None
) -> dict[Path, int]:
    """Write the tables; returns the rows of each file.

    decoded : None where the recorded measurements are to be written
    Raises MissingError when a pattern matches nothing, StorageError when a file exists or cannot be written, or when
    the folder has tables of another session.
    """
    devices = decoded.devices if decoded else {}
    kinds = {measurement_topic(device, kind): kind for device in devices for kind in MEASUREMENT_CLASSES.values()}
    contents = find_contents(recording, selection, kinds)
    topics = {*contents.tables, *contents.links, *contents.measured}
    _check_patterns(selection, topics, {*topics, *kinds})
    window = TimeWindow(contents.start_ns or 0, selection)
    names = Names(sorted(topics))
    with TableFiles(folder, table_format, session_metadata(recording)) as files:
        grid = ResampledTable(selection.resample_hz, devices, names.of) if selection.resample_hz else None
        tables = Tables(grid or TopicFiles(files, window, names), degrees=selection.degrees)
        for topic, (finder, _) in contents.tables.items():
            if selection.matches(topic):
                tables.open(topic, finder.columns())
        _write_messages(recording, tables, contents, window)
        if decoded:
            recorded = RecordedMeasurements(recording, contents.measured)
            MeasurementWriter(tables, selection, kinds).write(decoded, recorded, window)
        if grid:
            _write_grid(grid, files, window)
        links = {topic: names.of(topic) for topic in filter(selection.matches, contents.links)}
        if links:
            _write_frames(recording, links, files, window)
        _check_patterns(selection, topics, {*topics, *tables.columns})
    return files.rows


def _check_patterns(selection: ExportSelection, topics: set[str], possible: set[str]) -> None:
    for pattern in selection.topics:
        if not any(fnmatchcase(topic, pattern) for topic in possible):
            more = "" if selection.raw else " (with --raw also those of the links)"
            known = ", ".join(sorted(topics)) or "none"
            raise MissingError(f"--topic {pattern}: matches nothing; topics: {known}{more}")


def _write_messages(recording: Recording, tables: Tables, contents: Contents, window: TimeWindow) -> None:
    """Write the messages of the first reading only: the recording may have grown since."""
    left, states = {topic: count for topic, (_, count) in contents.tables.items()}, NoteStates()
    for item in read_items(recording):
        topic = item.topic.name
        if not left.get(topic) or topic not in tables.columns:
            continue
        left[topic] -= 1
        is_inside = window.seconds(item.log_time) is not None
        if is_inside or topic in ENTRY_TABLES:
            content = parse_item(item, states)
            if is_inside:
                tables.write_json(item, content)


def _write_grid(grid: ResampledTable, files: TableFiles, window: TimeWindow) -> None:
    files.open(NAME, grid.columns)
    for row in grid.rows(window.start_ns, window.begin_s, window.end_s):
        files.write(NAME, row)


def _write_frames(recording: Recording, names: Mapping[str, str], files: TableFiles, window: TimeWindow) -> None:
    """Write the frames of some links.  names : of their tables"""
    for name in names.values():
        files.open(name, RAW_COLUMNS)
    for seq, item in recording.numbered_messages():
        t_s = window.seconds(item.log_time)
        if t_s is not None and item.topic.name in names:
            row = (seq, item.log_time, t_s, item.log_time, len(item.data), item.data)
            files.write(names[item.topic.name], row)
