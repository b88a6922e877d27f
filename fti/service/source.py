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
    recorded : of what the buffer hands out, so many are in the log already, and not yet on the medium
    keep     : gets what is on the medium, each entry once
    """

    link: str
    buffer: TripleBuffer
    record: Callable[[Sequence[Entry]], None]
    recorded: int = 0
    keep: Callable[[Sequence[Entry]], None] | None = None
    _unkept: list[Entry] = field(default_factory=list)

    def record_all(self) -> None:
        """Record what the buffer hands out, each entry once, however often it is handed out."""
        if self.buffer.empty:
            return
        entries = self.buffer.take()[self.recorded :]
        if entries:
            self.record(entries)
            if self.keep:
                self._unkept += entries
            self.recorded += len(entries)

    def tell_gaps(self, tell: Tell, *, final: bool = False) -> None:
        """A note for each row of frames that the buffer had to drop, when it has ended or nothing follows."""
        for span in self.buffer.take_drops(final=final):
            content = {"t_ns": span.last_t_ns, "kind": "buffer_overflow", "link": self.link, **asdict(span)}
            tell(GAP_TOPIC, span.last_t_ns, content)

    def mark_written(self) -> None:
        """What was recorded is on the medium."""
        if self.recorded:
            if self.keep:
                self.keep(self._unkept)
                self._unkept.clear()
            self.buffer.written(self.recorded)
            self.recorded = 0

    def restart(self) -> None:
        """What was recorded and is not on the medium goes into another file: it is recorded again."""
        self._unkept.clear()
        self.recorded = 0
