"""The snapshot sink: records the data around a trigger, in addition to the continuous recording or instead of it.

The memory receives the frames after the writer has written them; the readers are not involved.  A trigger opens a file
of kind "snapshot" and writes the frames of the last ``before_s`` seconds to it, and those until ``after_s`` after the
last trigger.  A separate thread writes it in slices with pauses: minutes of data must neither delay the recording nor
hold the interpreter lock, and a blocked medium blocks only this thread.  Each frame is written once: the file of a
trigger that follows soon continues where the last file ends.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain
from pathlib import Path

from fti.config import Snapshot
from fti.constants import SECOND_NS
from fti.errors import StorageError
from fti.frame_batch import NumberedFrame
from fti.logger.raw_log import RawLog
from fti.logger.session import SessionFolder
from fti.logger.storage_target import MEGABYTE
from fti.messages.health import SnapshotHealth
from fti.service.fault_guard import FailureHandler, ReportEvent, catch_failures
from fti.service.realtime import step_below_reader
from fti.service.recorder.link_ledger import SnapshotOutcome
from fti.service.recorder.snapshot.frame_memory import FrameMemory
from fti.service.recorder.snapshot.writer import SnapshotWriter

#: Receives the frames of one source.
FrameConsumer = Callable[[Sequence[NumberedFrame]], None]
#: Pause between two slices (a slice is a block of the memory), and while no complete block waits.
PAUSE_S = 0.002
WAIT_S = 0.02
RETRY_S = 0.2
IDLE_S = 1.0
#: At the end of the session, writing is given up after this time without progress, twice that if the medium hangs.
FINAL_TIMEOUT_S = 5.0
JOIN_PERIOD_S = 0.1


class SnapshotSink:
    """Writes a file on each trigger.

    log       : of kind "snapshot", without a file
    links     : names of the links
    settings  : time before and after a trigger, memory size
    folder    : returns the present session folder; None without a storage target
    outcomes  : counters of each source: ticks, received and sent frames of the first link, of the second ...
    consumers : receive the frames of each source, after they were written
    """

    def __init__(
        self,
        log: RawLog,
        links: Sequence[str],
        settings: Snapshot,
        folder: Callable[[], SessionFolder | None],
        *,
        report_event: ReportEvent,
        report: FailureHandler,
    ) -> None:
        self._log = log
        self._channels = [log.tick_channel, *chain.from_iterable(map(log.channels, links))]
        self._before_ns, self._after_ns = (round(s * SECOND_NS) for s in (settings.before_s, settings.after_s))
        self.outcomes = [SnapshotOutcome() for _ in self._channels]
        self._memory = FrameMemory(self._before_ns, round(settings.max_mb * MEGABYTE), self.outcomes)
        self.consumers: list[FrameConsumer] = [partial(self._memory.add, n) for n in range(len(self._channels))]
        self._folder = folder
        self._report_event = report_event
        self._report = report
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._stopping = threading.Event()
        self._writer: SnapshotWriter | None = None
        self._file: Path | None = None
        self._refused = False
        self._overflow_reported = False
        self._accepted = 0.0  # time of the last successful slice, or of ``stop``
        self._thread = threading.Thread(target=self._run, name="snapshot", daemon=True)

    # ------------------------------------------------------------------------------------------------ for the reader

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def trigger(self, text: str, t_ns: int) -> None:
        """Write the frames around this FTI time; a trigger during that time extends it."""
        with self._lock:
            begin_ns, end_ns = t_ns - self._before_ns, t_ns + self._after_ns
            if self._writer is None:
                self._writer = SnapshotWriter(self._log, self._memory, self._channels, begin_ns, end_ns)
            self._writer.extend(end_ns, t_ns, text)
        self._wake.set()

    def stop(self) -> None:
        """After the end of the writer: write the frames requested by triggers, drop the others.

        Ends early when the medium fails; unwritten frames then count as held.
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

    def health(self) -> SnapshotHealth:
        """State (waiting or writing), content of the memory, last file."""
        return SnapshotHealth(
            state="waiting" if self._writer is None else "writing",
            held_s=self._memory.held_ns / SECOND_NS,
            held_mb=self._memory.held_bytes / MEGABYTE,
            file=str(self._file) if self._file else None,
        )

    def report_overflow(self) -> None:
        """Report once that the memory is too small for the configured time."""
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
                pause = self._step()
            self._wake.wait(pause)
            self._wake.clear()

    def _step(self) -> float:
        """One slice; returns how long to wait for the next [s]."""
        if self._writer is None:
            return IDLE_S
        try:
            self._write(self._writer)
        except StorageError as error:
            if not self._refused:
                self._report_event("error", "snapshot", f"the medium refuses: {error}; retrying")
            self._refused = True
            return RETRY_S
        self._refused = False
        self._accepted = time.monotonic()
        return PAUSE_S if self._memory.has_more else WAIT_S

    def _write(self, writer: SnapshotWriter) -> None:
        folder = self._folder()
        if folder is None:
            raise StorageError("no storage target available")
        self._file = writer.open(folder)
        with self._lock:
            writer.choose()
        writer.write()
        with self._lock:
            is_over = writer.is_over(stopping=self._stopping.is_set())
            if is_over:
                writer.release()
                self._writer = None
        if is_over:
            writer.close()
            self._report_event("info", "snapshot", f"{self._file.name} holds {writer.frames} frames")
