"""Shared by ``fti watch`` and ``fti preflight``: the state of a running daemon from its bus."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from fti.bus.frame import SOCKET_NAME
from fti.clock import SystemClock
from fti.errors import MissingError
from fti.run_directory import DaemonInfo
from fti.service.display.bus_feed import subscribe
from fti.web.live_state import LiveState

#: Every output comes at 2 Hz or more, health at 2 Hz.
COLLECT_S = 1.2
HEALTH_TIMEOUT_S = 5.0

State = dict[str, Any]


@contextlib.contextmanager
def live_states(info: DaemonInfo, who: str) -> Iterator[Callable[[], State]]:
    """A function that returns the present state of a daemon: health, outputs, alarms, events.

    who : name of the subscriber.  Raises MissingError when no health arrives.
    """
    clock = SystemClock(0)
    live = LiveState(clock.now_ns())
    subscriber = subscribe(live, Path(info.sock).with_name(SOCKET_NAME), who, clock)
    try:
        _collect(lambda: live.state(clock.now_ns()), info.name)
        yield lambda: live.state(clock.now_ns())
    finally:
        subscriber.close()


def _collect(read: Callable[[], State], name: str) -> None:
    """Wait until every output and health have arrived."""
    begin = time.monotonic()
    while (waited := time.monotonic() - begin) < COLLECT_S or read()["health"] is None:
        if waited > HEALTH_TIMEOUT_S:
            raise MissingError(f"the daemon {name} has published no health for {HEALTH_TIMEOUT_S:g} s")
        time.sleep(0.05)
