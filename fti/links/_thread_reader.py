"""A thread that reads a CAN bus for which the loop cannot wait."""

from __future__ import annotations

import asyncio
import threading
from collections import deque
from collections.abc import Callable

import can

from fti.clock import Clock

WAIT_S = 0.05
FINISH_S = 2.0


class ThreadReader:
    """One thread that waits for frames of a bus without a descriptor and hands them to the loop, stamped.

    It is the only one that reads the bus: a second one would change their order.
    """

    def __init__(
        self,
        bus: can.BusABC,
        clock: Clock,
        on_message: Callable[[can.Message, int], object],
        on_error: Callable[[Exception], object],
        name: str,
    ) -> None:
        self._bus = bus
        self._clock = clock
        self._on_message = on_message
        self._on_error = on_error
        self._loop = asyncio.get_running_loop()
        self._received: deque[tuple[can.Message, int]] = deque()
        self._stopping = threading.Event()
        self._finishing = threading.Event()
        self._thread = threading.Thread(target=self._read, name=f"fti-can-{name}", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        while not self._stopping.is_set():
            try:
                message = self._bus.recv(timeout=0 if self._finishing.is_set() else WAIT_S)
            except Exception as error:  # noqa: BLE001  a vendor's driver may raise anything, and must be read on
                self._loop.call_soon_threadsafe(self._on_error, error)
                self._stopping.wait(WAIT_S)
                continue
            if message is not None:
                self._received.append((message, self._clock.now_ns()))
                self._loop.call_soon_threadsafe(self.deliver)
            elif self._finishing.is_set():
                return

    def deliver(self) -> None:
        """In the loop: what the thread has read."""
        while self._received:
            self._on_message(*self._received.popleft())

    def finish(self) -> None:
        """Outside the loop: wait until the thread has read what the bus holds, and has ended."""
        self._finishing.set()
        self._thread.join(timeout=FINISH_S)

    def stop(self) -> None:
        """End the thread; takes one wait at most, more only when a driver ignores its time limit."""
        self._stopping.set()
        self._thread.join(timeout=20 * WAIT_S)
        self.deliver()
