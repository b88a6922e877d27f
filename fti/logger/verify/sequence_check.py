"""Check of the sequence numbers of a session: missing and duplicate numbers, and order and times of each topic.

Every received frame, tick and sent frame has a number from one counter.  Links are written one after another: numbers
are out of order in the files, but increase within a topic.  Memory: a range of numbers for each hole, and the numbers
of each topic since the last compared ledger.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise

from fti.logger.reading.mcap_file import McapChannel
from fti.logger.reading.number_ranges import Coverage
from fti.logger.reading.recording import unwrap
from fti.logger.records import MESSAGE, MESSAGE_BODY
from fti.logger.verify.file_check import MessageRow, Page
from fti.messages.frames import TICK_PERIOD_NS
from fti.messages.topics import RAW_PREFIX, SENT_PREFIX, TICK_TOPIC

#: Error of a kernel timestamp: two clock readings convert it to FTI time, and the reader may be interrupted between.
STAMP_TOLERANCE_NS = 1_000_000
#: Without a tick for this time, the recorder did not run [ns].
TICK_HOLE_NS = 25 * TICK_PERIOD_NS
#: Frames of a topic that are kept for its next ledger.
MAX_KEPT_NUMBERS = 2**20
_ERROR_FLAG, _FLAGS_AT = 0x20, MESSAGE.size + 3  # byte 3 of a CAN frame: see ``fti.canframe``


def is_numbered(topic: str) -> bool:
    """Do the messages of a topic have sequence numbers?"""
    return topic == TICK_TOPIC or topic.startswith((RAW_PREFIX, SENT_PREFIX))


@dataclass(slots=True)
class TopicSequence:
    """One numbered topic.

    backwards : number of steps back in time; unordered : number of decreasing numbers; error_frames : of a CAN bus
    """

    name: str
    is_can: bool
    frames: int = 0
    bytes: int = 0
    first_ns: int = 0
    last_ns: int = 0
    last_seq: int = -1
    longest_gap_ns: int = 0
    backwards: int = 0
    unordered: int = 0
    error_frames: int = 0
    _seqs: array[int] = field(default_factory=lambda: array("Q"))
    _sizes: array[int] = field(default_factory=lambda: array("Q"))
    _below: tuple[int, int] = (0, 0)  # frames and bytes below ``_folded_to``
    _folded_to: int = 0

    def feed(self, page: Page, rows: list[MessageRow], seqs: list[int]) -> None:
        """Add the rows of one page and their full numbers."""
        sizes = [length - MESSAGE_BODY for _, _, _, length in rows]
        self._watch_time([log_time for _, log_time, _, _ in rows])
        self.unordered += sum(b <= a for a, b in pairwise([self.last_seq, *seqs]))
        self.last_seq = max(self.last_seq, seqs[-1])
        self.frames += len(rows)
        self.bytes += sum(sizes)
        if self.is_can:
            flags = (page.data[at + _FLAGS_AT] for _, _, at, length in rows if length > MESSAGE_BODY + 3)
            self.error_frames += sum(flag & _ERROR_FLAG > 0 for flag in flags)
        self._seqs.extend(seqs)
        self._sizes.extend(sizes)
        if len(self._seqs) > 2 * MAX_KEPT_NUMBERS:
            self.count_below(self._seqs[MAX_KEPT_NUMBERS])

    def _watch_time(self, times: list[int]) -> None:
        self.first_ns = self.first_ns or times[0]
        for before, after in pairwise([self.last_ns or times[0], *times]):
            step = after - before
            if step > self.longest_gap_ns:
                self.longest_gap_ns = step
            elif step < -STAMP_TOLERANCE_NS:
                self.backwards += 1
        self.last_ns = times[-1]

    def count_below(self, number: int) -> tuple[int, int] | None:
        """Frames and bytes with smaller numbers, whose list is dropped; None when they are no longer known."""
        if number < self._folded_to:
            return None
        count = bisect_left(self._seqs, number)
        self._below = self._below[0] + count, self._below[1] + sum(self._sizes[:count])
        del self._seqs[:count], self._sizes[:count]
        self._folded_to = number
        return self._below


class SequenceCheck:
    """All numbered topics of a session.

    tick_holes : times of the last tick before and of the first one after each pause of the ticks [ns]
    doubles    : count of duplicate numbers in one file
    repeated   : count of numbers in two files, as after a change of the medium; they count once
    """

    def __init__(self) -> None:
        self.coverage = Coverage()
        self.topics: dict[str, TopicSequence] = {}
        self.tick_holes: list[tuple[int, int]] = []
        self.doubles = self.repeated = 0
        self._in_file = Coverage()
        self.first_ns: int | None = None
        self._last: int | None = None
        self._tick_ns = 0

    @property
    def frames(self) -> int:
        """All messages with a number."""
        return sum(topic.frames for topic in self.topics.values())

    def begin_file(self) -> None:
        """Begin another file."""
        self._in_file = Coverage()

    def feed(self, page: Page) -> None:
        """Add the numbered messages of a page."""
        parts = [(topic, rows, self.full_numbers(rows)) for topic, rows in page.rows if is_numbered(topic.name)]
        numbers = sorted((seq, row[1]) for _, rows, seqs in parts for seq, row in zip(seqs, rows, strict=True))
        if not numbers:
            return
        self._last = numbers[-1][0]
        earliest = min(t for _, t in numbers)
        self.first_ns = earliest if self.first_ns is None else min(self.first_ns, earliest)
        known = self.coverage.add(numbers)
        again = self._in_file.add(numbers)
        self.doubles += len(again)
        self.repeated += len(known - again)
        for topic, rows, seqs in parts:
            self._take(topic, page, *_drop_known(known, rows, seqs))

    def _take(self, topic: McapChannel, page: Page, rows: list[MessageRow], seqs: list[int]) -> None:
        if not rows:
            return
        sequence = self.topics.get(topic.name)
        if sequence is None:
            sequence = self.topics[topic.name] = TopicSequence(topic.name, topic.metadata.get("kind") == "can")
        sequence.feed(page, rows, seqs)
        if topic.name == TICK_TOPIC:
            self._watch_ticks(log_time for _, log_time, _, _ in rows)

    def full_numbers(self, rows: list[MessageRow]) -> list[int]:
        """The full numbers of rows, which hold the low 32 bits."""
        last = unwrap(rows[0][0], self._last)
        offset = last - rows[0][0]
        seqs = [sequence + offset for sequence, _, _, _ in rows]
        if max(seqs) - min(seqs) < 2**31:
            return seqs
        for i, (sequence, _, _, _) in enumerate(rows):
            seqs[i] = last = unwrap(sequence, last)
        return seqs

    def _watch_ticks(self, times: Iterable[int]) -> None:
        for t_ns in times:
            if self._tick_ns and t_ns - self._tick_ns > TICK_HOLE_NS:
                self.tick_holes.append((self._tick_ns, t_ns))
            self._tick_ns = t_ns


def _drop_known(known: set[int], rows: list[MessageRow], seqs: list[int]) -> tuple[list[MessageRow], list[int]]:
    """The rows whose numbers are new."""
    if known.isdisjoint(seqs):
        return rows, seqs
    remaining = [(row, seq) for row, seq in zip(rows, seqs, strict=True) if seq not in known]
    return [row for row, _ in remaining], [seq for _, seq in remaining]
