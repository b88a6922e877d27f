"""Tasks for worker processes in tests of studies; the module imports nothing else, so processes start fast."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path


def square(x: int) -> tuple[int, int, str | None]:
    """Its square, its process, and the threads of its linear algebra."""
    time.sleep(0.05 if x == 0 else 0.0)  # the first is not the first to be done
    return x * x, os.getpid(), os.environ.get("OPENBLAS_NUM_THREADS")


def raise_on_third(x: int, error: type[Exception]) -> int:
    """Task whose third run raises an error."""
    if x == 3:
        raise error("the third")
    return x


def kill_on_second(x: int) -> int:
    """Task whose second run ends its process."""
    if x == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return x


def wait_minute(file: str, x: int) -> None:
    """Wait a minute after writing the process number to a file."""
    with Path(file).open("a", encoding="ascii") as out:
        out.write(f"{os.getpid()}\n")
    time.sleep(60.0)
