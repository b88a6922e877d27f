"""Notes that wait for the log: ledger, clocks, health and events."""

from __future__ import annotations

from collections import deque
from typing import Any

from fti.logger.raw_log import RawLog
from fti.service.guard import Report, guarded

#: What happened and what was lost is kept longest.
KEPT_TOPICS = ("/fti/event", "/fti/alarm", "/fti/gap")
#: While no medium takes them, so many events wait, and so many other notes; then the oldest go.
MOST_EVENTS = 10_000
MOST_OTHERS = 1_000
Note = tuple[str, int, dict[str, Any]]


class Notes:
    """Each note is recorded once, in the file that was accepted with it.  ``add`` is for any thread."""

    def __init__(self, report: Report) -> None:
        self._report = report
        self._events: deque[Note] = deque(maxlen=MOST_EVENTS)
        self._others: deque[Note] = deque(maxlen=MOST_OTHERS)
        self._recorded: list[Note] = []

    def add(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        """Keep a note."""
        self._queue(topic).append((topic, t_ns, content))

    def _queue(self, topic: str) -> deque[Note]:
        return self._events if topic in KEPT_TOPICS else self._others

    def record_all(self, log: RawLog) -> None:
        """Record what waits; a note that cannot be recorded is reported and spoils nothing else."""
        for waiting in (self._events, self._others):
            while waiting:
                note = waiting.popleft()
                with guarded("note", self._report):
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
