"""The guard: the one place that catches everything.

Every link task, writer loop, decoder call and handler runs under it.  A failure is reported and counted, and only the
unit that failed starts again; its neighbours never notice.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
from types import TracebackType

FailureHandler = Callable[[str, Exception], None]

FIRST_DELAY_S = 0.1
MAX_DELAY_S = 5.0
#: What ends a program or a task on purpose.  A group may hold one of them.
EXIT_EXCEPTIONS = (KeyboardInterrupt, SystemExit, GeneratorExit, asyncio.CancelledError, BaseExceptionGroup)


class Panic(Exception):
    """A failure that is no Exception, as the panic of a library in Rust; in words, with its class."""


class Guard(ABC):
    """A context that no failure leaves.  No generator: navigation enters one for each measurement."""

    __slots__ = ()

    @abstractmethod
    def report(self, error: Exception) -> None:
        """Told of a failure."""

    def __enter__(self) -> Guard:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if isinstance(error, Exception):
            self.report(error)
        elif error is None or isinstance(error, EXIT_EXCEPTIONS):
            return False
        else:
            self.report(Panic(f"{type(error).__name__}: {error}"))
        return True


class _ReportingGuard(Guard):
    __slots__ = ("_report", "_unit")

    def __init__(self, unit: str, report: FailureHandler) -> None:
        self._unit, self._report = unit, report

    def report(self, error: Exception) -> None:
        self._report(self._unit, error)


def catch_failures(unit: str, report: FailureHandler) -> Guard:
    """Run the body; a failure is handed to ``report(unit, error)`` and goes no further."""
    return _ReportingGuard(unit, report)


async def keep_running(unit: str, make: Callable[[], Awaitable[None]], report: FailureHandler) -> None:
    """Run ``make()`` until it returns; after a failure run it again, with growing delays."""
    delay = FIRST_DELAY_S
    while True:
        with catch_failures(unit, report):
            await make()
            return
        await asyncio.sleep(delay)
        delay = min(2 * delay, MAX_DELAY_S)
