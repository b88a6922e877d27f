"""A hub of the bus that works, for tests."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from fti.bus.frame import SOCKET_NAME
from fti.bus.hub import Hub
from fti.service.supervisor.bus_thread import hub_thread

DEADLINE_S = 20.0


def wait_for(condition: Callable[[], object], what: str) -> None:
    end = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end, f"{what}: not within {DEADLINE_S} s"
        time.sleep(0.01)


class RunningHub:
    """Until ``close``, or as a context.  warnings : of the hub; path : in a directory of its own without one"""

    def __init__(self, path: Path | None = None) -> None:
        self._ending = contextlib.ExitStack()
        folder = self._ending.enter_context(tempfile.TemporaryDirectory(prefix="fti-bus-"))
        self.warnings: list[str] = []
        self.hub = Hub(path or Path(folder) / SOCKET_NAME, self.warnings.append)
        self._ending.enter_context(hub_thread(self.hub, self.warnings.append))

    def __enter__(self) -> RunningHub:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def wait_for_subscribers(self, count: int) -> None:
        """Until the hub knows so many: a subscriber is connected before that."""
        wait_for(lambda: sum(c.outbox is not None for c in [*self.hub._clients]) == count, f"{count} subscribers")

    def close(self) -> None:
        """End it."""
        self._ending.close()
