"""Writes the triple buffers of the recorder to the MCAP file, on a storage target that works.

The writer is called with every tick of the recorder, and when a buffer passes its threshold.  Frames count as written
after the medium has accepted them; while the medium fails, the buffers fill and drop their oldest frames, counted.

A blocked disk may block a thread for long.  Therefore every storage target has its own writer thread
(``TargetWriter``): it opens its file, takes over from the previous writer, and takes frames that were not written from
the buffers again.  The previous writer ends when its medium returns, and changes nothing after the takeover.
``fti.logger.storage`` decides when and where a writer begins.
"""

from __future__ import annotations

import contextlib
import threading
import time

from fti.errors import StorageError
from fti.logger.storage_target import StorageTarget
from fti.service.fault_guard import catch_failures
from fti.service.recorder.target_writer import TargetWriter
from fti.service.recorder.writer_coordinator import FINAL_TIMEOUT_S, FLUSH_PERIOD_S, WriterCoordinator, WriterThread

#: Period of ``poll_storage`` [s].
STORAGE_POLL_PERIOD_S = 0.1


class LogWriter(WriterCoordinator):
    """The log and its writers.  Call ``poll_storage`` every ``STORAGE_POLL_PERIOD_S``; ``stop`` and ``finish`` wait.

    fault          : after ``finish``: why the present file could not be closed, or None
    notes_recorded : after ``finish``: the last notes are in a file
    """

    fault: str | None = None
    notes_recorded = False

    # ------------------------------------------------------------------------------------------------ for the reader

    def start(self) -> None:
        """Begin to open the first file."""
        self.poll_storage()

    def poll_storage(self) -> None:
        """Start the next attempt to open a file, if the storage needs one."""
        with self._deciding:
            attempt = self._machine.next_attempt(time.monotonic())
        if attempt:
            writer = TargetWriter(self, attempt)
            self._others = [other for other in self._others if other.is_alive()] + [writer]
            writer.start()

    # --------------------------------------------------------------------------------------------------- for the end

    def stop(self) -> None:
        """Write the buffers and end the thread; the log stays open for the last notes."""
        self.stopping.set()
        self.wake()
        deadline = time.monotonic() + FINAL_TIMEOUT_S
        while self._active or time.monotonic() < deadline:
            self.poll_storage()
            writer = self._active
            if writer is None:
                time.sleep(FLUSH_PERIOD_S)
                continue
            writer.join(FLUSH_PERIOD_S)
            if not writer.is_alive() and self._is_last(writer):
                return

    def _is_last(self, writer: WriterThread) -> bool:
        """Is this writer still active?  Then no other writer takes over any more."""
        with self.write_lock:
            self._finished = writer is self._active
            return self._finished

    def finish(self) -> None:
        """Record the last notes and close the file, after ``stop``; see ``fault`` and ``notes_recorded``."""
        for source in self.sources:
            source.record_gaps(self.add_note, final=True)
        with catch_failures("storage", self._on_fault), self.write_lock:
            self._finished = True
            self._close_present()
        if not self.notes_recorded:
            self.notes_recorded = any(self._record_notes(target) for target in self._targets)
        deadline = time.monotonic() + FINAL_TIMEOUT_S
        for writer in self._others:
            writer.join(max(0.0, deadline - time.monotonic()))

    def _close_present(self) -> None:
        if self._active is None:
            raise StorageError(f"the buffered frames are lost: {self.state()[1]}")
        self.notes.record_all(self.log)
        self.log.close()
        self.notes_recorded = True
        for source in self.sources:
            if source.recorded_count:
                source.mark_written()  # frames that were refused before are in the file now

    def _on_fault(self, unit: str, error: Exception) -> None:
        self.fault = str(error)
        self.report(unit, error)

    def _record_notes(self, target: StorageTarget) -> bool:
        """Write the last notes to a separate file.  False when the storage target does not accept it in time."""
        done = threading.Event()

        def record() -> None:
            with contextlib.suppress(StorageError):
                segment = self.log.open_segment(target.prepare())
                with self.write_lock:
                    self.log.switch_to(segment)
                    self.notes.restart()
                    self.notes.record_all(self.log)
                segment.close()
                done.set()

        threading.Thread(target=record, name="last notes", daemon=True).start()  # a medium may block it for ever
        return done.wait(FINAL_TIMEOUT_S)
