"""What the writer thread takes its frames from: a triple buffer, and how its frames go into the log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from fti.buffers.triple_buffer import TripleBuffer
from fti.frame_batch import FrameBatch, NumberedFrame, entries

GAP_TOPIC = "/fti/gap"
#: Topic, time [ns] and content of a note.
RecordNote = Callable[[str, int, dict[str, Any]], None]


@dataclass(slots=True)
class LogSource:
    """A triple buffer and how its frames go into the log.

    link     : in whose name its gaps are told
    channel  : of the log; None when it is not for the log, and goes to ``keep`` alone
    keep     : gets what the file has taken, each frame once
    recorded : of the bursts that the buffer hands out, so many are in the log already, and the file has not taken them
    unsynced : what the file has taken since it was last brought onto the medium
    """

    link: str
    channel: int | None
    buffer: TripleBuffer
    keep: Callable[[Sequence[NumberedFrame]], None] | None = None
    recorded_count: int = 0
    unsynced: list[FrameBatch] = field(default_factory=list)
    _in_flight: list[FrameBatch] = field(default_factory=list)
    _to_rewrite: list[FrameBatch] = field(default_factory=list)

    @property
    def is_idle(self) -> bool:
        """Nothing waits to be written, neither in the buffer nor once more."""
        return self.buffer.empty and not self._to_rewrite

    @property
    def unsafe(self) -> list[FrameBatch]:
        """What a medium has taken that failed afterwards, and no other one has."""
        return self._to_rewrite

    def pending(self) -> list[FrameBatch]:
        """What is to be recorded now: what must be once more, and what the buffer hands out."""
        if self.buffer.empty:
            return self._to_rewrite
        handed = self.buffer.take()
        if self.recorded_count or self._to_rewrite:
            return self._to_rewrite + handed[self.recorded_count :]
        return handed

    def mark_recorded(self, bursts: Sequence[FrameBatch]) -> None:
        """All that was pending is in the log."""
        fresh = bursts[len(self._to_rewrite) :]
        self._to_rewrite = []
        self._in_flight += fresh
        self.recorded_count += len(fresh)

    def record_gaps(self, tell: RecordNote, *, final: bool = False) -> None:
        """A note for each row of frames that the buffer had to drop, when it has ended or nothing follows."""
        for span in self.buffer.take_drops(final=final):
            content = {"t_ns": span.last_t_ns, "kind": "buffer_overflow", "link": self.link, **asdict(span)}
            tell(GAP_TOPIC, span.last_t_ns, content)

    def mark_written(self) -> None:
        """The file has taken what was recorded."""
        if self.keep:
            self.keep(list(entries(self._in_flight)))
        self.unsynced += self._in_flight
        self._in_flight = []
        self.buffer.confirm_written(self.recorded_count)
        self.recorded_count = 0

    def mark_synced(self) -> None:
        """What the file has taken is on the medium."""
        self.unsynced = []

    def restart(self, *, doubtful: bool) -> None:
        """What was recorded and not taken goes into another file; so does, if that is doubtful, what is not synced."""
        self.recorded_count = 0
        self._in_flight = []
        if not doubtful:
            self.unsynced = []
        self._to_rewrite = list(self.unsynced)
