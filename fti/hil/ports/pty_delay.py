"""Measures the delay of bytes through a pty in this machine's kernel.

The emulator has real-time priority and is on time on an overloaded computer, but the kernel worker that transports the
bytes is not.  One byte through a separate pty, 25 times a second, measures its delay.
"""

from __future__ import annotations

import asyncio
import os
import termios
import tty
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Self

from fti.constants import SECOND_NS

PERIOD_S = 0.04
#: Longer delays are reported [ns].
LATE_NS = SECOND_NS // 10


class PtyDelay:
    """A stream of the scheduler that calls ``notify`` with send and arrival time (FTI time) of each late byte.

    now_ns : FTI time; end_s : end of the stream [s of the flight].  A context manager, used in a running event loop.
    """

    def __init__(self, now_ns: Callable[[], int], end_s: float, notify: Callable[[int, int], None]) -> None:
        self._now_ns, self._end_s, self._notify = now_ns, end_s, notify
        self._k = 0
        self._master = self._slave = -1
        self._sent: deque[int] = deque()

    def __enter__(self) -> Self:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave, termios.TCSANOW)
        os.set_blocking(self._master, False)
        os.set_blocking(self._slave, False)
        asyncio.get_running_loop().add_reader(self._slave, lambda: self._check_delay(len(os.read(self._slave, 4096))))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        asyncio.get_running_loop().remove_reader(self._slave)
        self._check_delay(len(self._sent))  # bytes that have not arrived by the end of the flight
        os.close(self._master)
        os.close(self._slave)

    def due_s(self) -> float | None:
        """Time of the next byte."""
        due_s = self._k * PERIOD_S
        return due_s if due_s <= self._end_s else None

    async def send(self) -> None:
        """Send the byte."""
        self._k += 1
        os.write(self._master, b".")
        self._sent.append(self._now_ns())

    def _check_delay(self, count: int) -> None:
        """Handle the arrival of the oldest bytes; of several at once the oldest has the largest delay."""
        sent = [self._sent.popleft() for _ in range(min(count, len(self._sent)))]
        now_ns = self._now_ns()
        if sent and now_ns - sent[0] > LATE_NS:
            self._notify(sent[0], now_ns)
