"""A stint of the recorder's writer: the writing at one place, on a thread of its own."""

from __future__ import annotations

import math
import threading
import time

from fti.errors import StorageError
from fti.logger.part import Part
from fti.logger.storage import Attempt
from fti.service.guard import guarded
from fti.service.hygiene import step_below_reader
from fti.service.succession import LAST_CHANCE_S, RETRY_S, Succession

SYNC_PERIOD_S = 1.0


class Stint(threading.Thread):
    """Writes at one place, from its first file there until another takes over.  ``over`` is set then."""

    part: Part

    def __init__(self, succession: Succession, attempt: Attempt) -> None:
        super().__init__(name=f"writer at {attempt.place}", daemon=True)  # it may be held by the medium for ever
        self.attempt = attempt
        self.over = threading.Event()
        self._succession = succession
        self._synced = self._looked = time.monotonic()
        self.carrying = False  # has recorded what its medium has not accepted yet
        self.refused = False

    def run(self) -> None:
        """Open, take over, write, leave."""
        with guarded("writer", self._succession.report):
            step_below_reader()
            if not self._open():
                return
            while not (self.over.is_set() or self._succession.stopping.is_set()):
                self._succession.await_call()
                with guarded("writer", self._succession.report):
                    self._step()
            self._drain()
        if self.over.is_set():
            with guarded("storage", self._succession.report):
                self._leave()

    def _open(self) -> bool:
        try:
            self.part = self._succession.open(self.attempt)
        except StorageError as error:
            self._succession.failed(self.attempt, str(error))
            return False
        if not self._succession.take_over(self, self.part):
            self.part.discard()
            return False
        return True

    def _step(self) -> None:
        """Carry over what the buffers hand out."""
        succession = self._succession
        with succession.turn:
            if self.over.is_set():
                return
            taken = [(source, bursts) for source in succession.sources if (bursts := source.pending())]
            succession.log.write_bursts(
                [(source.channel, bursts) for source, bursts in taken if source.channel is not None]
            )
            for source, bursts in taken:
                source.mark_recorded(bursts)
                source.tell_gaps(succession.note)
            succession.notes.record_all(succession.log)
            self.carrying = True
        self._persist()

    def _persist(self) -> None:
        """Flush until the medium has accepted it; sync and look once a second."""
        give_up: float | None = None
        while not self.over.is_set():
            try:
                self.part.flush(may_split=self._succession.may_split)
                self._mark_written()
                self._sync_when_due()
            except StorageError as error:
                self.refused = True
                self._succession.refused(self, error)
                if self.part.stray():
                    self._succession.released(self)
                elif self._succession.stopping.is_set():
                    give_up = give_up or time.monotonic() + LAST_CHANCE_S
                    if time.monotonic() > give_up:
                        raise
                self.over.wait(RETRY_S)
            else:
                self.refused = False
                self._succession.accepted(self)
                return

    def _mark_written(self) -> None:
        with self._succession.turn:
            if not self.over.is_set():
                for source in self._succession.sources:
                    if source.recorded:
                        source.mark_written()
                self._succession.notes.mark_written()
                self.carrying = False

    def _mark_synced(self) -> None:
        with self._succession.turn:
            if not self.over.is_set():
                for source in self._succession.sources:
                    source.mark_synced()

    def _sync_when_due(self) -> None:
        if time.monotonic() - self._synced >= SYNC_PERIOD_S:
            self.part.sync()
            self._mark_synced()
            self._synced = time.monotonic()
            self._succession.look(self)

    def _drain(self) -> None:
        """Until nothing is left: a buffer that is being looked at hands out nothing for a moment."""
        while not (self.over.is_set() or all(source.idle for source in self._succession.sources)):
            self._step()
        self._synced = -math.inf  # what it has taken must be safe while another place can still have it
        self._persist()

    def _leave(self) -> None:
        """Another stint writes: close what was written here, as far as the medium allows."""
        stray = self.part.stray()
        if stray and stray.lost:
            rescued = self.part.rescue(self._succession.await_successor())
            raise StorageError(f"{stray.text}; what it held was written again to {rescued}")
        try:
            self.part.close()
        except StorageError:
            if not (self.refused or stray):
                raise
