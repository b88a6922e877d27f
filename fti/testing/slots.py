"""Limit of simultaneous flights on this machine: real-time flights that share too few cores are late."""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from collections.abc import Iterator
from pathlib import Path

POLL_S = 0.2
#: Cores of a flight: for emulator, recorder and the unit under test.
CORES_OF_A_FLIGHT = 2


class FlightSlots:
    """Locks in a folder that all test processes of a run share.  count : flights at a time; None : by the cores."""

    def __init__(self, folder: Path, count: int | None = None) -> None:
        cores = len(os.sched_getaffinity(0))
        self._folder, self.count = folder, count or max(1, cores // CORES_OF_A_FLIGHT)
        self._holders = 0

    @contextlib.contextmanager
    def hold(self) -> Iterator[None]:
        """Wait for a free slot and hold it; the kernel frees it when this process ends.

        A test with two simultaneous benches has one slot for both; otherwise it would wait for itself.
        """
        with self._one() if not self._holders else contextlib.nullcontext():
            self._holders += 1
            try:
                yield
            finally:
                self._holders -= 1

    @contextlib.contextmanager
    def _one(self) -> Iterator[None]:
        self._folder.mkdir(parents=True, exist_ok=True)
        with contextlib.ExitStack() as stack:
            files = [stack.enter_context((self._folder / f"slot_{i}.lock").open("w")) for i in range(self.count)]
            while not any(_try_lock(file.fileno()) for file in files):
                time.sleep(POLL_S)
            yield


def _try_lock(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
