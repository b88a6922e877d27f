"""Queue of the notes for the log: ledger, clocks, health and events."""

from __future__ import annotations

from collections import deque
from typing import Any

from fti.logger.raw_log import RawLog
from fti.messages.topics import ALARM_TOPIC, EVENT_TOPIC, GAP_TOPIC
from fti.service.fault_guard import FailureHandler, catch_failures

#: Events and losses are queued longest.
EVENT_TOPICS = (EVENT_TOPIC, ALARM_TOPIC, GAP_TOPIC)
#: Maximum number of queued events and of other notes while no medium works; then the oldest are dropped.
MAX_EVENTS = 10_000
MAX_OTHER_NOTES = 1_000
QueuedNote = tuple[str, int, dict[str, Any]]


class NoteQueue:
    """Notes for the log; each is written to exactly one file.  ``add`` may be called from any thread."""

    def __init__(self, report: FailureHandler) -> None:
        self._report = report
        self._events: deque[QueuedNote] = deque(maxlen=MAX_EVENTS)
        self._others: deque[QueuedNote] = deque(maxlen=MAX_OTHER_NOTES)
        self._recorded: list[QueuedNote] = []

    def add(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        """Queue a note."""
        self._queue(topic).append((topic, t_ns, content))

    def _queue(self, topic: str) -> deque[QueuedNote]:
        return self._events if topic in EVENT_TOPICS else self._others

    def record_all(self, log: RawLog) -> None:
        """Record the queued notes; a note that cannot be recorded is reported and skipped."""
        for waiting in (self._events, self._others):
            while waiting:
                note = waiting.popleft()
                with catch_failures("note", self._report):
                    log.write_json(*note)
                    self._recorded.append(note)

    def mark_written(self) -> None:
        """The recorded notes are in the file."""
        self._recorded.clear()

    def restart(self) -> None:
        """Queue recorded notes that are in no file again, before the waiting ones."""
        recorded, self._recorded = self._recorded, []
        for note in reversed(recorded):
            self._queue(note[0]).appendleft(note)
