"""Who writes, and where: what the stints of the recorder's writer share.

A stint is the writing at one place (``stint``).  One writes at a time; the others try to begin, or have not ended yet.
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
from fti.logger.part import Part
from fti.logger.places import Place
from fti.logger.raw_log import RawLog
from fti.logger.session import SessionFolder
from fti.logger.storage import Attempt, State, StorageMachine, is_full
from fti.service.guard import Report
from fti.service.notes import Notes
from fti.service.source import Source

FLUSH_PERIOD_S = 0.02
RETRY_S = 0.2
#: At the end, a medium that refuses for so long gets no more chances.
LAST_CHANCE_S = 5.0
#: A stint that is well is given this time to bring home what it carries.
HAND_OVER_S = 0.5
OVERTAKEN = "was opened too late, when a file with a greater number was written to"


class Writing(Protocol):
    """What is to be known of a stint.

    over : set when another has taken over; carrying : it has recorded what its medium has not accepted yet
    """

    attempt: Attempt
    part: Part
    over: threading.Event
    carrying: bool
    refused: bool

    def is_alive(self) -> bool:
        """Its thread has not ended."""

    def join(self, timeout: float | None = None) -> None:
        """Wait for that [s]."""


class Succession:
    """The log, what goes into it, and the stint that writes it.

    places  : where the recording can go, the main one first
    turn    : held while something is recorded or marked, never during a call to the medium
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
        self.turn = threading.Lock()
        self.free_mb: float | None = None
        self._places = places
        self._min_free_mb = min_free_mb
        self._machine = StorageMachine([str(place.folder) for place in places], time.monotonic())
        self._deciding = threading.Lock()
        self._call = threading.Lock()  # free when the writer is called: waiting for it costs the least
        self._call.acquire()
        self._stint: Writing | None = None
        self._others: list[Writing] = []  # that try to begin, or have not ended yet
        self._finished = False

    def wake(self) -> None:
        """There is something to write."""
        with contextlib.suppress(RuntimeError):  # it is called already
            self._call.release()

    def await_call(self) -> None:
        """Until somebody calls: the tick, every ``FLUSH_PERIOD_S``, or a buffer; not longer than twice that."""
        self._call.acquire(timeout=2 * FLUSH_PERIOD_S)

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

    def paused(self, seconds: float) -> None:
        """This process stood still for so long, until now."""
        with self._deciding:
            self._machine.paused(time.monotonic(), seconds)

    def state(self) -> tuple[State, str]:
        """State of the storage and a sentence on it; needs no help of a thread that may be stuck."""
        with self._deciding:
            return self._machine.state(time.monotonic())

    def open(self, attempt: Attempt) -> Part:
        """A first file at a place.  Raises StorageError; may take as long as the medium likes."""
        least = self._min_free_mb if attempt.strict else 0.0
        return self.log.open_part(self._places[attempt.place].prepare(least))

    def failed(self, attempt: Attempt, text: str) -> None:
        """An attempt has come to nothing."""
        with self._deciding:
            self._machine.failed(time.monotonic(), attempt.place, text)

    def take_over(self, stint: Writing, part: Part) -> bool:
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

    def _replace(self, before: Writing | None, stint: Writing, part: Part) -> bool:
        with self._deciding:
            if self._finished:
                return False
            if self.log.is_overtaken(part):
                self._machine.failed(time.monotonic(), stint.attempt.place, f"{part.path}: {OVERTAKEN}")
                return False
            if not self._machine.opened(time.monotonic(), stint.attempt.place):
                return False
        self.log.adopt(part)
        self._restart(doubtful=before is None or before.refused or before.carrying)
        if before:
            before.over.set()
        self._stint = stint
        return True

    def released(self, stint: Writing) -> None:
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

    def accepted(self, stint: Writing) -> None:
        """Its medium has taken everything."""
        with self._deciding:
            if stint is self._stint:
                self._machine.accepted(time.monotonic(), stint.part.fault)

    def refused(self, stint: Writing, error: StorageError) -> None:
        """Its medium takes nothing."""
        with self._deciding:
            if stint is self._stint:
                self._machine.refused(time.monotonic(), str(error), full=is_full(error))

    def look(self, stint: Writing) -> None:
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
