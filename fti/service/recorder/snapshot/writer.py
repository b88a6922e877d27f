"""One snapshot: which frames of the memory go into its file, slice by slice."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from fti.frame_batch import NumberedFrame, single_frame_batch
from fti.logger.log_segment import LogSegment
from fti.logger.raw_log import RawLog
from fti.logger.session import SessionFolder
from fti.service.recorder.snapshot.frame_memory import FrameBlock, FrameMemory

#: The ticks may be ahead of the frames that were received with them: so many looks more at the memory.  Looks and not
#: a time, so that a machine that stood still does not count.
SETTLE_CHECKS = 25
SYNC_PERIOD_S = 1.0
EVENT_TOPIC = "/fti/event"


class SnapshotWriter:
    """What was received from begin_ns to end_ns (FTI time), both included.

    channels : of the log, for each source of the memory
    frames   : so many are in the file
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
        self._buffered = False  # slice and texts are in the log, and not yet in the file
        self._synced = time.monotonic()
        self._checks = 0
        self.frames = 0
        memory.hold_from(begin_ns)

    # ------------------------------------------------------------------------- under the lock of the sink, both threads

    def extend(self, end_ns: int, t_ns: int, text: str) -> None:
        """Another trigger, or the first one: go on until its end, and record it."""
        self._end_ns = max(self._end_ns, end_ns)
        self._checks = 0
        self._texts.append((t_ns, text))
        self._give_back()

    def choose(self) -> None:
        """Take the next slice from the memory, when the last one is in the file."""
        if not self._slice and (block := self._memory.take()):
            if block.first_ns > self._end_ns:
                self._later.append(block)
            elif self._begin_ns <= block.first_ns and block.last_ns <= self._end_ns:
                self._slice = block.unpack()
            else:
                self._cut(block)

    def _cut(self, block: FrameBlock) -> None:
        """At the edges of the time, every frame is looked at."""
        later = FrameBlock()
        for source, entries in block.unpack().items():
            self._memory.count_passed(source, [e for e in entries if e[1] < self._begin_ns])
            if behind := [e for e in entries if e[1] > self._end_ns]:
                later.add(source, behind)
            if wanted := [e for e in entries if self._begin_ns <= e[1] <= self._end_ns]:
                self._slice[source] = wanted
        if later.data:
            self._later.append(later)

    def is_over(self, *, stopping: bool) -> bool:
        """Everything is in the file, and nothing that belongs to it will come.  stopping : nothing comes any more."""
        if self._slice or self._texts or self._memory.oldest_ns <= self._end_ns:
            return False
        self._checks += self._memory.newest_ns > self._end_ns
        return stopping or self._checks > SETTLE_CHECKS

    def release(self) -> None:
        """Let the memory go on as before."""
        self._give_back()
        self._memory.hold_from(None)

    def give_up(self) -> None:
        """Nothing can be written any more: what was asked for stays held in the books, the rest is let go."""
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
        """Have a file in a folder; what is not in the last one goes into it.  Raises StorageError."""
        if self._segment is None or self._segment.folder.path != folder.path:
            segment = self._log.open_segment(folder)
            if self._segment:
                self._segment.abandon()
            self._log.switch_to(segment)
            self._segment, self._buffered = segment, False
        return self._segment.path

    def write(self) -> None:
        """Bring slice and texts into the file, after ``open``.  Raises StorageError; it can then be tried again."""
        segment, texts = self._segment, list(self._texts)
        assert segment
        if not self._buffered:
            for t_ns, text in texts:
                event = {"t_ns": t_ns, "level": "info", "source": "trigger", "text": text}
                self._log.json(EVENT_TOPIC, t_ns, event)
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
