"""A source of the writer thread: a triple buffer and the state of its frames in the log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from fti.buffers.triple_buffer import TripleBuffer
from fti.frame_batch import FrameBatch, NumberedFrame, iter_frames
from fti.messages.notes import GapRecord
from fti.messages.topics import note_message

#: Topic, time [ns] and content of a note.
RecordNote = Callable[[str, int, dict[str, Any]], None]


@dataclass(slots=True)
class LogSource:
    """A triple buffer and the state of its frames in the log.

    link           : link name in the notes about its gaps
    channel        : channel of the log; None: the frames go to ``on_written`` only
    on_written     : receives the frames that were written to the file, each once
    recorded_count : number of batches of the buffer that are in the log, but not yet written to the file
    unsynced       : batches that were written since the last sync
    """

    link: str
    channel: int | None
    buffer: TripleBuffer
    on_written: Callable[[Sequence[NumberedFrame]], None] | None = None
    recorded_count: int = 0
    unsynced: list[FrameBatch] = field(default_factory=list)
    _in_flight: list[FrameBatch] = field(default_factory=list)
    _to_rewrite: list[FrameBatch] = field(default_factory=list)

    @property
    def is_idle(self) -> bool:
        """No frames wait, neither in the buffer nor for rewriting."""
        return self.buffer.is_empty and not self._to_rewrite

    @property
    def possibly_lost(self) -> list[FrameBatch]:
        """Batches that were written to a medium that failed afterwards, and nowhere else yet."""
        return self._to_rewrite

    def pending(self) -> list[FrameBatch]:
        """The batches to record now: first those to rewrite, then those of the buffer."""
        if self.buffer.is_empty:
            return self._to_rewrite
        batches = self.buffer.take()
        if self.recorded_count or self._to_rewrite:
            return self._to_rewrite + batches[self.recorded_count :]
        return batches

    def mark_recorded(self, batches: Sequence[FrameBatch]) -> None:
        """All pending batches are in the log."""
        fresh = batches[len(self._to_rewrite) :]
        self._to_rewrite = []
        self._in_flight += fresh
        self.recorded_count += len(fresh)

    def record_gaps(self, record_note: RecordNote, *, final: bool = False) -> None:
        """Record a note for each run of dropped frames that has ended; final : also for the present one."""
        for span in self.buffer.take_drops(final=final):
            gap = GapRecord(t_ns=span.last_t_ns, kind="buffer_overflow", link=self.link, **asdict(span))
            record_note(*note_message(gap))

    def mark_written(self) -> None:
        """The recorded batches were written to the file."""
        if self.on_written:
            self.on_written(list(iter_frames(self._in_flight)))
        self.unsynced += self._in_flight
        self._in_flight = []
        self.buffer.confirm_written(self.recorded_count)
        self.recorded_count = 0

    def mark_synced(self) -> None:
        """The written batches are on the medium."""
        self.unsynced = []

    def restart(self, *, is_uncertain: bool) -> None:
        """Rewrite unwritten batches to another file; is_uncertain : the unsynced ones, too."""
        self.recorded_count = 0
        self._in_flight = []
        if not is_uncertain:
            self.unsynced = []
        self._to_rewrite = list(self.unsynced)
