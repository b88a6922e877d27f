"""What endpoints share that send a whole message or nothing: a datagram, a CAN frame."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod

from fti.hil.ports.counters import EndpointCounters

RETRY_S = 0.002


class DatagramEndpoint(ABC):
    """Sends by trying.  ``counters`` : what became of it."""

    def __init__(self) -> None:
        self.counters = EndpointCounters()

    @abstractmethod
    def _try_send(self, data: bytes) -> bool:
        """Send one message; false when there is no room now."""

    def send(self, data: bytes) -> None:
        """Send one message, or count it as dropped."""
        if not self._try_send(data):
            self.counters.dropped_messages += 1
            self.counters.dropped_bytes += len(data)

    async def send_all(self, data: bytes) -> None:
        """Send one message; wait while there is no room."""
        while not self._try_send(data):  # noqa: ASYNC110  the kernel does not tell when there is room
            await asyncio.sleep(RETRY_S)
