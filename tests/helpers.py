"""Helpers of tests: ``from tests.helpers import until`` (the repository's root is on pytest's path)."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

ROOT = Path(__file__).resolve().parent.parent
KERNELS = ROOT / ".numba_cache"  # compiled once for all processes of the tests
POLL_S = 0.005
TIMEOUT_S = 60.0  # for a condition; met, it costs nothing

Found = TypeVar("Found")


def fail(error: Exception) -> None:
    """A handler of errors that must not occur."""
    raise error


def until(predicate: Callable[[], Found | None], timeout: float = TIMEOUT_S, what: str = "") -> Found:
    """Poll until the predicate is truthy and return its value; AssertionError with ``what`` after timeout [s]."""
    deadline = time.monotonic() + timeout
    while not (found := predicate()):
        assert time.monotonic() < deadline, f"waited {timeout:g} s for {what or predicate}; last seen: {found!r}"
        time.sleep(POLL_S)
    return found


async def until_async(
    predicate: Callable[[], Found | None],
    timeout: float = TIMEOUT_S,  # noqa: ASYNC109 - asyncio.timeout could not say what was waited for
    what: str = "",
) -> Found:
    """``until`` inside a running loop, which goes on meanwhile."""
    deadline = time.monotonic() + timeout
    while not (found := predicate()):
        assert time.monotonic() < deadline, f"waited {timeout:g} s for {what or predicate}; last seen: {found!r}"
        await asyncio.sleep(POLL_S)
    return found
