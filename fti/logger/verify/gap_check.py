"""Check of the notes of gaps: frames dropped by full buffers, and frames missed by navigation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from fti.logger.reading.json_message import parse_table
from fti.logger.reading.limits import MAX_TEXT_LENGTH
from fti.logger.reading.number_ranges import SequenceRange
from fti.logger.reading.text_format import clock_text

OVERFLOW = "buffer_overflow"
MAX_DESCRIBED_NOTES = 20


@dataclass(frozen=True, slots=True)
class Overflow:
    """Frames of one link that a full buffer dropped, from a note of the recorder."""

    link: str
    first: int
    last: int
    frames: int


@dataclass(slots=True)
class GapNotes:
    """The notes on ``/fti/gap``.

    descriptions : texts of the first notes of navigation; omitted_notes : number of further ones
    unreadable   : number of notes that cannot be read
    """

    overflows: list[Overflow] = field(default_factory=list)
    descriptions: list[str] = field(default_factory=list)
    omitted_notes: int = 0
    unreadable: int = 0

    def feed(self, t_ns: int, data: bytes, *, raw: bool) -> None:
        """Add a note from a raw or a derived file."""
        try:
            table = parse_table(data)
            if raw and table.get("kind") == OVERFLOW:
                numbers = (int(table[key]) for key in ("first_seq", "last_seq", "frames"))
                self.overflows.append(Overflow(str(table["link"])[:MAX_TEXT_LENGTH], *numbers))
            else:
                self._describe(f"{clock_text(t_ns)}: {table.get('text') or _unseen_text(table)}")
        except (KeyError, TypeError, AttributeError, ValueError, OverflowError, RecursionError):
            self.unreadable += 1

    def _describe(self, text: str) -> None:
        if len(self.descriptions) < MAX_DESCRIBED_NOTES:
            self.descriptions.append(text[:MAX_TEXT_LENGTH])
        else:
            self.omitted_notes += 1

    def explains(self, span: SequenceRange) -> bool:
        """Does a note cover these numbers?"""
        return any(gap.first <= span.first and span.last <= gap.last for gap in self.overflows)


def _unseen_text(table: dict[str, Any]) -> str:
    """A note of navigation in words."""
    first, last = int(table["after_seq"]) + 1, int(table["before_seq"]) - 1
    missed = f"numbers {first} to {last}" if first <= last else "nothing"
    return f"{table['kind']}: navigation has missed {missed}"
