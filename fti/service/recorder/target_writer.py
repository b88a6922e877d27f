"""A stint of the recorder's writer: the writing at one place, on a thread of its own."""

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
    """Writes at one place, from its first file there until another takes over.  ``superseded`` is set then."""

    segment: LogSegment

    def __init__(self, coordinator: WriterCoordinator, attempt: OpenAttempt) -> None:
        super().__init__(name=f"writer at {attempt.place}", daemon=True)  # it may be held by the medium for ever
        self.attempt = attempt
        self.superseded = threading.Event()
        self._coordinator = coordinator
        self._synced = self._looked = time.monotonic()
        self.has_unwritten = False  # has recorded what its medium has not accepted yet
        self.refused = False

    def run(self) -> None:
        """Open, take over, write, leave."""
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
            self._coordinator.failed(self.attempt, str(error))
            return False
        if not self._coordinator.take_over(self, self.segment):
            self.segment.discard()
            return False
        return True

    def _step(self) -> None:
        """Carry over what the buffers hand out."""
        coordinator = self._coordinator
        with coordinator.write_lock:
            if self.superseded.is_set():
                return
            taken = [(source, bursts) for source in coordinator.sources if (bursts := source.pending())]
            coordinator.log.write_batches(
                [(source.channel, bursts) for source, bursts in taken if source.channel is not None]
            )
            for source, bursts in taken:
                source.mark_recorded(bursts)
                source.record_gaps(coordinator.note)
            coordinator.notes.record_all(coordinator.log)
            self.has_unwritten = True
        self._persist()

    def _persist(self) -> None:
        """Flush until the medium has accepted it; sync and look once a second."""
        give_up: float | None = None
        while not self.superseded.is_set():
            try:
                self.segment.flush(may_split=self._coordinator.may_split)
                self._mark_written()
                self._sync_when_due()
            except StorageError as error:
                self.refused = True
                self._coordinator.refused(self, error)
                if self.segment.stray():
                    self._coordinator.released(self)
                elif self._coordinator.stopping.is_set():
                    give_up = give_up or time.monotonic() + FINAL_TIMEOUT_S
                    if time.monotonic() > give_up:
                        raise
                self.superseded.wait(RETRY_S)
            else:
                self.refused = False
                self._coordinator.accepted(self)
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
        """Until nothing is left: a buffer that is being looked at hands out nothing for a moment."""
        while not (self.superseded.is_set() or all(source.is_idle for source in self._coordinator.sources)):
            self._step()
        self._synced = -math.inf  # what it has taken must be safe while another place can still have it
        self._persist()

    def _leave(self) -> None:
        """Another stint writes: close what was written here, as far as the medium allows."""
        stray = self.segment.stray()
        if stray and stray.lost:
            rescued = self.segment.copy_deleted_file(self._coordinator.await_successor())
            raise StorageError(f"{stray.text}; what it held was written again to {rescued}")
        try:
            self.segment.close()
        except StorageError:
            if not (self.refused or stray):
                raise
