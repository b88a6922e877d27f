"""Ctrl-C while the daemon is still loading its libraries."""

from __future__ import annotations

import asyncio
import contextlib
import signal

from fti.interrupts import InterruptHandler
from fti.service.daemon import _stop_on_signals


async def test_an_interrupt_that_a_library_has_swallowed_ends_the_daemon() -> None:
    before = signal.signal(signal.SIGINT, InterruptHandler())
    stops = []
    try:
        with contextlib.suppress(KeyboardInterrupt):  # as a library does
            signal.raise_signal(signal.SIGINT)
        signalled = _stop_on_signals(lambda: stops.append(True))
        await asyncio.sleep(0)
        assert signalled.is_set()
        assert stops == [True]
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().remove_signal_handler(number)
        signal.signal(signal.SIGINT, before)
