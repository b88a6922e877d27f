"""Export of a recording to one table per topic, or to one table on a common time grid.

The messages are read once; their rows wait in a temporary file until the columns are known.  Measurements come from the
decoder of their frames, every one; where there are no frames, and for a recording without, they are those of the
derived files.  ``session.json`` in the same folder identifies the session and marks a snapshot.
"""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path

from fti.errors import MissingError
from fti.logger.export.columns import Column, Type
from fti.logger.export.contents import find_contents
from fti.logger.export.measurements import Decoded, MeasurementWriter
from fti.logger.export.recorded_measurements import RecordedMeasurements
from fti.logger.export.resampled import NAME, ResampledTable
from fti.logger.export.row_spool import RowSpool
from fti.logger.export.selection import ExportSelection, TimeWindow
from fti.logger.export.table_files import Format, TableFiles
from fti.logger.export.topic_tables import Names, Tables, TopicFiles
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
    with (
        RowSpool(folder) as rows,
        TableFiles(folder, table_format, session_metadata(recording)) as files,
    ):
        contents = find_contents(recording, selection, kinds, rows)
        topics = {*contents.tables, *contents.links, *contents.measured}
        _check_patterns(selection, topics, {*topics, *kinds})
        window = TimeWindow(contents.start_ns or 0, selection)
        names = Names(sorted(topics))
        grid = ResampledTable(selection.resample_hz, devices, names.of) if selection.resample_hz else None
        tables = Tables(grid or TopicFiles(files, window, names), degrees=selection.degrees)
        for topic in filter(selection.matches, contents.tables):
            tables.open(topic, contents.tables[topic].columns())
        for row in rows.rows():
            if window.seconds(row.times[0]) is not None:
                tables.write_found(row)
        if decoded:
            recorded = RecordedMeasurements(recording, contents.measured)
            MeasurementWriter(tables, selection, kinds).write(decoded, recorded, window)
        if grid:
            _write_grid(grid, files, window)
        links = {topic: names.of(topic) for topic in filter(selection.matches, sorted(contents.links))}
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
