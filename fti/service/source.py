"""What the writer thread takes its frames from: a triple buffer, and how its frames go into the log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from fti.buffers.triple import TripleBuffer
from fti.burst import Burst, Entry, entries

GAP_TOPIC = "/fti/gap"
#: Topic, time [ns] and content of a note.
Tell = Callable[[str, int, dict[str, Any]], None]


@dataclass(slots=True)
class Source:
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
    keep: Callable[[Sequence[Entry]], None] | None = None
    recorded: int = 0
    unsynced: list[Burst] = field(default_factory=list)
    _in_flight: list[Burst] = field(default_factory=list)
    _again: list[Burst] = field(default_factory=list)

    @property
    def idle(self) -> bool:
        """Nothing waits to be written, neither in the buffer nor once more."""
        return self.buffer.empty and not self._again

    @property
    def unsafe(self) -> list[Burst]:
        """What a medium has taken that failed afterwards, and no other one has."""
        return self._again

    def pending(self) -> list[Burst]:
        """What is to be recorded now: what must be once more, and what the buffer hands out."""
        if self.buffer.empty:
            return self._again
        handed = self.buffer.take()
        if self.recorded or self._again:
            return self._again + handed[self.recorded :]
        return handed

    def mark_recorded(self, bursts: Sequence[Burst]) -> None:
        """All that was pending is in the log."""
        fresh = bursts[len(self._again) :]
        self._again = []
        self._in_flight += fresh
        self.recorded += len(fresh)

    def tell_gaps(self, tell: Tell, *, final: bool = False) -> None:
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
        self.buffer.written(self.recorded)
        self.recorded = 0

    def mark_synced(self) -> None:
        """What the file has taken is on the medium."""
        self.unsynced = []

    def restart(self, *, doubtful: bool) -> None:
        """What was recorded and not taken goes into another file; so does, if that is doubtful, what is not synced."""
        self.recorded = 0
        self._in_flight = []
        if not doubtful:
            self.unsynced = []
        self._again = list(self.unsynced)
