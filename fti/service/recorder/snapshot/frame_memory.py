"""The memory of the snapshot sink: all frames of the last seconds, received and sent, packed.

Frames are packed into blocks of bytes: the garbage collector has no object per frame to visit, and the limit applies
to the memory that they really occupy.  Frames that leave the memory are counted by source.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from struct import Struct

from fti.frame_batch import NumberedFrame
from fti.service.recorder.link_ledger import FrameCount, SnapshotOutcome

#: Source, seq, arrival time [ns], length; the bytes follow.
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
        """The next frames must go into a new block."""
        return len(self.data) >= BLOCK_BYTES or self.last_ns - self.first_ns >= BLOCK_NS


class FrameMemory:
    """Holds the frames of the last ``span_ns``; one thread adds frames, another takes them.

    span_ns   : frames that are older than the newest frame by more than this are dropped
    max_bytes : limit of the packed frames; the oldest are dropped
    outcomes  : counters of each source
    """

    def __init__(self, span_ns: int, max_bytes: int, outcomes: Sequence[SnapshotOutcome]) -> None:
        self._span_ns = span_ns
        self._max_bytes = max_bytes
        self._outcomes = outcomes
        self._lock = threading.Lock()
        self._blocks: deque[FrameBlock] = deque()
        self._open = FrameBlock()
        self.held_bytes = 0  # of the packed frames
        self._since_ns: int | None = None
        self.newest_ns = 0
        self.overflows = 0

    @property
    def held_ns(self) -> int:
        """Time from the oldest to the newest held frame [ns]."""
        return max(self.newest_ns - self.oldest_ns, 0)

    @property
    def oldest_ns(self) -> int:
        """Time of the oldest held frame; 2**63 if none."""
        with self._lock:
            return (self._blocks[0] if self._blocks else self._open).first_ns

    @property
    def has_more(self) -> bool:
        """Complete blocks wait to be taken."""
        return bool(self._blocks)

    def add(self, source: int, entries: Sequence[NumberedFrame]) -> None:
        """Add frames of a source, and drop the oldest."""
        with self._lock:
            block, before = self._open, len(self._open.data)
            block.add(source, entries)
            self.held_bytes += len(block.data) - before
            self.newest_ns = max(self.newest_ns, block.last_ns)
            if block.is_full:
                self._blocks.append(block)
                self._open = FrameBlock()
            self._drop_oldest()

    def _drop_oldest(self) -> None:
        limit_ns = self.newest_ns - self._span_ns
        if self._since_ns is not None:
            limit_ns = min(limit_ns, self._since_ns)
        while self._blocks and (self._blocks[0].last_ns < limit_ns or self.held_bytes > self._max_bytes):
            dropped = self._blocks.popleft()
            self.held_bytes -= len(dropped.data)
            displaced = dropped.last_ns >= limit_ns
            self.overflows += displaced
            wanted = displaced and self._since_ns is not None
            for source, loss in dropped.amounts.items():
                outcome = self._outcomes[source]
                (outcome.overflow if wanted else outcome.not_triggered).add(loss.frames, loss.bytes)

    # ---------------------------------------------------------------------------------------------------- for a trigger

    def hold_from(self, since_ns: int | None) -> None:
        """Hold all frames from this time on, within the size limit; None : return to the normal span."""
        with self._lock:
            self._since_ns = since_ns

    def take(self) -> FrameBlock | None:
        """Remove and return the oldest block; None if empty."""
        with self._lock:
            if self._blocks:
                block = self._blocks.popleft()
            elif self._open.data:
                block, self._open = self._open, FrameBlock()
            else:
                return None
            self.held_bytes -= len(block.data)
            return block

    def put_back(self, blocks: Sequence[FrameBlock]) -> None:
        """Return taken blocks, as the oldest ones."""
        with self._lock:
            self._blocks.extendleft(reversed(blocks))
            self.held_bytes += sum(len(block.data) for block in blocks)

    def count_written(self, source: int, entries: Sequence[NumberedFrame]) -> None:
        """Count taken frames that are in a file."""
        with self._lock:
            self._outcomes[source].recorded.add(len(entries), sum(len(entry[2]) for entry in entries))

    def count_passed(self, source: int, entries: Sequence[NumberedFrame]) -> None:
        """Count frames outside the time of a trigger."""
        with self._lock:
            self._outcomes[source].not_triggered.add(len(entries), sum(len(entry[2]) for entry in entries))

    def clear(self) -> None:
        """Drop all frames: no trigger will come."""
        while block := self.take():
            with self._lock:
                for source, loss in block.amounts.items():
                    self._outcomes[source].not_triggered.add(loss.frames, loss.bytes)
