"""What ``fti hil`` and ``fti replay`` share: run until the end or a signal, say when ready, report."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Awaitable, Callable

from fti.hil.report import Report


async def until_stopped(
    play: Callable[[asyncio.Event], Awaitable[Report]], ready: asyncio.Event
) -> tuple[Report, bool]:
    """Run ``play(stop)``; print "ready" when the ports exist.  Returns the report, and whether a signal ended it."""
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for name in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(name, stop.set)
    announcing = asyncio.create_task(_announce(ready), name="fti-hil-ready")
    try:
        report = await play(stop)
    finally:
        announcing.cancel()
    return report, stop.is_set()


async def _announce(ready: asyncio.Event) -> None:
    await ready.wait()
    print("ready", flush=True)


def print_report(report: Report) -> None:
    """What was sent on each link, what was lost, and how late it was."""
    for name, sent in sorted(report.links.items()):
        lost = f", {sent.dropped_messages} dropped (nobody read)" if sent.dropped_messages else ""
        print(f"{name:20} {sent.messages} messages, {sent.bytes} bytes{lost}")
    late = report.lateness
    print(
        f"lateness of {late.messages} messages: p50 {late.p50_ms:.2f}, p99 {late.p99_ms:.2f}, max {late.max_ms:.2f} ms"
    )
