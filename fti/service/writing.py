"""The writer thread of the recorder: from the triple buffers into the MCAP file.

It wakes when a buffer passes its threshold or the flush period ends.  What it has taken from a buffer counts as
written only after the medium has accepted it; while the medium refuses, the buffers fill, and their own rule decides
what is lost and counts it.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Sequence
from typing import Any

from fti.errors import StorageError
from fti.logger.raw_log import RawLog
from fti.service.guard import Report, guarded
from fti.service.source import Source

FLUSH_PERIOD_S = 0.02
SYNC_PERIOD_S = 1.0
RETRY_S = 0.2
#: At the end, a medium that refuses for so long gets no more chances.
LAST_CHANCE_S = 5.0


class Writer:
    """Owns the log.  ``storage_fault`` is None or the sentence that the medium refuses with."""

    def __init__(self, log: RawLog, sources: Sequence[Source], report: Report) -> None:
        self._log = log
        self._sources = sources
        self._report = report
        self._notes: deque[tuple[str, int, dict[str, Any]]] = deque()
        self._wake = threading.Event()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="writer")
        self._synced = self._accepted = time.monotonic()
        self.storage_fault: str | None = None

    @property
    def silence_s(self) -> float:
        """Time since the medium took bytes last [s]."""
        return time.monotonic() - self._accepted

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def wake(self) -> None:
        """A buffer has passed its threshold."""
        self._wake.set()

    def note(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        """Record a JSON message with the next flush."""
        self._notes.append((topic, t_ns, content))

    def stop(self) -> None:
        """Write what the buffers hold and end the thread; the log stays open for last notes."""
        self._stopping.set()
        self._wake.set()
        self._thread.join()

    def finish(self) -> None:
        """Record the last notes and close the file; after ``stop``."""
        with guarded("storage", self._report):
            self._record_notes()
            self._log.close()

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._wake.wait(FLUSH_PERIOD_S)
            self._wake.clear()
            with guarded("writer", self._report):
                self._step()
        with guarded("writer", self._report):
            self._drain()

    def _step(self) -> None:
        """Carry over what the buffers hand out."""
        for source in self._sources:
            source.record_all()
        self._record_notes()
        self._persist()
        for source in self._sources:
            source.mark_written()

    def _record_notes(self) -> None:
        while self._notes:
            note = self._notes.popleft()
            with guarded("note", self._report):
                self._log.json(*note)

    def _persist(self) -> None:
        """Flush until the medium has accepted it; sync once a second."""
        give_up = None
        while True:
            try:
                self._log.flush()
                self._accepted = time.monotonic()
                self._sync_when_due()
            except StorageError as error:
                self.storage_fault = str(error)
                if self._stopping.is_set():
                    give_up = give_up or time.monotonic() + LAST_CHANCE_S
                    if time.monotonic() > give_up:
                        raise
                time.sleep(RETRY_S)
            else:
                self.storage_fault = self._log.fault
                return

    def _sync_when_due(self) -> None:
        if time.monotonic() - self._synced >= SYNC_PERIOD_S:
            self._log.sync()
            self._synced = time.monotonic()

    def _drain(self) -> None:
        """Until nothing is left: a buffer that is being looked at hands out nothing for a moment."""
        while not all(source.buffer.empty for source in self._sources):
            self._step()
