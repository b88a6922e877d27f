"""The event loop of everything that sends on time (docs/decisions/0020).

``epoll`` counts its time-out in milliseconds and rounds up, so a sleep of asyncio is up to 1 ms too long.  ``select``
counts in microseconds; here it waits for the one descriptor of the epoll, which is then asked without waiting.
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
#: Another thread gives way to the loop after this time [s]; Python's own 5 ms are later than a message may be.
SWITCH_INTERVAL_S = 0.0005
#: Lowest of the real-time priorities: before every ordinary process, behind whoever has more reason.
PRIORITY = 1
#: Without a second core it would keep the one from whoever reads what is sent.
MIN_CORES = 2


class FineSelector(selectors.EpollSelector):
    """An epoll selector that wakes within some tens of microseconds of its time-out."""

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """As any selector."""
        if timeout is not None and timeout > 0.0:
            if not select.select([self.fileno()], [], [], timeout)[0]:
                return []
            timeout = 0.0
        return super().select(timeout)


@contextlib.contextmanager
def realtime_priority() -> Iterator[None]:
    """The calling thread comes before every ordinary process while the block lasts, where it may ask for that.

    One that has a real-time priority already (``chrt``) keeps its own.  What it starts has none: processes and threads
    begin as ordinary ones (an ordinary user cannot undo that).
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
            os.sched_setscheduler(
                0, usual | os.SCHED_RESET_ON_FORK, parameters
            )  # which an ordinary user cannot take back


def run(main: Coroutine[Any, Any, Result]) -> Result:
    """As ``asyncio.run``, on time: fine sleeps, before others, a collector that leaves what exists now."""
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
