"""Records of changes on ``/fti/health`` and ``/fti/ledger``, with a complete record every ten seconds.

A record with ``complete`` true holds everything: the first one of a file, one every ten seconds, the final ledger of a
recorder.  A record with ``complete`` false follows the record of the same topic whose log time is ``since_ns``.  It
omits unchanged entries of ``links``, ``devices`` and ``processes``; only their ``age_ms`` has grown with the time.
Everything else is in every record.  ``fti.logger.reading.note_states`` restores the complete notes.

Changes of the age, and of estimates that are extrapolated without new messages, do not count.
"""

from __future__ import annotations

from typing import Any

from fti.messages.topics import HEALTH_TOPIC, LEDGER_TOPIC

#: The tables of each topic whose unchanged entries are omitted.
ENTRY_TABLES = {HEALTH_TOPIC: ("links", "devices", "processes"), LEDGER_TOPIC: ("links",)}
COMPLETE, SINCE, AGE, CLOCKS = "complete", "since_ns", "age_ms", "clocks"
#: Values of an entry and of its clocks that change without new messages.
VOLATILE_FIELDS = frozenset({AGE, "offset_ms", "offset_sd_ms", "drift_ppm", "drift_sd_ppm", "late_share"})
#: Period of complete records, and jitter of the records, which come about every second.
COMPLETE_PERIOD_NS = 10_000_000_000
JITTER_NS = 500_000_000
Table = dict[str, Any]


class NoteChanges:
    """Makes the records of the notes of one topic.  A recorded note must not be changed afterwards."""

    def __init__(self, topic: str) -> None:
        self._tables = ENTRY_TABLES[topic]
        self._file: object = None
        self._last_ns = 0
        self._complete_ns = 0
        self._entries: dict[str, Table] = {}

    def record_of(self, file: object, t_ns: int, note: Table) -> Table:
        """The record of a note.  file : the file to write it to; t_ns : its log time"""
        since_complete_ns = t_ns - self._complete_ns
        recent = 0 <= since_complete_ns < COMPLETE_PERIOD_NS - JITTER_NS
        if file is not self._file or not recent or note.get("final"):
            return {**note, COMPLETE: True}
        changed = {name: self._changed(name, note[name]) for name in self._tables if isinstance(note.get(name), dict)}
        return {**note, COMPLETE: False, SINCE: self._last_ns, **changed}

    def mark_recorded(self, file: object, t_ns: int, record: Table) -> None:
        """Note that the record is in the file; the next record holds the changes since then."""
        self._file, self._last_ns = file, t_ns
        if record[COMPLETE]:
            self._complete_ns = t_ns
            self._entries = {}
        for name in self._tables:
            if isinstance(record.get(name), dict):
                copies = {key: _copy(entry) for key, entry in record[name].items()}
                self._entries.setdefault(name, {}).update(copies)

    def _changed(self, name: str, now: Table) -> Table:
        before = self._entries.get(name, {})
        return {key: entry for key, entry in now.items() if key not in before or _is_changed(before[key], entry)}


def _copy(entry: Any) -> Any:
    """Copy of an entry for ``_is_changed``, which sets its age."""
    return dict(entry) if isinstance(entry, dict) and AGE in entry else entry


def _is_changed(before: Any, now: Any) -> bool:
    """Has an entry changed, apart from ``VOLATILE_FIELDS``?  before : from ``_copy``; its age is set to that of now

    With equal ages, most entries can be compared as a whole.  This runs for each link every second.
    """
    if not isinstance(before, dict) or not isinstance(now, dict):
        return bool(before != now)
    if AGE in before and AGE in now:
        before[AGE] = now[AGE]
    return before != now and not (CLOCKS in now and _same(before, now))


def _same(before: Any, now: Any) -> bool:
    """Are the values equal, apart from ``VOLATILE_FIELDS``?"""
    if isinstance(before, dict) and isinstance(now, dict):
        keys_are = before.keys() == now.keys()
        return keys_are and all(key in VOLATILE_FIELDS or _same(value, now[key]) for key, value in before.items())
    if isinstance(before, list | tuple) and isinstance(now, list | tuple):
        return len(before) == len(now) and all(map(_same, before, now))
    return bool(before == now)
