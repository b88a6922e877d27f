"""What the writer thread takes its entries from: a triple buffer, and how its entries go into the log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fti.buffers.triple import Entry, TripleBuffer


@dataclass(slots=True)
class Source:
    """A triple buffer and how its entries go into the log.

    recorded : of what the buffer hands out, so many are in the log already, and not yet on the medium
    """

    buffer: TripleBuffer
    record: Callable[[Entry], None]
    recorded: int = 0

    def record_all(self) -> None:
        """Record what the buffer hands out, each entry once, however often it is handed out."""
        for entry in self.buffer.take()[self.recorded :]:
            self.record(entry)
            self.recorded += 1

    def mark_written(self) -> None:
        """What was recorded is on the medium."""
        self.buffer.written(self.recorded)
        self.recorded = 0
