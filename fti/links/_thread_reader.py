"""A thread that reads a CAN bus without a file descriptor."""

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
    """A thread that reads frames of a bus without a file descriptor and hands them to the loop with their stamps.

    It is the only reader of the bus: a second one would change the order.
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
            except Exception as error:  # noqa: BLE001  a vendor's driver may raise anything; keep reading
                self._loop.call_soon_threadsafe(self._on_error, error)
                self._stopping.wait(WAIT_S)
                continue
            if message is not None:
                self._received.append((message, self._clock.now_ns()))
                self._loop.call_soon_threadsafe(self.deliver)
            elif self._finishing.is_set():
                return

    def deliver(self) -> None:
        """Pass on the frames of the thread; called in the loop."""
        while self._received:
            self._on_message(*self._received.popleft())

    def finish(self) -> None:
        """Wait until the thread has read the remaining frames and ended; called outside the loop."""
        self._finishing.set()
        self._thread.join(timeout=FINISH_S)

    def stop(self) -> None:
        """Stop the thread; takes WAIT_S at most, longer only if a driver ignores its timeout."""
        self._stopping.set()
        self._thread.join(timeout=20 * WAIT_S)
        self.deliver()
