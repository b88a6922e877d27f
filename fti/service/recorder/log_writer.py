"""Writes the triple buffers of the recorder to the MCAP file, on a storage target that works.

The writer is called with every tick of the recorder, and when a buffer passes its threshold.  Frames count as written
after the medium has accepted them; while the medium fails, the buffers fill and drop their oldest frames, counted.

A blocked disk may block a thread for long.  Therefore every storage target has its own thread (``WriterThread``): it
opens its file, takes over from the active thread, and records again what that one had not written.  The thread before
ends when its medium returns, and changes nothing after the takeover.  ``fti.logger.storage`` decides when and where a
thread begins.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from fti.errors import StorageError
from fti.logger.log_segment import LogSegment
from fti.logger.raw_log import RawLog
from fti.logger.session import SessionFolder
from fti.logger.storage import OpenAttempt, StorageMachine, StorageState, is_full
from fti.logger.storage_target import StorageTarget
from fti.service.fault_guard import FailureHandler, catch_failures
from fti.service.realtime import step_below_reader
from fti.service.recorder.log_content import LogContent
from fti.service.recorder.log_source import LogSource

FLUSH_PERIOD_S = 0.02
SYNC_PERIOD_S = 1.0
RETRY_S = 0.2
#: Period of ``poll_storage`` [s].
STORAGE_POLL_PERIOD_S = 0.1
#: At the end of the session, writing is given up when a medium has refused for this time.
FINAL_TIMEOUT_S = 5.0
#: Time for a working thread to write its recorded data before another one takes over.
HANDOVER_TIMEOUT_S = 0.5


class WriterThread(threading.Thread):
    """The thread of a storage target.

    segment     : its files, once the first one is open
    superseded  : set when another thread has taken over
    has_refused : the last write failed
    synced_at   : time of the last sync (monotonic clock) [s]
    """

    segment: LogSegment

    def __init__(self, attempt: OpenAttempt, write: Callable[[WriterThread], None]) -> None:
        # a daemon thread: the medium may block it for ever
        super().__init__(target=write, args=(self,), name=f"writer at {attempt.target}", daemon=True)
        self.attempt = attempt
        self.superseded = threading.Event()
        self.has_refused = False
        self.synced_at = time.monotonic()


class LogWriter:
    """The writer of the log.  Call ``poll_storage`` every ``STORAGE_POLL_PERIOD_S``; ``stop`` and ``finish`` wait.

    targets        : the storage targets, the main one first
    add_note       : records a JSON message (topic, time [ns], content) with the next flush; for any thread
    free_mb        : free space of the present target, None if unknown
    fault          : after ``finish``: why the present file could not be closed, or None
    notes_recorded : after ``finish``: the last notes are in a file
    """

    def __init__(
        self,
        log: RawLog,
        sources: Sequence[LogSource],
        targets: Sequence[StorageTarget],
        min_free_mb: float,
        report: FailureHandler,
    ) -> None:
        self._log = log
        self._content = LogContent(log, sources, report)
        self._content_lock = threading.Lock()  # never held during a call to the medium
        self._targets = targets
        self._min_free_mb = min_free_mb
        self._report = report
        self._machine = StorageMachine([str(target.folder) for target in targets], time.monotonic())
        self._machine_lock = threading.Lock()
        self._work_signal = threading.Lock()  # free when there is work: waiting for a lock is the cheapest wait
        self._work_signal.acquire()
        self._active: WriterThread | None = None  # changed with the content locked
        self._threads: list[WriterThread] = []  # opening a file, or not ended yet
        self._stopping = threading.Event()
        self._finished = False
        self.add_note: Callable[[str, int, dict[str, Any]], None] = self._content.notes.add
        self.free_mb: float | None = None
        self.fault: str | None = None
        self.notes_recorded = False

    # ------------------------------------------------------------------------------------------------ for the reader

    def poll_storage(self) -> None:
        """Start the next attempt to open a file, if the storage needs one; the first call opens the first file."""
        with self._machine_lock:
            attempt = self._machine.next_attempt(time.monotonic())
        if attempt:
            thread = WriterThread(attempt, self._write)
            self._threads = [other for other in self._threads if other.is_alive()] + [thread]
            thread.start()

    def wake(self) -> None:
        """Wake the active thread: with each tick, every ``FLUSH_PERIOD_S``, or when a buffer fills."""
        with contextlib.suppress(RuntimeError):  # already woken
            self._work_signal.release()

    @property
    def file(self) -> Path | None:
        """The file that is being written."""
        return self._log.path if self._active else None

    @property
    def has_failed_everywhere(self) -> bool:
        """No target could be opened so far."""
        with self._machine_lock:
            return self._machine.has_failed_everywhere

    @property
    def silence_s(self) -> float:
        """Time since the last successful write [s]."""
        return time.monotonic() - self._machine.last_write_at

    def on_process_paused(self, seconds: float) -> None:
        """This process stood still for this time [s], until now."""
        with self._machine_lock:
            self._machine.on_process_paused(time.monotonic(), seconds)

    def state(self) -> tuple[StorageState, str]:
        """State of the storage with a hint; does not wait for a thread that may be blocked."""
        with self._machine_lock:
            return self._machine.state(time.monotonic())

    # ---------------------------------------------------------------------------------------- the thread of a target

    def _write(self, thread: WriterThread) -> None:
        """Open the file, take over, write, close."""
        with catch_failures("writer", self._report):
            step_below_reader()
            if not self._open(thread):
                return
            while not (thread.superseded.is_set() or self._stopping.is_set()):
                self._work_signal.acquire(timeout=2 * FLUSH_PERIOD_S)
                with catch_failures("writer", self._report):
                    self._step(thread)
            self._drain(thread)
        if thread.superseded.is_set():
            with catch_failures("storage", self._report):
                self._leave(thread)

    def _open(self, thread: WriterThread) -> bool:
        """Open the first file and take over; False when the target refuses, or the thread is not needed any more."""
        target, strict = thread.attempt.target, thread.attempt.strict
        try:
            folder = self._targets[target].prepare(self._min_free_mb if strict else 0.0)
            thread.segment = self._log.open_segment(folder)
        except StorageError as error:
            with self._machine_lock:
                self._machine.on_open_failed(time.monotonic(), target, str(error))
            return False
        if not self._take_over(thread):
            thread.segment.discard()
            return False
        return True

    def _take_over(self, thread: WriterThread) -> bool:
        """A working thread first writes its recorded data, so that its file can be closed."""
        deadline = time.monotonic() + HANDOVER_TIMEOUT_S
        while True:
            with self._content_lock:
                before = self._active
                is_working = before and self._content.has_unwritten and not before.has_refused
                if not is_working or time.monotonic() > deadline:
                    return self._replace(before, thread)
            time.sleep(FLUSH_PERIOD_S / 10)

    def _replace(self, before: WriterThread | None, thread: WriterThread) -> bool:
        segment, target = thread.segment, thread.attempt.target
        with self._machine_lock:
            if self._finished:
                return False
            if self._log.is_superseded(segment):
                text = f"{segment.path}: was opened after a file with a greater number had been written"
                self._machine.on_open_failed(time.monotonic(), target, text)
                return False
            if not self._machine.on_file_opened(time.monotonic(), target):
                return False
        is_uncertain = before is None or before.has_refused or self._content.has_unwritten
        self._content.restart(segment, is_uncertain=is_uncertain)
        if before:
            before.superseded.set()
        self._active = thread
        return True

    def _step(self, thread: WriterThread) -> None:
        """Record what waits, and write it."""
        with self._content_lock:
            if thread.superseded.is_set():
                return
            self._content.record()
        self._persist(thread)

    def _persist(self, thread: WriterThread) -> None:
        """Flush until the medium has accepted the data; sync and check the target once a second."""
        deadline: float | None = None
        while not thread.superseded.is_set():
            try:
                thread.segment.flush(may_split=self._may_split())
                self._if_active(thread, self._content.mark_written)
                self._sync_when_due(thread)
            except StorageError as error:
                thread.has_refused = True
                self._on_refused(thread, error)
                if self._stopping.is_set() and not thread.superseded.is_set():
                    deadline = deadline or time.monotonic() + FINAL_TIMEOUT_S
                    if time.monotonic() > deadline:
                        raise
                thread.superseded.wait(RETRY_S)
            else:
                thread.has_refused = False
                with self._machine_lock:
                    if thread is self._active:
                        self._machine.on_write_accepted(time.monotonic(), thread.segment.fault)
                return

    def _may_split(self) -> bool:
        """False while a file is being opened at another target: files are written in the order of their numbers."""
        with self._machine_lock:
            return not self._machine.is_opening(time.monotonic())

    def _if_active(self, thread: WriterThread, mark: Callable[[], None]) -> None:
        with self._content_lock:
            if not thread.superseded.is_set():
                mark()

    def _sync_when_due(self, thread: WriterThread) -> None:
        if time.monotonic() - thread.synced_at >= SYNC_PERIOD_S:
            thread.segment.sync()
            self._if_active(thread, self._content.mark_synced)
            thread.synced_at = time.monotonic()
            self._check_target(thread)

    def _check_target(self, thread: WriterThread) -> None:
        """Check the file and the free space of the target."""
        lost_file = thread.segment.find_lost_file()
        free: float | None = None
        with contextlib.suppress(StorageError):
            free = thread.segment.free_mb()
        with self._machine_lock:
            if thread is not self._active:
                return
            self.free_mb = free
            low = free is not None and free < self._min_free_mb
            self._machine.on_space_measured("free space is below session.min_free_mb" if low else None)
            if lost_file:
                self._machine.on_file_lost(time.monotonic(), lost_file.text, is_deleted=lost_file.is_deleted)
            else:
                self._machine.on_file_found()

    def _on_refused(self, thread: WriterThread, error: StorageError) -> None:
        """The medium has refused data.  A file that is lost as well is released, before another one has opened."""
        with self._machine_lock:
            if thread is self._active:
                self._machine.on_write_refused(time.monotonic(), str(error), full=is_full(error))
        if not thread.segment.find_lost_file():
            return
        with self._content_lock:
            if thread is self._active:
                with self._machine_lock:
                    self._machine.on_file_released(time.monotonic())
                self._content.restart(None, is_uncertain=True)
                self._active = None
                thread.superseded.set()

    def _drain(self, thread: WriterThread) -> None:
        """Write until the sources are idle: a locked buffer returns no frames for a moment."""
        while not (thread.superseded.is_set() or self._content.is_idle()):
            self._step(thread)
        thread.synced_at = -math.inf  # sync now, while another target could still take the data
        self._persist(thread)

    def _leave(self, thread: WriterThread) -> None:
        """Another thread has taken over: close the file, if the medium allows."""
        lost_file = thread.segment.find_lost_file()
        if lost_file and lost_file.is_deleted:
            rescued = thread.segment.copy_deleted_file(self._await_successor())
            raise StorageError(f"{lost_file.text}; its content was written again to {rescued}")
        try:
            thread.segment.close()
        except StorageError:
            if not (thread.has_refused or lost_file):
                raise

    def _await_successor(self) -> SessionFolder:
        """Wait for the next active thread; returns its folder.  Raises StorageError at the end."""
        while True:
            with self._content_lock:
                if self._active:
                    return self._log.folder
                if self._finished:
                    raise StorageError("no storage target available")
            time.sleep(RETRY_S)

    # --------------------------------------------------------------------------------------------------- for the end

    def stop(self) -> None:
        """Write the buffers and end the thread; the log stays open for the last notes."""
        self._stopping.set()
        self.wake()
        deadline = time.monotonic() + FINAL_TIMEOUT_S
        while self._active or time.monotonic() < deadline:
            self.poll_storage()
            thread = self._active
            if thread is None:
                time.sleep(FLUSH_PERIOD_S)
                continue
            thread.join(FLUSH_PERIOD_S)
            if not thread.is_alive() and self._is_last(thread):
                return

    def _is_last(self, thread: WriterThread) -> bool:
        """Is this thread still active?  Then no other one takes over any more."""
        with self._content_lock:
            self._finished = thread is self._active
            return self._finished

    def finish(self) -> None:
        """Record the last notes and close the file, after ``stop``; see ``fault`` and ``notes_recorded``."""
        for source in self._content.sources:
            source.record_gaps(self.add_note, final=True)
        with catch_failures("storage", self._on_fault), self._content_lock:
            self._finished = True
            self._close_present()
        if not self.notes_recorded:
            self.notes_recorded = any(self._record_notes(target) for target in self._targets)
        deadline = time.monotonic() + FINAL_TIMEOUT_S
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))

    def _close_present(self) -> None:
        if self._active is None:
            raise StorageError(f"the buffered frames are lost: {self.state()[1]}")
        self._content.notes.record_all(self._log)
        self._log.close()
        self.notes_recorded = True
        self._content.mark_written()  # frames that were refused before are in the file now

    def _on_fault(self, unit: str, error: Exception) -> None:
        self.fault = str(error)
        self._report(unit, error)

    def _record_notes(self, target: StorageTarget) -> bool:
        """Write the last notes to a separate file.  False when the storage target does not accept it in time."""
        done = threading.Event()

        def record() -> None:
            with contextlib.suppress(StorageError):
                segment = self._log.open_segment(target.prepare())
                with self._content_lock:
                    self._log.switch_to(segment)
                    self._content.notes.restart()
                    self._content.notes.record_all(self._log)
                segment.close()
                done.set()

        threading.Thread(target=record, name="last notes", daemon=True).start()  # a medium may block it for ever
        return done.wait(FINAL_TIMEOUT_S)
