"""The event loop of emulator and replay, with precise sleeps (docs/decisions/0020).

``epoll`` counts its time-out in milliseconds and rounds up, so a sleep of asyncio is up to 1 ms too long.  ``select``
counts in microseconds: it waits for the descriptor of the epoll, which is then polled without waiting.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import os
import select
import selectors
import sys
from collections.abc import Coroutine, Iterator
from typing import Any, TypeVar

Result = TypeVar("Result")
#: Another thread yields the interpreter lock after this time [s]; Python's default of 5 ms makes messages late.
SWITCH_INTERVAL_S = 0.0005
#: Lowest of the real-time priorities.
PRIORITY = 1
#: On a single core, real-time priority would keep the receiver from running.
MIN_CORES = 2


class FineSelector(selectors.EpollSelector):
    """An epoll selector that wakes within some tens of microseconds of its time-out."""

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """See ``selectors.BaseSelector``."""
        if timeout is not None and timeout > 0.0:
            if not select.select([self.fileno()], [], [], timeout)[0]:
                return []
            timeout = 0.0
        return super().select(timeout)


@contextlib.contextmanager
def realtime_priority() -> Iterator[None]:
    """Give the calling thread real-time priority while the block lasts, if the user is allowed to set it.

    A thread that has a real-time priority already (``chrt``) keeps it.  Processes and threads that it starts have
    ordinary priority.
    """
    usual, parameters = os.sched_getscheduler(0) | os.SCHED_RESET_ON_FORK, os.sched_getparam(0)
    ordinary = usual & ~os.SCHED_RESET_ON_FORK not in (os.SCHED_FIFO, os.SCHED_RR)
    if ordinary and len(os.sched_getaffinity(0)) >= MIN_CORES:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            # an ordinary user cannot clear the flag
            os.sched_setscheduler(0, usual | os.SCHED_RESET_ON_FORK, parameters)


def run(main: Coroutine[Any, Any, Result]) -> Result:
    """As ``asyncio.run``, with precise sleeps, real-time priority, and existing objects frozen for the collector."""
    gc.collect()
    gc.freeze()
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    try:
        with (
            realtime_priority(),
            asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(FineSelector())) as runner,
        ):
            return runner.run(main)
    finally:
        sys.setswitchinterval(before_s)
        gc.unfreeze()
