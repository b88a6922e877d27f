"""Who writes, and where: what the stints of the recorder's writer share.

A stint is the writing at one place (``writer``).  One writes at a time; the others try to begin, or have not ended yet.
Which one begins where and when, ``fti.logger.storage`` decides.
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
#: At the end, a medium that refuses for so long gets no more chances.
FINAL_TIMEOUT_S = 5.0
#: A stint that is well is given this time to bring home what it carries.
HANDOVER_TIMEOUT_S = 0.5
OVERTAKEN = "was opened too late, when a file with a greater number was written to"


class WriterThread(Protocol):
    """What is to be known of a stint.

    over : set when another has taken over; carrying : it has recorded what its medium has not accepted yet
    """

    attempt: OpenAttempt
    segment: LogSegment
    superseded: threading.Event
    has_unwritten: bool
    refused: bool

    def is_alive(self) -> bool:
        """Its thread has not ended."""

    def join(self, timeout: float | None = None) -> None:
        """Wait for that [s]."""


class WriterCoordinator:
    """The log, what goes into it, and the stint that writes it.

    places  : where the recording can go, the main one first
    turn    : held while something is recorded or marked, never during a call to the medium
    free_mb : space left at the present place, None when it is not known
    """

    def __init__(
        self,
        log: RawLog,
        sources: Sequence[LogSource],
        places: Sequence[StorageTarget],
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
        self._places = places
        self._min_free_mb = min_free_mb
        self._machine = StorageMachine([str(place.folder) for place in places], time.monotonic())
        self._deciding = threading.Lock()
        self._work_signal = threading.Lock()  # free when the writer is called: waiting for it costs the least
        self._work_signal.acquire()
        self._active: WriterThread | None = None
        self._others: list[WriterThread] = []  # that try to begin, or have not ended yet
        self._finished = False

    def wake(self) -> None:
        """There is something to write."""
        with contextlib.suppress(RuntimeError):  # it is called already
            self._work_signal.release()

    def wait_for_work(self) -> None:
        """Until somebody calls: the tick, every ``FLUSH_PERIOD_S``, or a buffer; not longer than twice that."""
        self._work_signal.acquire(timeout=2 * FLUSH_PERIOD_S)

    def note(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        """Record a JSON message with the next flush."""
        self.notes.add(topic, t_ns, content)

    @property
    def may_split(self) -> bool:
        """False while a file is being opened at another place: the files are written in the order of their numbers."""
        with self._deciding:
            return not self._machine.is_opening(time.monotonic())

    @property
    def file(self) -> Path | None:
        """The file that is being written."""
        return self.log.path if self._active else None

    @property
    def hopeless(self) -> bool:
        """No place could be opened so far."""
        with self._deciding:
            return self._machine.hopeless

    @property
    def silence_s(self) -> float:
        """Time since the medium took bytes last [s]."""
        return time.monotonic() - self._machine.last_write_at

    def paused(self, seconds: float) -> None:
        """This process stood still for so long, until now."""
        with self._deciding:
            self._machine.paused(time.monotonic(), seconds)

    def state(self) -> tuple[StorageState, str]:
        """State of the storage and a sentence on it; needs no help of a thread that may be stuck."""
        with self._deciding:
            return self._machine.state(time.monotonic())

    def open(self, attempt: OpenAttempt) -> LogSegment:
        """A first file at a place.  Raises StorageError; may take as long as the medium likes."""
        least = self._min_free_mb if attempt.strict else 0.0
        return self.log.open_segment(self._places[attempt.place].prepare(least))

    def failed(self, attempt: OpenAttempt, text: str) -> None:
        """An attempt has come to nothing."""
        with self._deciding:
            self._machine.failed(time.monotonic(), attempt.place, text)

    def take_over(self, writer: WriterThread, segment: LogSegment) -> bool:
        """Let a stint be the one that writes; False when it is not wanted any more.

        One that is well first brings home what it carries, so that its file can be closed.
        """
        deadline = time.monotonic() + HANDOVER_TIMEOUT_S
        while True:
            with self.write_lock:
                before = self._active
                if not (before and before.has_unwritten and not before.refused) or time.monotonic() > deadline:
                    return self._replace(before, writer, segment)
            time.sleep(FLUSH_PERIOD_S / 10)

    def _replace(self, before: WriterThread | None, writer: WriterThread, segment: LogSegment) -> bool:
        with self._deciding:
            if self._finished:
                return False
            if self.log.is_superseded(segment):
                self._machine.failed(time.monotonic(), writer.attempt.place, f"{segment.path}: {OVERTAKEN}")
                return False
            if not self._machine.opened(time.monotonic(), writer.attempt.place):
                return False
        self.log.switch_to(segment)
        self._restart(doubtful=before is None or before.refused or before.has_unwritten)
        if before:
            before.superseded.set()
        self._active = writer
        return True

    def released(self, writer: WriterThread) -> None:
        """A stint lets its file go, before there is another."""
        with self.write_lock:
            if writer is self._active:
                with self._deciding:
                    self._machine.released(time.monotonic())
                self._restart(doubtful=True)
                self._active = None
                writer.superseded.set()

    def _restart(self, *, doubtful: bool) -> None:
        """doubtful : what the last file has taken and not brought onto its medium may never get there."""
        for source in self.sources:
            source.restart(doubtful=doubtful)
        self.notes.restart()

    def await_successor(self) -> SessionFolder:
        """The folder that is written to after a stint is over, once there is one.  Raises StorageError at the end."""
        while True:
            with self.write_lock:
                if self._active:
                    return self.log.folder
                if self._finished:
                    raise StorageError("no place was found any more")
            time.sleep(RETRY_S)

    def accepted(self, writer: WriterThread) -> None:
        """Its medium has taken everything."""
        with self._deciding:
            if writer is self._active:
                self._machine.accepted(time.monotonic(), writer.segment.fault)

    def refused(self, writer: WriterThread, error: StorageError) -> None:
        """Its medium takes nothing."""
        with self._deciding:
            if writer is self._active:
                self._machine.refused(time.monotonic(), str(error), full=is_full(error))

    def check_target(self, writer: WriterThread) -> None:
        """Where its file is, and how much space there is."""
        stray = writer.segment.stray()
        free: float | None = None
        with contextlib.suppress(StorageError):
            free = writer.segment.free_mb()
        with self._deciding:
            if writer is not self._active:
                return
            self.free_mb = free
            low = free is not None and free < self._min_free_mb
            self._machine.measured("less space than session.min_free_mb is left" if low else None)
            if stray:
                self._machine.on_file_lost(time.monotonic(), stray.text, lost=stray.lost)
            else:
                self._machine.found()
