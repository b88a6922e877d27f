"""Restores complete notes of ``/fti/health`` and ``/fti/ledger`` from records of changes."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from fti.logger.note_changes import AGE, COMPLETE, ENTRY_TABLES, SINCE
from fti.logger.reading.json_message import parse_json

Table = dict[str, Any]


class NoteState(NamedTuple):
    """A note.  whole : every entry is known; else the previous record is missing, and it has only its own entries"""

    log_time: int
    table: Table
    whole: bool


class NoteStates:
    """Receives the records of a session in the order of its files.

    Older sessions have only complete records, without the field ``complete``.  Tables may be shared between notes.
    """

    def __init__(self) -> None:
        self._last: dict[str, NoteState] = {}

    def feed(self, topic: str, log_time: int, record: Any) -> NoteState:
        """Restore the note of a record; for other topics the record itself."""
        if topic not in ENTRY_TABLES or not isinstance(record, dict):
            return NoteState(log_time, record, whole=True)
        before = self._last.get(topic)
        table = {key: value for key, value in record.items() if key not in (COMPLETE, SINCE)}
        whole = record.get(COMPLETE, True) is not False
        if not whole and before and before.whole and before.log_time == record.get(SINCE):
            whole = True
            for name in ENTRY_TABLES[topic]:
                table[name] = _merge_entries(
                    before.table.get(name), table.get(name), (log_time - before.log_time) / 1e6
                )
        self._last[topic] = NoteState(log_time, table, whole)
        return self._last[topic]

    def complete(self, topic: str, log_time: int, data: bytes) -> bytes:
        """Restore a note as JSON.  Raises ValueError when the data are not JSON."""
        if topic not in ENTRY_TABLES:
            return data
        return json.dumps(self.feed(topic, log_time, parse_json(data)).table).encode()


def _merge_entries(before: Any, changed: Any, passed_ms: float) -> Any:
    """The previous entries, with their new age, updated with the changed ones."""
    if not isinstance(before, dict) or not isinstance(changed, dict):
        return changed
    older = {key: _age_entry(entry, passed_ms) for key, entry in before.items() if key not in changed}
    return {key: older.get(key, changed.get(key)) for key in {**before, **changed}}


def _age_entry(entry: Any, passed_ms: float) -> Any:
    age_ms = entry.get(AGE) if isinstance(entry, dict) else None
    return {**entry, AGE: age_ms + passed_ms} if isinstance(age_ms, int | float) else entry
