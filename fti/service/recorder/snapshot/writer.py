"""Writes one snapshot: selects its frames from the memory, slice by slice."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from fti.frame_batch import NumberedFrame, single_frame_batch
from fti.logger.log_segment import LogSegment
from fti.logger.raw_log import RawLog
from fti.logger.session import SessionFolder
from fti.messages.outputs import Event
from fti.messages.topics import EVENT_TOPIC
from fti.service.recorder.snapshot.frame_memory import FrameBlock, FrameMemory

#: Number of further checks of the memory, because ticks may arrive before frames of the same time.  Checks and not a
#: time, so that a standstill of the machine does not count.
SETTLE_CHECKS = 25
SYNC_PERIOD_S = 1.0


class SnapshotWriter:
    """Writes the frames from begin_ns to end_ns (FTI time), both included.

    channels : channel of the log for each source of the memory
    frames   : number of frames in the file
    """

    def __init__(self, log: RawLog, memory: FrameMemory, channels: Sequence[int], begin_ns: int, end_ns: int) -> None:
        self._log = log
        self._memory = memory
        self._channels = channels
        self._begin_ns = begin_ns
        self._end_ns = end_ns
        self._segment: LogSegment | None = None
        self._texts: list[tuple[int, str]] = []
        self._slice: dict[int, list[NumberedFrame]] = {}
        self._later: list[FrameBlock] = []
        self._buffered = False  # slice and texts are in the log, but not yet in the file
        self._synced = time.monotonic()
        self._checks = 0
        self.frames = 0
        memory.hold_from(begin_ns)

    # ------------------------------------------------------------------------- under the lock of the sink, both threads

    def extend(self, end_ns: int, t_ns: int, text: str) -> None:
        """Record a trigger, and write until its end."""
        self._end_ns = max(self._end_ns, end_ns)
        self._checks = 0
        self._texts.append((t_ns, text))
        self._give_back()

    def choose(self) -> None:
        """Take the next slice from the memory, if the last one is in the file."""
        if not self._slice and (block := self._memory.take()):
            if block.first_ns > self._end_ns:
                self._later.append(block)
            elif self._begin_ns <= block.first_ns and block.last_ns <= self._end_ns:
                self._slice = block.unpack()
            else:
                self._cut(block)

    def _cut(self, block: FrameBlock) -> None:
        """Select the frames of a block at the begin or end of the snapshot."""
        later = FrameBlock()
        for source, entries in block.unpack().items():
            self._memory.count_passed(source, [e for e in entries if e[1] < self._begin_ns])
            if following := [e for e in entries if e[1] > self._end_ns]:
                later.add(source, following)
            if wanted := [e for e in entries if self._begin_ns <= e[1] <= self._end_ns]:
                self._slice[source] = wanted
        if later.data:
            self._later.append(later)

    def is_over(self, *, stopping: bool) -> bool:
        """All frames of the snapshot are in the file.  stopping : no more frames will arrive."""
        if self._slice or self._texts or self._memory.oldest_ns <= self._end_ns:
            return False
        self._checks += self._memory.newest_ns > self._end_ns
        return stopping or self._checks > SETTLE_CHECKS

    def release(self) -> None:
        """Return the memory to its normal span."""
        self._give_back()
        self._memory.hold_from(None)

    def give_up(self) -> None:
        """Abandon the file: requested frames count as held, the others are dropped."""
        if self._segment:
            self._segment.abandon()
        self._give_back()
        while block := self._memory.take():
            for source, entries in block.unpack().items():
                self._memory.count_passed(source, [e for e in entries if not self._begin_ns <= e[1] <= self._end_ns])

    def _give_back(self) -> None:
        self._memory.put_back(self._later)
        self._later = []

    # ------------------------------------------------------------------------------------------------ the sink's thread

    def open(self, folder: SessionFolder) -> Path:
        """Open a file in a folder, unless the present one is in it; keeps unwritten frames.  Raises StorageError."""
        if self._segment is None or self._segment.folder.path != folder.path:
            segment = self._log.open_segment(folder)
            if self._segment:
                self._segment.abandon()
            self._log.switch_to(segment)
            self._segment, self._buffered = segment, False
        return self._segment.path

    def write(self) -> None:
        """Write slice and texts to the file, after ``open``.  Raises StorageError; the call can be repeated."""
        segment, texts = self._segment, list(self._texts)
        assert segment
        if not self._buffered:
            for t_ns, text in texts:
                event = Event(t_ns=t_ns, level="info", source="trigger", text=text)
                self._log.write_json(EVENT_TOPIC, t_ns, event)
            slices = self._slice.items()
            self._log.write_batches(
                [(self._channels[n], [single_frame_batch(*e) for e in entries]) for n, entries in slices]
            )
            self._buffered = True
        segment.flush()
        self._buffered = False
        del self._texts[: len(texts)]
        for source, entries in self._slice.items():
            self._memory.count_written(source, entries)
            self.frames += len(entries)
        self._slice = {}
        if time.monotonic() - self._synced >= SYNC_PERIOD_S:
            segment.sync()
            self._synced = time.monotonic()

    def close(self) -> None:
        """Finish the file.  Raises StorageError."""
        self._log.close()
