"""Base class of endpoints that send a whole message or nothing: datagrams and CAN frames."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod

from fti.hil.ports.counters import EndpointCounters

RETRY_S = 0.002


class DatagramEndpoint(ABC):
    """Sends each message with a non-blocking call.  counters : sent and dropped messages"""

    def __init__(self) -> None:
        self.counters = EndpointCounters()

    @abstractmethod
    def _try_send(self, data: bytes) -> bool:
        """Send one message; False when the queue is full."""

    def send(self, data: bytes) -> None:
        """Send one message, or count it as dropped."""
        if not self._try_send(data):
            self.counters.dropped_messages += 1
            self.counters.dropped_bytes += len(data)

    async def send_all(self, data: bytes) -> None:
        """Send one message; wait while the queue is full."""
        while not self._try_send(data):  # noqa: ASYNC110  the kernel does not signal free space
            await asyncio.sleep(RETRY_S)
