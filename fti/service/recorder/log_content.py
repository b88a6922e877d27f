"""What the recorder writes: the log, its sources and its notes."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

from fti.logger.log_segment import LogSegment
from fti.logger.raw_log import RawLog
from fti.messages.topics import ALARM_TOPIC, EVENT_TOPIC, GAP_TOPIC
from fti.service.fault_guard import FailureHandler, catch_failures
from fti.service.recorder.log_source import LogSource

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


class LogContent:
    """The log, and the frames and notes for it.  Only ``notes.add`` is for any thread: the writer locks the rest.

    has_unwritten : data are recorded that the medium has not accepted yet
    """

    def __init__(self, log: RawLog, sources: Sequence[LogSource], report: FailureHandler) -> None:
        self.log, self.sources = log, sources
        self.notes = NoteQueue(report)
        self.has_unwritten = False

    def is_idle(self) -> bool:
        """No frames wait, neither in a buffer nor for rewriting."""
        return all(source.is_idle for source in self.sources)

    def record(self) -> None:
        """Record the pending frames and notes."""
        pending = [(source, batches) for source in self.sources if (batches := source.pending())]
        self.log.write_batches([(source.channel, batches) for source, batches in pending if source.channel is not None])
        for source, batches in pending:
            source.mark_recorded(batches)
            source.record_gaps(self.notes.add)
        self.notes.record_all(self.log)
        self.has_unwritten = True

    def mark_written(self) -> None:
        """The recorded data are in the file."""
        for source in self.sources:
            if source.recorded_count:
                source.mark_written()
        self.notes.mark_written()
        self.has_unwritten = False

    def mark_synced(self) -> None:
        """The written frames are on the medium."""
        for source in self.sources:
            source.mark_synced()

    def restart(self, segment: LogSegment | None, *, is_uncertain: bool) -> None:
        """Record again what is in no file, in another segment (None: not open yet).

        is_uncertain : unsynced frames of the last file may be lost, so they are recorded again, too
        """
        if segment:
            self.log.switch_to(segment)
        for source in self.sources:
            source.restart(is_uncertain=is_uncertain)
        self.notes.restart()
        self.has_unwritten = False
