"""Detects standstills of the machine: a process on each core that only sleeps, with the highest priority.

    python -m benchmarks.parts.standstill CORE      until its input ends; then it prints the standstills as JSON

The host of a virtual machine stops it for some milliseconds now and then.  All its processes are late then.  A process
with the highest priority (SCHED_FIFO) and without work is late only then, which separates a standstill from slow code.
Without the right to that priority nothing is measured and every delay counts.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import time
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Wake period, and tolerated delay [s].
PERIOD_S, LATE_S = 0.001, 0.0005
#: Time to work off the backlog of a standstill, over its length, for a process that needs half a core.
RECOVERY_FACTOR = 1.0


class Standstill:
    """Watches all cores; use it as a context."""

    def __enter__(self) -> Standstill:
        command = [sys.executable, "-m", "benchmarks.parts.standstill"]
        options: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        self._watching = [subprocess.Popen([*command, str(core)], **options) for core in os.sched_getaffinity(0)]
        self._spans = np.empty((0, 2))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        found = [json.loads(process.communicate()[0] or "[]") for process in self._watching]
        self._spans = np.array([span for spans in found for span in spans]).reshape(-1, 2)

    def is_exempt(self, due: Array) -> NDArray[np.bool_]:
        """Which instants (time.monotonic [s]) lie in a standstill or its work-off time.  Call it after the context."""
        exempt = np.zeros(len(due), dtype=bool)
        for begin, end in self._spans:
            exempt |= (due >= begin) & (due <= end + RECOVERY_FACTOR * (end - begin))
        return exempt

    def share(self, begin: float, end: float) -> float:
        """Share of the time from begin to end in which a core stood still, mean of all cores."""
        lost = np.clip(np.minimum(self._spans[:, 1], end) - np.maximum(self._spans[:, 0], begin), 0.0, None)
        return float(lost.sum()) / len(self._watching) / (end - begin)


def watch(core: int) -> list[tuple[float, float]]:
    """Sleep until the input ends; returns begin and end of each delay."""
    os.sched_setaffinity(0, {core})
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    except PermissionError:
        print("no right to SCHED_FIFO: standstills of the machine count as lateness", file=sys.stderr)
        return []
    spans, due = [], time.monotonic() + PERIOD_S
    while not _is_input_ended():
        time.sleep(max(0.0, due - time.monotonic()))
        now = time.monotonic()
        if now - due > LATE_S:
            spans.append((due, now))
        due = now + PERIOD_S
    return spans


def _is_input_ended() -> bool:
    return bool(select.select([sys.stdin], [], [], 0.0)[0])


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        print(json.dumps(watch(int(sys.argv[1]))))
