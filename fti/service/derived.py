"""The derived file of the navigation process, on a thread of its own: a slow medium must not delay an output."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from fti.errors import StorageError
from fti.logger.derived_log import DerivedLog
from fti.service.guard import Report, guarded
from fti.types import Event, Measurement, Output

FLUSH_PERIOD_S = 0.05
SYNC_PERIOD_S = 1.0
#: Outputs and measurements that may wait for the medium: several minutes of them; beyond, the oldest go, counted.
MOST_WAITING = 200_000


class DerivedWriter:
    """Takes what navigation makes and writes it in order.  ``lost`` counts what the medium did not take in time."""

    def __init__(self, log: DerivedLog, min_free_mb: float, report: Report) -> None:
        self._log = log
        self._min_free_mb = min_free_mb
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
        """Queue a measurement."""
        self._put(lambda: self._log.measurement(device, measurement))

    def output(self, output: Output | Event) -> None:
        """Queue an output or an event."""
        self._put(lambda: self._log.output(output))

    def gap(self, t_ns: int, content: dict[str, Any]) -> None:
        """Queue a note on what navigation did not see."""
        self._put(lambda: self._log.gap(t_ns, content))

    def note(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        """Queue what is known besides, ``/fti/device_clock``."""
        self._put(lambda: self._log.note(topic, t_ns, content))

    def close(self) -> None:
        """Write what waits, close the file and end the thread."""
        self._stopping.set()
        self._thread.join()

    def _put(self, write: Callable[[], None]) -> None:
        if len(self._waiting) >= MOST_WAITING:
            self._waiting.popleft()
            self.lost += 1
        self._waiting.append(write)

    def _run(self) -> None:
        synced = time.monotonic()
        while not self._stopping.wait(FLUSH_PERIOD_S):
            due = time.monotonic() - synced >= SYNC_PERIOD_S
            synced = time.monotonic() if due else synced
            with guarded("derived file", self._report):
                self._step(due)
        with guarded("derived file", self._report):
            self._step(due=False)
            self._log.close()

    def _step(self, due: bool) -> None:
        """Write what waits; when space runs out this file stops first, so that the raw bytes have what is left."""
        try:
            if self._log.free_mb() < self._min_free_mb:
                self.fault = f"less than session.min_free_mb = {self._min_free_mb:g} is left for {self._log.path}"
                return
            while self._waiting:
                self._waiting.popleft()()
            self._log.flush()
            if due:
                self._log.sync()
        except StorageError as error:
            self.fault = str(error)
        else:
            self.fault = self._log.fault
