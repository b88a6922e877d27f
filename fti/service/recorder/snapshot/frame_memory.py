"""The memory of the snapshot sink: the last seconds of everything that was received and sent, packed.

Frames are packed into blocks of bytes one behind the other: no object per frame that the collector of cycles would
have to visit, and the bound holds for what they really occupy.  What leaves the memory is counted, by source.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from struct import Struct

from fti.frame_batch import NumberedFrame
from fti.service.recorder.link_ledger import FrameCount, SnapshotOutcome

#: Source, seq, time of arrival [ns], length; the bytes follow.
_HEAD = Struct("<HQQI")
HEAD_BYTES = _HEAD.size
BLOCK_BYTES = 2**16
BLOCK_NS = 500_000_000


@dataclass(slots=True)
class FrameBlock:
    """Packed frames.  first_ns, last_ns : their earliest and latest time; amounts : frames and bytes of each source."""

    data: bytearray = field(default_factory=bytearray)
    first_ns: int = 2**63
    last_ns: int = 0
    amounts: dict[int, FrameCount] = field(default_factory=dict)

    def add(self, source: int, entries: Sequence[NumberedFrame]) -> None:
        """Pack frames of one source, at least one."""
        data, pack, before = self.data, _HEAD.pack, len(self.data)
        for seq, t_ns, frame in entries:
            data += pack(source, seq, t_ns, len(frame))
            data += frame
        times = [t_ns for _, t_ns, _ in entries]
        self.first_ns = min(self.first_ns, *times)
        self.last_ns = max(self.last_ns, *times)
        amount = self.amounts.get(source)
        if amount is None:
            amount = self.amounts[source] = FrameCount()
        count = len(entries)
        amount.add(count, len(data) - before - count * HEAD_BYTES)

    def unpack(self) -> dict[int, list[NumberedFrame]]:
        """The frames of each source, in their order."""
        found: dict[int, list[NumberedFrame]] = {}
        data, at, unpack = bytes(self.data), 0, _HEAD.unpack_from
        while at < len(data):
            source, seq, t_ns, length = unpack(data, at)
            at += HEAD_BYTES + length
            found.setdefault(source, []).append((seq, t_ns, data[at - length : at]))
        return found

    @property
    def is_full(self) -> bool:
        """The next frames go into another block."""
        return len(self.data) >= BLOCK_BYTES or self.last_ns - self.first_ns >= BLOCK_NS


class FrameMemory:
    """Holds what is not older than a span; for a thread that keeps and one that takes.

    span_ns    : what is so much older than the newest frame is let go
    most_bytes : the packed frames are never more; the oldest go
    outcomes   : of each source: what became of its frames
    """

    def __init__(self, span_ns: int, max_bytes: int, outcomes: Sequence[SnapshotOutcome]) -> None:
        self._span_ns = span_ns
        self._max_bytes = max_bytes
        self._outcomes = outcomes
        self._lock = threading.Lock()
        self._blocks: deque[FrameBlock] = deque()
        self._open = FrameBlock()
        self._bytes = 0
        self._since_ns: int | None = None
        self.newest_ns = 0
        self.overflows = 0

    @property
    def held_bytes(self) -> int:
        """What the packed frames occupy [B]."""
        return self._bytes

    @property
    def held_ns(self) -> int:
        """Time from the oldest to the newest frame that is held [ns]."""
        return max(self.newest_ns - self.oldest_ns, 0)

    @property
    def oldest_ns(self) -> int:
        """Time of the oldest frame that is held; far ahead when there is none."""
        with self._lock:
            return (self._blocks[0] if self._blocks else self._open).first_ns

    @property
    def has_more(self) -> bool:
        """Whole blocks wait to be taken."""
        return bool(self._blocks)

    def keep(self, source: int, entries: Sequence[NumberedFrame]) -> None:
        """Hold frames of a source, and let the oldest go."""
        with self._lock:
            block, before = self._open, len(self._open.data)
            block.add(source, entries)
            self._bytes += len(block.data) - before
            self.newest_ns = max(self.newest_ns, block.last_ns)
            if block.is_full:
                self._blocks.append(block)
                self._open = FrameBlock()
            self._let_go()

    def _let_go(self) -> None:
        limit_ns = self.newest_ns - self._span_ns
        if self._since_ns is not None:
            limit_ns = min(limit_ns, self._since_ns)
        while self._blocks and (self._blocks[0].last_ns < limit_ns or self._bytes > self._max_bytes):
            gone = self._blocks.popleft()
            self._bytes -= len(gone.data)
            displaced = gone.last_ns >= limit_ns
            self.overflows += displaced
            wanted = displaced and self._since_ns is not None
            for source, loss in gone.amounts.items():
                outcome = self._outcomes[source]
                (outcome.overflow if wanted else outcome.not_triggered).add(loss.frames, loss.bytes)

    # ---------------------------------------------------------------------------------------------------- for a trigger

    def hold_from(self, since_ns: int | None) -> None:
        """Let nothing go that is not older than this, as long as there is space; None : as before."""
        with self._lock:
            self._since_ns = since_ns

    def take(self) -> FrameBlock | None:
        """The oldest block, which is not held any more; None when there is none."""
        with self._lock:
            if self._blocks:
                block = self._blocks.popleft()
            elif self._open.data:
                block, self._open = self._open, FrameBlock()
            else:
                return None
            self._bytes -= len(block.data)
            return block

    def put_back(self, blocks: Sequence[FrameBlock]) -> None:
        """Blocks that were taken, before all that is held."""
        with self._lock:
            self._blocks.extendleft(reversed(blocks))
            self._bytes += sum(len(block.data) for block in blocks)

    def count_written(self, source: int, entries: Sequence[NumberedFrame]) -> None:
        """Frames that were taken are in a file."""
        with self._lock:
            self._outcomes[source].recorded.add(len(entries), sum(len(entry[2]) for entry in entries))

    def count_passed(self, source: int, entries: Sequence[NumberedFrame]) -> None:
        """Frames that were taken, or could not be, are older than a trigger asks for."""
        with self._lock:
            self._outcomes[source].not_triggered.add(len(entries), sum(len(entry[2]) for entry in entries))

    def clear(self) -> None:
        """Nothing is held any more: no trigger will come."""
        while block := self.take():
            with self._lock:
                for source, loss in block.amounts.items():
                    self._outcomes[source].not_triggered.add(loss.frames, loss.bytes)
