"""Writes the derived file of the navigation process in its own thread, so that a slow medium delays no output.

The file is on the main storage target if that has space, otherwise on the fallback.  When a target fails or is gone,
its file is abandoned, so that the medium can be remounted.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence

from fti.errors import StorageError
from fti.logger.derived_log import DerivedLog
from fti.logger.log_segment import LogSegment
from fti.logger.storage_target import StorageTarget
from fti.messages.measurements import Measurement
from fti.messages.notes import NavigationNote
from fti.messages.outputs import Event, Output
from fti.messages.tables import without_arrays
from fti.service.fault_guard import FailureHandler, catch_failures

FLUSH_PERIOD_S = 0.05
SYNC_PERIOD_S = 1.0
#: Maximum number of queued outputs and measurements (at least a minute, 30 MB); then the oldest are lost, counted.
MAX_QUEUED = 40_000
#: A file that cannot be written for this time is abandoned [s]; retry period of the storage targets [s].
WRITE_TIMEOUT_S = 1.0
RETRY_PERIOD_S = 5.0


class DerivedWriter:
    """Queues the results of navigation and writes them in order.  ``lost`` counts those not written in time."""

    def __init__(
        self, log: DerivedLog, targets: Sequence[StorageTarget], min_free_mb: float, report: FailureHandler
    ) -> None:
        self._log = log
        self._targets = targets
        self._min_free_mb = min_free_mb
        self._segment: LogSegment | None = None
        self._unflushed = 0
        self._refused_since: float | None = None
        self._next_retry_s = 0.0
        self._report = report
        self._waiting: deque[Callable[[], None]] = deque()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="derived")
        self.lost = 0
        self.fault: str | None = None

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def measurement(self, device: str, measurement: Measurement) -> None:
        """Queue a measurement, if the file records it (decimation)."""
        if self._log.is_due(device, measurement):
            recorded = without_arrays(measurement)  # the queue must not hold them
            self._put(lambda: self._log.write_undecimated(device, recorded))

    def output(self, output: Output | Event) -> None:
        """Queue an output or an event."""
        self._put(lambda: self._log.write_output(output))

    def note(self, note: NavigationNote) -> None:
        """Queue a note."""
        self._put(lambda: self._log.write_note(note))

    def close(self) -> None:
        """Write the queue, close the file and end the thread."""
        self._stopping.set()
        self._thread.join()

    def _put(self, write: Callable[[], None]) -> None:
        if len(self._waiting) >= MAX_QUEUED:
            self._waiting.popleft()
            self.lost += 1
        self._waiting.append(write)

    def _run(self) -> None:
        synced = time.monotonic()
        while not self._stopping.wait(FLUSH_PERIOD_S):
            due = time.monotonic() - synced >= SYNC_PERIOD_S
            synced = time.monotonic() if due else synced
            with catch_failures("derived file", self._report):
                self._step(due)
        with catch_failures("derived file", self._report):
            self._step(due=False)
            if self._segment:
                self._segment.close()

    def _step(self, due: bool) -> None:
        try:
            segment = self._find_part()
            if segment is None:
                return
            segment.flush()  # data that were refused before
            self._unflushed = 0
            while self._waiting:
                self._waiting.popleft()()
                self._unflushed += 1
            segment.flush()
            self._unflushed = 0
            if due:
                segment.sync()
                if segment.find_lost_file():
                    self._abandon(segment)
        except StorageError as error:
            self.fault = str(error)
            self._refused_since = self._refused_since or time.monotonic()
            if self._segment and time.monotonic() - self._refused_since > WRITE_TIMEOUT_S:
                self._abandon(self._segment)
        else:
            self._refused_since = None
            self.fault = segment.fault

    def _find_part(self) -> LogSegment | None:
        """The segment to write to; None without space: the remaining space is reserved for the raw file."""
        if self._segment and self._segment.free_mb() < self._min_free_mb:
            self.fault = f"less than session.min_free_mb = {self._min_free_mb:g} is left for {self._segment.path}"
            if len(self._targets) == 1:
                return None  # it continues when there is space again
            self._abandon(self._segment)
        at_main = self._segment is not None and self._segment.folder.path == self._targets[0].folder
        if not at_main and time.monotonic() >= self._next_retry_s:
            self._next_retry_s = time.monotonic() + RETRY_PERIOD_S
            self._open()
        return self._segment

    def _open(self) -> None:
        """Open a segment at the first target with space, if that is better than the present one."""
        for target in self._targets:
            if self._segment and target.folder == self._segment.folder.path:
                return
            try:
                segment = self._log.open_segment(target.prepare(self._min_free_mb))
            except StorageError as error:
                self.fault = str(error)
            else:
                self._log.switch_to(segment)
                before, self._segment = self._segment, segment
                if before:
                    before.close()
                return

    def _abandon(self, segment: LogSegment) -> None:
        """Abandon the file; unflushed data are lost.  It is closed if the medium permits."""
        with contextlib.suppress(StorageError):
            segment.close()
        self._segment = self._refused_since = None
        self.lost += self._unflushed
        self._unflushed = 0
