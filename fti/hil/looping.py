"""The event loop of everything that sends on time (docs/decisions/0020).

``epoll`` counts its time-out in milliseconds and rounds up, so a sleep of asyncio is up to 1 ms too long.  ``select``
counts in microseconds; here it waits for the one descriptor of the epoll, which is then asked without waiting.
"""

from __future__ import annotations

import asyncio
import gc
import select
import selectors
import sys
from collections.abc import Coroutine
from typing import Any, TypeVar

Result = TypeVar("Result")
#: Another thread gives way to the loop after this time [s]; Python's own 5 ms are later than a message may be.
GIVE_WAY_S = 0.0005


class FineSelector(selectors.EpollSelector):
    """An epoll selector that wakes within some tens of microseconds of its time-out."""

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """As any selector."""
        if timeout is not None and timeout > 0.0:
            select.select([self.fileno()], [], [], timeout)
            timeout = 0.0
        return super().select(timeout)


def run(main: Coroutine[Any, Any, Result]) -> Result:
    """As ``asyncio.run``, on time: fine sleeps, threads that give way, a collector that leaves what exists now."""
    gc.collect()
    gc.freeze()
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(GIVE_WAY_S)
    try:
        with asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(FineSelector())) as runner:
            return runner.run(main)
    finally:
        sys.setswitchinterval(before_s)
        gc.unfreeze()
