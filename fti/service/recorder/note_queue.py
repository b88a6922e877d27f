"""Notes that wait for the log: ledger, clocks, health and events."""

from __future__ import annotations

from collections import deque
from typing import Any

from fti.logger.raw_log import RawLog
from fti.service.fault_guard import FailureHandler, catch_failures

#: What happened and what was lost is kept longest.
KEPT_TOPICS = ("/fti/event", "/fti/alarm", "/fti/gap")
#: While no medium takes them, so many events wait, and so many other notes; then the oldest go.
MAX_EVENTS = 10_000
MAX_OTHER_NOTES = 1_000
QueuedNote = tuple[str, int, dict[str, Any]]


class NoteQueue:
    """Each note is recorded once, in the file that was accepted with it.  ``add`` is for any thread."""

    def __init__(self, report: FailureHandler) -> None:
        self._report = report
        self._events: deque[QueuedNote] = deque(maxlen=MAX_EVENTS)
        self._others: deque[QueuedNote] = deque(maxlen=MAX_OTHER_NOTES)
        self._recorded: list[QueuedNote] = []

    def add(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        """Keep a note."""
        self._queue(topic).append((topic, t_ns, content))

    def _queue(self, topic: str) -> deque[QueuedNote]:
        return self._events if topic in KEPT_TOPICS else self._others

    def record_all(self, log: RawLog) -> None:
        """Record what waits; a note that cannot be recorded is reported and spoils nothing else."""
        for waiting in (self._events, self._others):
            while waiting:
                note = waiting.popleft()
                with catch_failures("note", self._report):
                    log.json(*note)
                    self._recorded.append(note)

    def mark_written(self) -> None:
        """What was recorded is in the file."""
        self._recorded.clear()

    def restart(self) -> None:
        """What was recorded and is in no file is recorded again, in another one, before what waits."""
        recorded, self._recorded = self._recorded, []
        for note in reversed(recorded):
            self._queue(note[0]).appendleft(note)
