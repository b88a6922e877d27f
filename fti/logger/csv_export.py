"""Recorded topics as CSV: one file per derived topic, with a column for each field, and an index of the raw frames."""

from __future__ import annotations

import csv
import json
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from fti.errors import StorageError
from fti.logger.recording import Recording
from fti.types import TICK_LINK

TIMES = ("log_time_ns", "publish_time_ns")
RAW_COLUMNS = ("seq", "t_rx_ns", "length", "hex")


def flatten(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Columns of a JSON value: ``stamp.t_rx_ns``, ``accel_b.0``; texts in a list stand in one column, as ``a b``."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from flatten(item, f"{name}.{key}" if name else key)
    elif isinstance(value, list) and all(isinstance(item, str) for item in value):
        yield name, " ".join(value)
    elif isinstance(value, list) and not any(isinstance(item, dict | list) for item in value):
        for n, item in enumerate(value):
            yield f"{name}.{n}", item
    else:
        yield name, json.dumps(value) if isinstance(value, list) else value


def export_derived(recording: Recording, folder: Path) -> dict[Path, int]:
    """Write ``<topic>.csv`` for each JSON topic of the derived files; returns the rows of each file.

    Raises StorageError when a file exists already or cannot be written.
    """
    columns = _find_columns(recording)
    rows: dict[Path, int] = {}
    with ExitStack() as stack:
        writers = {}
        for topic, names in columns.items():
            path = folder / (topic.strip("/").replace("/", "_") + ".csv")
            writers[topic] = path, _open_table(stack, path, (*TIMES, *names))
            rows[path] = 0
        for topic, log_time, publish_time, _, data in recording.messages():
            path, table = writers[topic]
            cells = dict(flatten(json.loads(data)))
            table.writerow([log_time, publish_time, *(cells.get(name) for name in columns[topic])])
            rows[path] += 1
    return rows


def export_raw(recording: Recording, folder: Path) -> dict[Path, int]:
    """Write ``raw_<link>.csv`` for each link: number, time of arrival, length and bytes of each frame."""
    rows: dict[Path, int] = {}
    with ExitStack() as stack:
        tables: dict[str, Any] = {}
        for frame in recording.frames():
            if frame.link == TICK_LINK:
                continue
            path = folder / f"raw_{frame.link}.csv"
            if frame.link not in tables:
                tables[frame.link] = _open_table(stack, path, RAW_COLUMNS)
                rows[path] = 0
            tables[frame.link].writerow([frame.seq, frame.t_rx_ns, len(frame.data), frame.data.hex()])
            rows[path] += 1
    return rows


def _find_columns(recording: Recording) -> dict[str, list[str]]:
    """The columns of each topic, in order of appearance.  A list that was once null is not a column of its own."""
    found: dict[str, dict[str, None]] = defaultdict(dict)
    for topic, *_, data in recording.messages():
        found[topic].update(dict.fromkeys(name for name, _ in flatten(json.loads(data))))
    return {topic: [n for n in names if f"{n}.0" not in names] for topic, names in found.items()}


def _open_table(stack: ExitStack, path: Path, columns: tuple[str, ...]) -> Any:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        stream = stack.enter_context(path.open("x", newline="", encoding="utf-8"))
    except OSError as error:
        raise StorageError(f"{path}: cannot be written: {error.strerror}") from error
    table = csv.writer(stream)
    table.writerow(columns)
    return table
