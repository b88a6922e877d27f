"""The thread of the supervisor that runs the hub of the bus."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator

from fti.bus.hub import Hub, Warn
from fti.service.fault_guard import catch_failures

#: Pause after a failure of the hub.
PAUSE_S = 0.5


@contextlib.contextmanager
def hub_thread(hub: Hub, warn: Warn) -> Iterator[None]:
    """Run the hub during the block, then close it.  warn : receives its failures, in its thread"""
    thread = threading.Thread(target=_serve, args=(hub, warn), name="fti-bus")
    thread.start()
    try:
        yield
    finally:
        hub.end()
        thread.join()
        hub.close()


def _serve(hub: Hub, warn: Warn) -> None:
    while not hub.is_ending:
        with catch_failures("bus", lambda unit, error: warn(f"{type(error).__name__}: {error}")):
            hub.serve()
            return
        time.sleep(PAUSE_S)
