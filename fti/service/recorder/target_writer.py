"""Writes the recording to one storage target, in its own thread."""

from __future__ import annotations

import math
import threading
import time

from fti.errors import StorageError
from fti.logger.log_segment import LogSegment
from fti.logger.storage import OpenAttempt
from fti.service.fault_guard import catch_failures
from fti.service.realtime import step_below_reader
from fti.service.recorder.writer_coordinator import FINAL_TIMEOUT_S, RETRY_S, WriterCoordinator

SYNC_PERIOD_S = 1.0


class TargetWriter(threading.Thread):
    """Writes to one storage target until another writer takes over, which sets ``superseded``."""

    segment: LogSegment

    def __init__(self, coordinator: WriterCoordinator, attempt: OpenAttempt) -> None:
        super().__init__(name=f"writer at {attempt.target}", daemon=True)  # the medium may block it for ever
        self.attempt = attempt
        self.superseded = threading.Event()
        self._coordinator = coordinator
        self._synced = time.monotonic()
        self.has_unwritten = False  # has recorded data that its medium has not accepted yet
        self.has_refused = False

    def run(self) -> None:
        """Open the file, take over, write, close."""
        with catch_failures("writer", self._coordinator.report):
            step_below_reader()
            if not self._open():
                return
            while not (self.superseded.is_set() or self._coordinator.stopping.is_set()):
                self._coordinator.wait_for_work()
                with catch_failures("writer", self._coordinator.report):
                    self._step()
            self._drain()
        if self.superseded.is_set():
            with catch_failures("storage", self._coordinator.report):
                self._leave()

    def _open(self) -> bool:
        try:
            self.segment = self._coordinator.open(self.attempt)
        except StorageError as error:
            self._coordinator.on_open_failed(self.attempt, str(error))
            return False
        if not self._coordinator.take_over(self, self.segment):
            self.segment.discard()
            return False
        return True

    def _step(self) -> None:
        """Record the pending frames of the buffers."""
        coordinator = self._coordinator
        with coordinator.write_lock:
            if self.superseded.is_set():
                return
            taken = [(source, batches) for source in coordinator.sources if (batches := source.pending())]
            coordinator.log.write_batches(
                [(source.channel, batches) for source, batches in taken if source.channel is not None]
            )
            for source, batches in taken:
                source.mark_recorded(batches)
                source.record_gaps(coordinator.add_note)
            coordinator.notes.record_all(coordinator.log)
            self.has_unwritten = True
        self._persist()

    def _persist(self) -> None:
        """Flush until the medium has accepted the data; sync and check the target once a second."""
        deadline: float | None = None
        while not self.superseded.is_set():
            try:
                self.segment.flush(may_split=self._coordinator.may_split)
                self._mark_written()
                self._sync_when_due()
            except StorageError as error:
                self.has_refused = True
                self._coordinator.on_write_refused(self, error)
                if self.segment.find_lost_file():
                    self._coordinator.on_file_released(self)
                elif self._coordinator.stopping.is_set():
                    deadline = deadline or time.monotonic() + FINAL_TIMEOUT_S
                    if time.monotonic() > deadline:
                        raise
                self.superseded.wait(RETRY_S)
            else:
                self.has_refused = False
                self._coordinator.on_write_accepted(self)
                return

    def _mark_written(self) -> None:
        with self._coordinator.write_lock:
            if not self.superseded.is_set():
                for source in self._coordinator.sources:
                    if source.recorded_count:
                        source.mark_written()
                self._coordinator.notes.mark_written()
                self.has_unwritten = False

    def _mark_synced(self) -> None:
        with self._coordinator.write_lock:
            if not self.superseded.is_set():
                for source in self._coordinator.sources:
                    source.mark_synced()

    def _sync_when_due(self) -> None:
        if time.monotonic() - self._synced >= SYNC_PERIOD_S:
            self.segment.sync()
            self._mark_synced()
            self._synced = time.monotonic()
            self._coordinator.check_target(self)

    def _drain(self) -> None:
        """Write until the sources are idle: a locked buffer returns no frames for a moment."""
        while not (self.superseded.is_set() or all(source.is_idle for source in self._coordinator.sources)):
            self._step()
        self._synced = -math.inf  # sync now, while another target could still take the data
        self._persist()

    def _leave(self) -> None:
        """Another writer has taken over: close the file, if the medium allows."""
        lost_file = self.segment.find_lost_file()
        if lost_file and lost_file.is_deleted:
            rescued = self.segment.copy_deleted_file(self._coordinator.await_successor())
            raise StorageError(f"{lost_file.text}; its content was written again to {rescued}")
        try:
            self.segment.close()
        except StorageError:
            if not (self.has_refused or lost_file):
                raise
