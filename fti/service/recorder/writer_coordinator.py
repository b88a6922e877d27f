"""Shared state of the writers of the recorder: the log, its sources, and the active writer.

Each storage target has its own writer (``TargetWriter``).  One is active at a time; the others are opening a file, or
have not ended yet.  ``fti.logger.storage`` decides when and where a writer begins.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from fti.errors import StorageError
from fti.logger.log_segment import LogSegment
from fti.logger.raw_log import RawLog
from fti.logger.session import SessionFolder
from fti.logger.storage import OpenAttempt, StorageMachine, StorageState, is_full
from fti.logger.storage_target import StorageTarget
from fti.service.fault_guard import FailureHandler
from fti.service.recorder.log_source import LogSource
from fti.service.recorder.note_queue import NoteQueue

FLUSH_PERIOD_S = 0.02
RETRY_S = 0.2
#: At the end of the session, writing is given up when a medium has refused for this time.
FINAL_TIMEOUT_S = 5.0
#: Time for a working writer to write its recorded data before another one takes over.
HANDOVER_TIMEOUT_S = 0.5
OVERTAKEN = "was opened after a file with a greater number had been written"


class WriterThread(Protocol):
    """A writer, as the coordinator uses it.

    superseded : set when another writer has taken over; has_unwritten : it has recorded data that its medium has not
    accepted yet; has_refused : the last write failed
    """

    attempt: OpenAttempt
    segment: LogSegment
    superseded: threading.Event
    has_unwritten: bool
    has_refused: bool

    def is_alive(self) -> bool:
        """The thread has not ended."""

    def join(self, timeout: float | None = None) -> None:
        """Wait for the end of the thread."""


class WriterCoordinator:
    """The log, its sources, and the active writer.

    targets    : the storage targets, the main one first
    write_lock : held while data are recorded or marked, never during a call to the medium
    free_mb    : free space of the present target, None if unknown
    """

    def __init__(
        self,
        log: RawLog,
        sources: Sequence[LogSource],
        targets: Sequence[StorageTarget],
        min_free_mb: float,
        report: FailureHandler,
    ) -> None:
        self.log = log
        self.sources = sources
        self.report = report
        self.notes = NoteQueue(report)
        self.stopping = threading.Event()
        self.write_lock = threading.Lock()
        self.free_mb: float | None = None
        self._targets = targets
        self._min_free_mb = min_free_mb
        self._machine = StorageMachine([str(target.folder) for target in targets], time.monotonic())
        self._deciding = threading.Lock()
        self._work_signal = threading.Lock()  # free when the writer is called: waiting for a lock is the cheapest wait
        self._work_signal.acquire()
        self._active: WriterThread | None = None
        self._others: list[WriterThread] = []  # opening a file, or not ended yet
        self._finished = False

    def wake(self) -> None:
        """Wake the writer."""
        with contextlib.suppress(RuntimeError):  # already called
            self._work_signal.release()

    def wait_for_work(self) -> None:
        """Wait for ``wake``: by the tick, every ``FLUSH_PERIOD_S``, or by a buffer; at most twice that."""
        self._work_signal.acquire(timeout=2 * FLUSH_PERIOD_S)

    def add_note(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        """Record a JSON message with the next flush."""
        self.notes.add(topic, t_ns, content)

    @property
    def may_split(self) -> bool:
        """False while a file is being opened at another target: files are written in the order of their numbers."""
        with self._deciding:
            return not self._machine.is_opening(time.monotonic())

    @property
    def file(self) -> Path | None:
        """The file that is being written."""
        return self.log.path if self._active else None

    @property
    def has_failed_everywhere(self) -> bool:
        """No target could be opened so far."""
        with self._deciding:
            return self._machine.has_failed_everywhere

    @property
    def silence_s(self) -> float:
        """Time since the last successful write [s]."""
        return time.monotonic() - self._machine.last_write_at

    def on_process_paused(self, seconds: float) -> None:
        """This process stood still for this time [s], until now."""
        with self._deciding:
            self._machine.on_process_paused(time.monotonic(), seconds)

    def state(self) -> tuple[StorageState, str]:
        """State of the storage with a hint; does not wait for a thread that may be blocked."""
        with self._deciding:
            return self._machine.state(time.monotonic())

    def open(self, attempt: OpenAttempt) -> LogSegment:
        """Open the first file at a target.  Raises StorageError; may block as long as the medium blocks."""
        min_free_mb = self._min_free_mb if attempt.strict else 0.0
        return self.log.open_segment(self._targets[attempt.target].prepare(min_free_mb))

    def on_open_failed(self, attempt: OpenAttempt, text: str) -> None:
        """An attempt has failed."""
        with self._deciding:
            self._machine.on_open_failed(time.monotonic(), attempt.target, text)

    def take_over(self, writer: WriterThread, segment: LogSegment) -> bool:
        """Make a writer the active one; False when it is no longer needed.

        A working writer first writes its recorded data, so that its file can be closed.
        """
        deadline = time.monotonic() + HANDOVER_TIMEOUT_S
        while True:
            with self.write_lock:
                before = self._active
                if not (before and before.has_unwritten and not before.has_refused) or time.monotonic() > deadline:
                    return self._replace(before, writer, segment)
            time.sleep(FLUSH_PERIOD_S / 10)

    def _replace(self, before: WriterThread | None, writer: WriterThread, segment: LogSegment) -> bool:
        with self._deciding:
            if self._finished:
                return False
            if self.log.is_superseded(segment):
                self._machine.on_open_failed(time.monotonic(), writer.attempt.target, f"{segment.path}: {OVERTAKEN}")
                return False
            if not self._machine.on_file_opened(time.monotonic(), writer.attempt.target):
                return False
        self.log.switch_to(segment)
        self._restart(is_uncertain=before is None or before.has_refused or before.has_unwritten)
        if before:
            before.superseded.set()
        self._active = writer
        return True

    def on_file_released(self, writer: WriterThread) -> None:
        """The writer has lost its file, before another one has opened."""
        with self.write_lock:
            if writer is self._active:
                with self._deciding:
                    self._machine.on_file_released(time.monotonic())
                self._restart(is_uncertain=True)
                self._active = None
                writer.superseded.set()

    def _restart(self, *, is_uncertain: bool) -> None:
        """is_uncertain : unsynced data of the last file may be lost."""
        for source in self.sources:
            source.restart(is_uncertain=is_uncertain)
        self.notes.restart()

    def await_successor(self) -> SessionFolder:
        """Wait for the next active writer; returns its folder.  Raises StorageError at the end."""
        while True:
            with self.write_lock:
                if self._active:
                    return self.log.folder
                if self._finished:
                    raise StorageError("no storage target available")
            time.sleep(RETRY_S)

    def on_write_accepted(self, writer: WriterThread) -> None:
        """The medium has accepted all data."""
        with self._deciding:
            if writer is self._active:
                self._machine.on_write_accepted(time.monotonic(), writer.segment.fault)

    def on_write_refused(self, writer: WriterThread, error: StorageError) -> None:
        """The medium has refused data."""
        with self._deciding:
            if writer is self._active:
                self._machine.on_write_refused(time.monotonic(), str(error), full=is_full(error))

    def check_target(self, writer: WriterThread) -> None:
        """Check the file and the free space of a writer's target."""
        lost_file = writer.segment.find_lost_file()
        free: float | None = None
        with contextlib.suppress(StorageError):
            free = writer.segment.free_mb()
        with self._deciding:
            if writer is not self._active:
                return
            self.free_mb = free
            low = free is not None and free < self._min_free_mb
            self._machine.on_space_measured("free space is below session.min_free_mb" if low else None)
            if lost_file:
                self._machine.on_file_lost(time.monotonic(), lost_file.text, is_deleted=lost_file.is_deleted)
            else:
                self._machine.on_file_found()
