"""The snapshot sink: beside the continuous recording, or instead of it, what was around a trigger.

The memory gets what the writer has brought home; the readers know nothing of it.  A trigger opens a file of kind
"snapshot", into which goes what the memory holds of the last ``before_s`` seconds, and then what comes until
``after_s`` after the last trigger.  A thread of its own writes it, in slices with a pause behind each: minutes of data
must neither hold up the recording nor take the interpreter from the readers, and a medium that hangs holds this thread
alone.  A frame is written once: a trigger shortly behind another one's file goes on where that ends.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from fti.config import Snapshot
from fti.errors import StorageError
from fti.frame_batch import NumberedFrame
from fti.logger.raw_log import RawLog
from fti.logger.session import SessionFolder
from fti.logger.storage_target import MEGABYTE
from fti.service.fault_guard import FailureHandler, catch_failures
from fti.service.realtime import step_below_reader
from fti.service.recorder.link_ledger import SnapshotOutcome
from fti.service.recorder.snapshot.frame_memory import FrameMemory
from fti.service.recorder.snapshot.writer import SnapshotWriter

#: Level, source and text of an event.
ReportEvent = Callable[[str, str, str], None]
#: Takes the frames of one source.
FrameConsumer = Callable[[Sequence[NumberedFrame]], None]
#: Between two slices (a slice is a block of the memory), and while no whole block waits.
PAUSE_S = 0.002
WAIT_S = 0.02
RETRY_S = 0.2
IDLE_S = 1.0
#: At the end, a medium that has taken nothing for so long gets no more chances; and when it hangs, for twice as long.
FINAL_TIMEOUT_S = 5.0
JOIN_PERIOD_S = 0.1
SECOND_NS = 1_000_000_000


class SnapshotSink:
    """See the module.

    log      : of kind "snapshot", without a file
    links    : their names
    settings : what a trigger asks for
    folder   : where files go now; None while there is no place
    outcomes : what became of the frames of each source: ticks, received and sent of the first link, of the second ...
    keepers  : take the frames of each source, when they need not be written any more
    """

    def __init__(
        self,
        log: RawLog,
        links: Sequence[str],
        settings: Snapshot,
        folder: Callable[[], SessionFolder | None],
        *,
        tell: ReportEvent,
        report: FailureHandler,
    ) -> None:
        self._log = log
        self._channels = [log.tick_channel, *chain.from_iterable(map(log.channels, links))]
        self._before_ns, self._after_ns = (round(s * SECOND_NS) for s in (settings.before_s, settings.after_s))
        self.outcomes = [SnapshotOutcome() for _ in self._channels]
        self._memory = FrameMemory(self._before_ns, round(settings.max_mb * MEGABYTE), self.outcomes)
        self.consumers: list[FrameConsumer] = [partial(self._memory.keep, n) for n in range(len(self._channels))]
        self._folder = folder
        self._report_event = tell
        self._report = report
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._stopping = threading.Event()
        self._writer: SnapshotWriter | None = None
        self._file: Path | None = None
        self._refused = False
        self._overflow_reported = False
        self._accepted = 0.0  # when the medium last took a slice, or was given its last chance
        self._thread = threading.Thread(target=self._run, name="snapshot", daemon=True)

    # ------------------------------------------------------------------------------------------------ for the reader

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def trigger(self, text: str, t_ns: int) -> None:
        """Write what was before this FTI time, and go on until after it; while that lasts, another one prolongs it."""
        with self._lock:
            begin_ns, end_ns = t_ns - self._before_ns, t_ns + self._after_ns
            if self._writer is None:
                self._writer = SnapshotWriter(self._log, self._memory, self._channels, begin_ns, end_ns)
            self._writer.extend(end_ns, t_ns, text)
        self._wake.set()

    def stop(self) -> None:
        """After the writer's end: write what a trigger has asked for and was received, let the rest go.

        As long as the medium goes on taking it; what it does not take stays held.
        """
        self._accepted = time.monotonic()
        self._stopping.set()
        self._wake.set()
        while self._thread.is_alive() and time.monotonic() - self._accepted < 2 * FINAL_TIMEOUT_S:
            self._thread.join(JOIN_PERIOD_S)
        if self._thread.is_alive():
            return
        if self._writer:
            self._writer.give_up()
        self._memory.clear()

    def health(self) -> dict[str, Any]:
        """State (waiting or writing), what the memory holds, the last file."""
        return {
            "state": "waiting" if self._writer is None else "writing",
            "held_s": self._memory.held_ns / SECOND_NS,
            "held_mb": self._memory.held_bytes / MEGABYTE,
            "file": str(self._file) if self._file else None,
        }

    def report_overflow(self) -> None:
        """Say it, once, when the memory is too small for what a trigger may ask for."""
        if self._memory.overflows and not self._overflow_reported:
            held_s, wanted_s = self._memory.held_ns / SECOND_NS, self._before_ns / SECOND_NS
            self._report_event("warning", "snapshot", f"snapshot.max_mb holds {held_s:.1f} s, not {wanted_s:g} s")
            self._overflow_reported = True

    # ----------------------------------------------------------------------------------------------------- its thread

    def _run(self) -> None:
        with catch_failures("snapshot", self._report):
            step_below_reader()
        while not self._stopping.is_set() or (self._writer and time.monotonic() - self._accepted < FINAL_TIMEOUT_S):
            pause = RETRY_S
            with catch_failures("snapshot", self._report):
                pause = self._turn()
            self._wake.wait(pause)
            self._wake.clear()

    def _turn(self) -> float:
        """One slice; returns how long to wait for the next [s]."""
        if self._writer is None:
            return IDLE_S
        try:
            self._write(self._writer)
        except StorageError as error:
            if not self._refused:
                self._report_event("error", "snapshot", f"the medium refuses: {error}; it is tried again")
            self._refused = True
            return RETRY_S
        self._refused = False
        self._accepted = time.monotonic()
        return PAUSE_S if self._memory.has_more else WAIT_S

    def _write(self, writer: SnapshotWriter) -> None:
        folder = self._folder()
        if folder is None:
            raise StorageError("there is no place for a file now")
        self._file = writer.open(folder)
        with self._lock:
            writer.choose()
        writer.write()
        with self._lock:
            over = writer.is_over(stopping=self._stopping.is_set())
            if over:
                writer.release()
                self._writer = None
        if over:
            writer.close()
            self._report_event("info", "snapshot", f"{self._file.name} holds {writer.frames} frames")
