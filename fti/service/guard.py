"""The guard: the one place that catches everything.

Every link task, writer loop, decoder call and handler runs under it.  A failure is reported and counted, and only the
unit that failed starts again; its neighbours never notice.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager

Report = Callable[[str, Exception], None]

FIRST_DELAY_S = 0.1
LONGEST_DELAY_S = 5.0


@contextmanager
def guarded(unit: str, report: Report) -> Iterator[None]:
    """Run the body; a failure is handed to ``report(unit, error)`` and goes no further."""
    try:
        yield
    except Exception as error:
        report(unit, error)


async def keep_running(unit: str, make: Callable[[], Awaitable[None]], report: Report) -> None:
    """Run ``make()`` until it returns; after a failure run it again, with growing delays."""
    delay = FIRST_DELAY_S
    while True:
        with guarded(unit, report):
            await make()
            return
        await asyncio.sleep(delay)
        delay = min(2 * delay, LONGEST_DELAY_S)
