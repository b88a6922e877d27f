"""Changes of the messages of a session: which topics, which time of the flight, what becomes of each message."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import orjson

from fti.logger.note_changes import ENTRY_TABLES, NoteChanges
from fti.logger.reading.mcap_file import McapMessage
from fti.logger.reading.note_states import NoteStates
from tests.post.score.sabotage.session_copy import SECOND_NS, Kind, LogFile, Session

Table = dict[str, Any]
#: What becomes of a message: none, itself, or others in its place.
ItemEdit = Callable[[McapMessage], Iterable[McapMessage]]
#: Changes the content of a message in place.  The second argument is its log time [s of the flight].
TableEdit = Callable[[Table, float], None]
NUMBERED = ("/raw/", "/tx/", "/fti/tick")


class Forgery:
    """A copy of a session whose messages are changed.  is_changed : does any file differ from the session?"""

    def __init__(self, session: Session) -> None:
        self.original = session
        self.session = session.copy()

    @property
    def is_changed(self) -> bool:
        """Does anything differ?"""
        return any(file.changed for files in self.session.files.values() for file in files)

    # ------------------------------------------------------------------------------------------------ messages

    def edit(self, kind: Kind, topics: Sequence[str], change: ItemEdit) -> None:
        """Replace each message of these topics by what ``change`` makes of it; the others keep their places."""
        wanted = set(topics)
        for file in self.session.files[kind]:
            items: list[McapMessage] = []
            for item in file.items:
                if item.topic.name in wanted:
                    items.extend(change(item))
                else:
                    items.append(item)
            _store(file, items)

    def rearrange(self, kind: Kind, topic: str, arrange: Callable[[list[McapMessage]], list[McapMessage]]) -> None:
        """Replace all messages of a topic; they then stand in the order of their log times among the others."""
        for file in self.session.files[kind]:
            own = [item for item in file.items if item.topic.name == topic]
            others = [item for item in file.items if item.topic.name != topic]
            arranged = arrange(own)
            if arranged != own:
                _store(file, _merged(others, arranged))

    def edit_tables(self, kind: Kind, topics: Sequence[str], change: TableEdit) -> None:
        """Change the JSON content of each message of these topics."""

        def changed(item: McapMessage) -> Iterable[McapMessage]:
            table = orjson.loads(item.data)
            change(table, self.session.seconds(item.log_time))
            data = orjson.dumps(table)
            return [item if data == item.data else item._replace(data=data)]

        self.edit(kind, topics, changed)

    def edit_notes(self, topic: str, change: TableEdit) -> None:
        """Change the complete notes of ``/fti/health`` or ``/fti/ledger``; they are stored as changes again."""
        states = NoteStates()
        for file in self.session.files["raw"]:
            writer = _NoteWriter(topic, file)
            file_items = []
            for item in file.items:
                if item.topic.name != topic:
                    file_items.append(item)
                    continue
                table = orjson.loads(states.complete(topic, item.log_time, item.data))
                change(table, self.session.seconds(item.log_time))
                file_items.append(item._replace(data=writer.record(item.log_time, table)))
            if [item.data for item in file_items] != [item.data for item in file.items]:
                _store(file, file_items)

    def renumber(self) -> None:
        """Number frames and ticks without gaps, in the order of their numbers."""
        items = [item for item in self.session.items("raw") if item.topic.name.startswith(NUMBERED)]
        numbers = {old: new for new, old in enumerate(sorted({item.sequence for item in items}))}
        topics = sorted({item.topic.name for item in items})
        self.edit("raw", topics, lambda item: [item._replace(sequence=numbers[item.sequence])])

    # ------------------------------------------------------------------------------------- metadata, attachments

    def set_metadata(self, name: str, key: str, text: str | None) -> None:
        """Set an entry of a metadata table in the raw and derived files; None removes it."""
        for kind in ("raw", "derived"):
            for file in self.session.files[kind]:
                table = file.metadata.get(name, {})
                before = dict(table)
                table.pop(key, None)
                if text is not None:
                    table[key] = text
                file.changed |= before != table

    def edit_attachment(self, name: str, change: Callable[[str], str]) -> None:
        """Change a text that is attached to the raw and derived files."""
        for kind in ("raw", "derived"):
            for file in self.session.files[kind]:
                if name in file.attachments:
                    text = file.attachments[name].decode()
                    changed = change(text)
                    file.attachments[name] = changed.encode()
                    file.changed |= changed != text


class _NoteWriter:
    """Stores notes as the recorder does: what has changed, and everything every ten seconds."""

    def __init__(self, topic: str, file: LogFile) -> None:
        self._changes = NoteChanges(topic)
        self._file = file
        assert topic in ENTRY_TABLES

    def record(self, t_ns: int, note: Table) -> bytes:
        """The record of a note."""
        record = self._changes.record_of(self._file, t_ns, note)
        self._changes.mark_recorded(self._file, t_ns, record)
        return orjson.dumps(record)


def _store(file: LogFile, items: list[McapMessage]) -> None:
    """Give a file these messages; it is changed when one of them is another."""
    if len(items) != len(file.items) or any(new is not old for new, old in zip(items, file.items, strict=True)):
        file.items, file.changed = items, True


def _merged(others: list[McapMessage], own: list[McapMessage]) -> list[McapMessage]:
    """The others in their order, each of ours before the first of them that is later."""
    merged: list[McapMessage] = []
    at = 0
    for item in others:
        while at < len(own) and own[at].log_time < item.log_time:
            merged.append(own[at])
            at += 1
        merged.append(item)
    return merged + own[at:]


# ------------------------------------------------------------------------------------------------- what topics hold


def valid_values(session: Session, topic: str) -> dict[str, list[float]]:
    """Field -> the numbers that a topic states in valid messages.  ``/nav/location`` has no validity: all count."""
    values: dict[str, list[float]] = defaultdict(list)
    for table in tables(session, topic):
        if table.get("valid", True):
            for name, value in table.items():
                if isinstance(value, float):
                    values[name].append(value)
    return values


def tables(session: Session, topic: str, kind: Kind = "derived") -> list[Table]:
    """The JSON content of all messages of a topic during the flight."""
    messages = [item for item in session.items(kind) if item.topic.name == topic]
    return [orjson.loads(item.data) for item in messages if item.log_time >= session.begin_ns]


def shift_times(item: McapMessage, by_s: float, names: Iterable[str] = ("t_ns", "t_valid_ns")) -> bytes:
    """The content of a message with these times later by so much [s]."""
    table = orjson.loads(item.data)
    by_ns = round(by_s * SECOND_NS)
    for name in names:
        if table.get(name) is not None:
            table[name] += by_ns
    if "timestamp" in table and "t_ns" in names:
        total = table["timestamp"]["sec"] * SECOND_NS + table["timestamp"]["nsec"] + by_ns
        table["timestamp"] = {"sec": total // SECOND_NS, "nsec": total % SECOND_NS}
    return orjson.dumps(table)
