"""The messages of a recording for its tables: each once, their rows, and the columns of each topic."""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from typing import Any

from fti.errors import RecordingError
from fti.logger.export.columns import ColumnFinder, flatten
from fti.logger.export.row_spool import JsonRow, RowSpool
from fti.logger.export.selection import ExportSelection
from fti.logger.reading.event_copies import EventCopies
from fti.logger.reading.json_message import parse_json
from fti.logger.reading.limits import MAX_COLUMNS, check_topic_count
from fti.logger.reading.mcap_file import McapMessage
from fti.logger.reading.note_states import NoteStates
from fti.logger.reading.recording import KINDS, Recording
from fti.messages.topics import RAW_PREFIX, SENT_PREFIX

JSON = "json"


@dataclass(slots=True)
class Contents:
    """Result of reading the messages.

    start_ns : time of the first message of all [ns]
    tables   : columns, by topic;  links : topics of frames
    measured : time of the last recorded measurement [ns], by topic, of the devices whose frames are decoded
    """

    start_ns: int | None = None
    tables: dict[str, ColumnFinder] = field(default_factory=dict)
    links: set[str] = field(default_factory=set)
    measured: dict[str, int] = field(default_factory=dict)


def find_contents(
    recording: Recording, selection: ExportSelection, measured: Container[str], rows: RowSpool
) -> Contents:
    """Read all messages.

    measured : topics of measurements that are decoded from frames;  rows : gets those of the selected other topics
    """
    contents, states = Contents(), NoteStates()
    columns = 0
    for item in read_items(recording):
        topic = item.topic.name
        contents.start_ns = min(contents.start_ns or item.log_time, item.log_time)
        if item.topic.encoding == JSON and topic in measured:
            contents.measured[topic] = max(contents.measured.get(topic, 0), item.log_time)
        elif item.topic.encoding == JSON:
            finder = contents.tables.setdefault(topic, ColumnFinder(topic))
            if selection.matches(topic):
                cells = flatten(parse_item(item, states))
                columns += finder.add(cells)
                rows.add(JsonRow(topic, (item.log_time, item.publish_time), cells))
            check_topic_count(len(contents.tables), recording.path)
            if columns > MAX_COLUMNS:
                text = f"with this topic the tables have more than {MAX_COLUMNS} columns"
                raise RecordingError(f"{recording.path}: {topic}: {text}")
        elif selection.raw and topic.startswith((RAW_PREFIX, SENT_PREFIX)):
            contents.links.add(topic)
    return contents


def read_items(recording: Recording) -> Iterator[McapMessage]:
    """All messages, each once: with raw files, the notes and most frames of snapshots are copies, and so are the events
    of navigation in derived files.
    """
    events = EventCopies()
    for kind in KINDS:
        has_raw_files = kind == "snapshot" and bool(recording.raw_files)
        if has_raw_files and not recording.is_snapshot_session:
            continue
        for item in recording.items(kind):
            if has_raw_files and item.topic.encoding == JSON:
                continue
            if not events.is_copy(kind, item):
                yield item


def parse_item(item: McapMessage, states: NoteStates) -> Any:
    """The content of a message; for a record of changes the complete note.  Raises RecordingError."""
    try:
        content = parse_json(item.data)
    except ValueError as error:
        raise RecordingError(f"{item.topic.name}: a message at {item.log_time} ns is not JSON: {error}") from None
    return states.feed(item.topic.name, item.log_time, content).table
