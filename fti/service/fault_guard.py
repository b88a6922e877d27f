"""The fault guard: the only place that catches all exceptions.

Every link task, writer loop, decoder call and handler runs under it.  A failure is reported and counted, and only the
failed unit is restarted.
"""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
from types import TracebackType

FailureHandler = Callable[[str, Exception], None]
#: Level, source and text of an event.
ReportEvent = Callable[[str, str, str], None]

FIRST_DELAY_S = 0.1
MAX_DELAY_S = 5.0
#: Exceptions that end a program or a task on purpose; a group may contain one of them.
EXIT_EXCEPTIONS = (KeyboardInterrupt, SystemExit, GeneratorExit, asyncio.CancelledError, BaseExceptionGroup)


class Panic(Exception):
    """A failure that is not an Exception, such as the panic of a Rust library; text: its class and message."""


class Guard(ABC):
    """A context manager that suppresses failures.  A class for speed: navigation enters it for each measurement."""

    __slots__ = ()

    @abstractmethod
    def report(self, error: Exception) -> None:
        """Report a failure."""

    def __enter__(self) -> Guard:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if error is None or (isinstance(error, EXIT_EXCEPTIONS) and not isinstance(error, Exception)):
            return False
        self.report(error if isinstance(error, Exception) else Panic(f"{type(error).__name__}: {error}"))
        return True


class _ReportingGuard(Guard):
    __slots__ = ("_report", "_unit")

    def __init__(self, unit: str, report: FailureHandler) -> None:
        self._unit, self._report = unit, report

    def report(self, error: Exception) -> None:
        self._report(self._unit, error)


def catch_failures(unit: str, report: FailureHandler) -> Guard:
    """Run the body; a failure is passed to ``report(unit, error)`` and suppressed."""
    return _ReportingGuard(unit, report)


async def keep_running(unit: str, make: Callable[[], Awaitable[None]], report: FailureHandler) -> None:
    """Run ``make()`` until it returns; after a failure run it again, with increasing delays."""
    delay = FIRST_DELAY_S
    while True:
        with catch_failures(unit, report):
            await make()
            return
        await asyncio.sleep(delay)
        delay = min(2 * delay, MAX_DELAY_S)
