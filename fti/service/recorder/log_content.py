"""What the recorder writes: the log, its sources and its notes."""

from __future__ import annotations

from collections.abc import Sequence

from fti.logger.log_segment import LogSegment
from fti.logger.raw_log import RawLog
from fti.service.fault_guard import FailureHandler
from fti.service.recorder.log_source import LogSource
from fti.service.recorder.note_queue import NoteQueue


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
