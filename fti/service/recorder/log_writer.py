"""The writer thread of the recorder: from the triple buffers into the MCAP file, wherever that can be.

It is called with every tick of the recorder, and when a buffer passes its threshold.  What it has taken from a buffer
counts as written only after the medium has accepted it; while the medium refuses, the buffers fill, and their own
rule decides what is lost and counts it.

A thread that calls into a sick medium may stay there for long.  Therefore a *stint*, the writing at one place, has a
thread of its own: it opens its file, takes over from the stint before, and what that had not brought home it takes
from the buffers again.  The stint before ends whenever its medium lets it, and touches nothing any more.  Which stint
begins where and when, ``fti.logger.storage`` decides.
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

#: How often the storage should be tended [s].
STORAGE_POLL_PERIOD_S = 0.1


class LogWriter(WriterCoordinator):
    """Owns the log and its stints.  ``poll_storage`` must be called every ``STORAGE_POLL_PERIOD_S``; ``stop`` and ``finish`` wait.

    fault          : after ``finish``: why the present file could not be closed; else None
    notes_recorded : after ``finish``: the last notes are in a file
    """

    fault: str | None = None
    notes_recorded = False

    # ------------------------------------------------------------------------------------------------ for the reader

    def start(self) -> None:
        """Begin to open a file."""
        self.poll_storage()

    def poll_storage(self) -> None:
        """Begin the attempt that the storage needs now."""
        with self._deciding:
            attempt = self._machine.wanted(time.monotonic())
        if attempt:
            writer = TargetWriter(self, attempt)
            self._others = [other for other in self._others if other.is_alive()] + [writer]
            writer.start()

    # --------------------------------------------------------------------------------------------------- for the end

    def stop(self) -> None:
        """Write what the buffers hold and end the thread; the log stays open for last notes."""
        self.stopping.set()
        self.wake()
        give_up = time.monotonic() + FINAL_TIMEOUT_S
        while self._active or time.monotonic() < give_up:
            self.poll_storage()
            writer = self._active
            if writer is None:
                time.sleep(FLUSH_PERIOD_S)
                continue
            writer.join(FLUSH_PERIOD_S)
            if not writer.is_alive() and self._is_last(writer):
                return

    def _is_last(self, writer: WriterThread) -> bool:
        """Is it still the one that writes?  Then nobody takes over from it any more: its thread would not leave."""
        with self.write_lock:
            self._finished = writer is self._active
            return self._finished

    def finish(self) -> None:
        """Record the last notes and close the file, after ``stop``; see ``fault`` and ``notes_recorded``."""
        for source in self.sources:
            source.record_gaps(self.note, final=True)
        with catch_failures("storage", self._on_fault), self.write_lock:
            self._finished = True
            self._close_present()
        if not self.notes_recorded:
            self.notes_recorded = any(self._record_notes(place) for place in self._places)
        deadline = time.monotonic() + FINAL_TIMEOUT_S
        for writer in self._others:
            writer.join(max(0.0, deadline - time.monotonic()))

    def _close_present(self) -> None:
        if self._active is None:
            raise StorageError(f"what the buffers held is lost: {self.state()[1]}")
        self.notes.record_all(self.log)
        self.log.close()
        self.notes_recorded = True
        for source in self.sources:
            if source.recorded_count:
                source.mark_written()  # what was refused before is in the file now

    def _on_fault(self, unit: str, error: Exception) -> None:
        self.fault = str(error)
        self.report(unit, error)

    def _record_notes(self, place: StorageTarget) -> bool:
        """Bring the last notes into a file of their own.  False when the place does not take it in time."""
        done = threading.Event()

        def record() -> None:
            with contextlib.suppress(StorageError):
                segment = self.log.open_segment(place.prepare())
                with self.write_lock:
                    self.log.switch_to(segment)
                    self.notes.restart()
                    self.notes.record_all(self.log)
                segment.close()
                done.set()

        threading.Thread(target=record, name="last notes", daemon=True).start()  # a medium may hold it for ever
        return done.wait(FINAL_TIMEOUT_S)
