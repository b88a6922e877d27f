"""What the writer thread takes its entries from: a triple buffer, and how its entries go into the log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from fti.buffers.triple import Entry, TripleBuffer

GAP_TOPIC = "/fti/gap"
#: Topic, time [ns] and content of a note.
Tell = Callable[[str, int, dict[str, Any]], None]


@dataclass(slots=True)
class Source:
    """A triple buffer and how its entries go into the log.

    link     : in whose name its gaps are told
    recorded : of what the buffer hands out, so many are in the log already, and the file has not taken them yet
    keep     : gets what the file has taken, each entry once
    unsynced : what the file has taken since it was last brought onto the medium
    """

    link: str
    buffer: TripleBuffer
    record: Callable[[Sequence[Entry]], None]
    recorded: int = 0
    keep: Callable[[Sequence[Entry]], None] | None = None
    unsynced: list[Sequence[Entry]] = field(default_factory=list)
    _in_flight: list[Sequence[Entry]] = field(default_factory=list)
    _again: list[Sequence[Entry]] = field(default_factory=list)

    def record_all(self) -> bool:
        """Record what the buffer hands out, each entry once, however often it is handed out; False when it is empty."""
        while self._again:
            self.record(self._again.pop(0))
        if self.buffer.empty:
            return False
        entries = self.buffer.take()[self.recorded :]
        if entries:
            self.record(entries)
            self._in_flight.append(entries)
            self.recorded += len(entries)
        return True

    def tell_gaps(self, tell: Tell, *, final: bool = False) -> None:
        """A note for each row of frames that the buffer had to drop, when it has ended or nothing follows."""
        for span in self.buffer.take_drops(final=final):
            content = {"t_ns": span.last_t_ns, "kind": "buffer_overflow", "link": self.link, **asdict(span)}
            tell(GAP_TOPIC, span.last_t_ns, content)

    def mark_written(self) -> None:
        """The file has taken what was recorded."""
        if self.recorded:
            if self.keep:
                for entries in self._in_flight:
                    self.keep(entries)
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
