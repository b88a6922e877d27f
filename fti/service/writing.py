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
import math
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fti.errors import StorageError
from fti.logger.part import Part
from fti.logger.places import Place
from fti.logger.raw_log import RawLog
from fti.logger.session import SessionFolder
from fti.logger.storage import Attempt, State, StorageMachine, is_full
from fti.service.guard import Report, guarded
from fti.service.hygiene import step_below_reader
from fti.service.notes import Notes
from fti.service.source import Source

FLUSH_PERIOD_S = 0.02
SYNC_PERIOD_S = 1.0
RETRY_S = 0.2
#: How often the storage should be tended [s].
TEND_PERIOD_S = 0.1
#: At the end, a medium that refuses for so long gets no more chances.
LAST_CHANCE_S = 5.0
#: A stint that is well is given this time to bring home what it carries.
HAND_OVER_S = 0.5


class Writer:
    """Owns the log and its stints.  ``tend`` must be called every ``TEND_PERIOD_S``; no call but ``stop`` waits.

    places  : where the recording can go, the main one first
    free_mb : space left at the present place, None when it is not known
    """

    def __init__(
        self, log: RawLog, sources: Sequence[Source], places: Sequence[Place], min_free_mb: float, report: Report
    ) -> None:
        self.log = log
        self.sources = sources
        self.report = report
        self.notes = Notes(report)
        self.stopping = threading.Event()
        self.turn = threading.Lock()  # held while something is recorded or marked, never during a call to the medium
        self.free_mb: float | None = None
        self._places = places
        self._min_free_mb = min_free_mb
        self._machine = StorageMachine([str(place.folder) for place in places], time.monotonic())
        self._deciding = threading.Lock()
        self._call = threading.Lock()  # free when the writer is called: waiting for it costs the least
        self._call.acquire()
        self._stint: Stint | None = None
        self._others: list[Stint] = []  # that try to begin, or have not ended yet
        self._finished = False

    # ------------------------------------------------------------------------------------------------ for the reader

    def start(self) -> None:
        """Begin to open a file."""
        self.tend()

    def tend(self) -> None:
        """Begin the attempt that the storage needs now."""
        with self._deciding:
            attempt = self._machine.wanted(time.monotonic())
        if attempt:
            stint = Stint(self, attempt)
            self._others = [other for other in self._others if other.is_alive()] + [stint]
            stint.start()

    def wake(self) -> None:
        """There is something to write."""
        with contextlib.suppress(RuntimeError):  # it is called already
            self._call.release()

    def note(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        """Record a JSON message with the next flush."""
        self.notes.add(topic, t_ns, content)

    @property
    def file(self) -> Path | None:
        """The file that is being written."""
        return self.log.path if self._stint else None

    @property
    def hopeless(self) -> bool:
        """No place could be opened so far."""
        with self._deciding:
            return self._machine.hopeless

    @property
    def silence_s(self) -> float:
        """Time since the medium took bytes last [s]."""
        return time.monotonic() - self._machine.accepted_at

    def state(self) -> tuple[State, str]:
        """State of the storage and a sentence on it; needs no help of a thread that may be stuck."""
        with self._deciding:
            return self._machine.state(time.monotonic())

    # --------------------------------------------------------------------------------------------------- for the end

    def stop(self) -> None:
        """Write what the buffers hold and end the thread; the log stays open for last notes."""
        self.stopping.set()
        self.wake()
        give_up = time.monotonic() + LAST_CHANCE_S
        while self._stint or time.monotonic() < give_up:
            self.tend()
            stint = self._stint
            if stint is None:
                time.sleep(FLUSH_PERIOD_S)
                continue
            stint.join(FLUSH_PERIOD_S)
            if not stint.is_alive() and stint is self._stint:
                return

    def finish(self) -> None:
        """Record the last notes and close the file; after ``stop``."""
        with guarded("storage", self.report), self.turn:
            self._finished = True
            if self._stint is None:
                raise StorageError(f"what the buffers held is lost: {self.state()[1]}")
            for source in self.sources:
                source.tell_gaps(self.note, final=True)
            self.notes.record_all(self.log)
            self.log.close()
        deadline = time.monotonic() + LAST_CHANCE_S
        for stint in self._others:
            stint.join(max(0.0, deadline - time.monotonic()))

    # ------------------------------------------------------------------------------------------------ for the stints

    def await_call(self) -> None:
        """Until somebody calls: the tick, every ``FLUSH_PERIOD_S``, or a buffer; not longer than twice that."""
        self._call.acquire(timeout=2 * FLUSH_PERIOD_S)

    def open(self, attempt: Attempt) -> Part:
        """A first file at a place.  Raises StorageError; may take as long as the medium likes."""
        least = self._min_free_mb if attempt.strict else 0.0
        return self.log.open_part(self._places[attempt.place].prepare(least))

    def failed(self, attempt: Attempt, text: str) -> None:
        """An attempt has come to nothing."""
        with self._deciding:
            self._machine.failed(time.monotonic(), attempt.place, text)

    def take_over(self, stint: Stint, part: Part) -> bool:
        """Let a stint be the one that writes; False when it is not wanted any more.

        One that is well first brings home what it carries, so that its file can be closed.
        """
        patience = time.monotonic() + HAND_OVER_S
        while True:
            with self.turn:
                before = self._stint
                if not (before and before.carrying and not before.refused) or time.monotonic() > patience:
                    return self._replace(before, stint, part)
            time.sleep(FLUSH_PERIOD_S / 10)

    def _replace(self, before: Stint | None, stint: Stint, part: Part) -> bool:
        with self._deciding:
            if not self._machine.opened(time.monotonic(), stint.attempt.place) or self._finished:
                return False
        self.log.adopt(part)
        self._restart(doubtful=before is None or before.refused or before.carrying)
        if before:
            before.over.set()
        self._stint = stint
        return True

    def released(self, stint: Stint) -> None:
        """A stint lets its file go, before there is another."""
        with self.turn:
            if stint is self._stint:
                with self._deciding:
                    self._machine.released(time.monotonic())
                self._restart(doubtful=True)
                self._stint = None
                stint.over.set()

    def _restart(self, *, doubtful: bool) -> None:
        """doubtful : what the last file has taken and not brought onto its medium may never get there."""
        for source in self.sources:
            source.restart(doubtful=doubtful)
        self.notes.restart()

    def await_successor(self) -> SessionFolder:
        """The folder that is written to after a stint is over, once there is one.  Raises StorageError at the end."""
        while True:
            with self.turn:
                if self._stint:
                    return self.log.folder
                if self._finished:
                    raise StorageError("no place was found any more")
            time.sleep(RETRY_S)

    def accepted(self, stint: Stint) -> None:
        """Its medium has taken everything."""
        with self._deciding:
            if stint is self._stint:
                self._machine.accepted(time.monotonic(), stint.part.fault)

    def refused(self, stint: Stint, error: StorageError) -> None:
        """Its medium takes nothing."""
        with self._deciding:
            if stint is self._stint:
                self._machine.refused(time.monotonic(), str(error), full=is_full(error))

    def look(self, stint: Stint) -> None:
        """Where its file is, and how much space there is."""
        stray = stint.part.stray()
        free: float | None = None
        with contextlib.suppress(StorageError):
            free = stint.part.free_mb()
        with self._deciding:
            if stint is not self._stint:
                return
            self.free_mb = free
            low = free is not None and free < self._min_free_mb
            self._machine.measured("less space than session.min_free_mb is left" if low else None)
            if stray:
                self._machine.strayed(time.monotonic(), stray.text, lost=stray.lost)
            else:
                self._machine.found()


class Stint(threading.Thread):
    """Writes at one place, from its first file there until another takes over.  ``over`` is set then."""

    part: Part

    def __init__(self, writer: Writer, attempt: Attempt) -> None:
        super().__init__(name=f"writer at {attempt.place}", daemon=True)  # it may be held by the medium for ever
        self.attempt = attempt
        self.over = threading.Event()
        self._writer = writer
        self._synced = self._looked = time.monotonic()
        self.carrying = False  # has recorded what its medium has not accepted yet
        self.refused = False

    def run(self) -> None:
        """Open, take over, write, leave."""
        with guarded("writer", self._writer.report):
            step_below_reader()
            if not self._open():
                return
            while not (self.over.is_set() or self._writer.stopping.is_set()):
                self._writer.await_call()
                with guarded("writer", self._writer.report):
                    self._step()
            self._drain()
        if self.over.is_set():
            with guarded("storage", self._writer.report):
                self._leave()

    def _open(self) -> bool:
        try:
            self.part = self._writer.open(self.attempt)
        except StorageError as error:
            self._writer.failed(self.attempt, str(error))
            return False
        if not self._writer.take_over(self, self.part):
            self.part.discard()
            return False
        return True

    def _step(self) -> None:
        """Carry over what the buffers hand out."""
        writer = self._writer
        with writer.turn:
            if self.over.is_set():
                return
            taken = [(source, bursts) for source in writer.sources if (bursts := source.pending())]
            writer.log.write_bursts(
                [(source.channel, bursts) for source, bursts in taken if source.channel is not None]
            )
            for source, bursts in taken:
                source.mark_recorded(bursts)
                source.tell_gaps(writer.note)
            writer.notes.record_all(writer.log)
            self.carrying = True
        self._persist()

    def _persist(self) -> None:
        """Flush until the medium has accepted it; sync and look once a second."""
        give_up: float | None = None
        while not self.over.is_set():
            try:
                self.part.flush()
                self._mark_written()
                self._sync_when_due()
            except StorageError as error:
                self.refused = True
                self._writer.refused(self, error)
                if self.part.stray():
                    self._writer.released(self)
                elif self._writer.stopping.is_set():
                    give_up = give_up or time.monotonic() + LAST_CHANCE_S
                    if time.monotonic() > give_up:
                        raise
                self.over.wait(RETRY_S)
            else:
                self.refused = False
                self._writer.accepted(self)
                return

    def _mark_written(self) -> None:
        with self._writer.turn:
            if not self.over.is_set():
                for source in self._writer.sources:
                    if source.recorded:
                        source.mark_written()
                self._writer.notes.mark_written()
                self.carrying = False

    def _mark_synced(self) -> None:
        with self._writer.turn:
            if not self.over.is_set():
                for source in self._writer.sources:
                    source.mark_synced()

    def _sync_when_due(self) -> None:
        if time.monotonic() - self._synced >= SYNC_PERIOD_S:
            self.part.sync()
            self._mark_synced()
            self._synced = time.monotonic()
            self._writer.look(self)

    def _drain(self) -> None:
        """Until nothing is left: a buffer that is being looked at hands out nothing for a moment."""
        while not (self.over.is_set() or all(source.idle for source in self._writer.sources)):
            self._step()
        self._synced = -math.inf  # what it has taken must be safe while another place can still have it
        self._persist()

    def _leave(self) -> None:
        """Another stint writes: close what was written here, as far as the medium allows."""
        stray = self.part.stray()
        if stray and stray.lost:
            rescued = self.part.rescue(self._writer.await_successor())
            raise StorageError(f"{stray.text}; what it held was written again to {rescued}")
        try:
            self.part.close()
        except StorageError:
            if not (self.refused or stray):
                raise
