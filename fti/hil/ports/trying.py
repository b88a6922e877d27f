"""What endpoints share that send a whole message or nothing: a datagram, a CAN frame."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod

from fti.hil.ports.sent import Sent

RETRY_S = 0.002


class TryingEndpoint(ABC):
    """Sends by trying.  ``sent`` : what became of it."""

    def __init__(self) -> None:
        self.sent = Sent()

    @abstractmethod
    def _try(self, data: bytes) -> bool:
        """Send one message; false when there is no room now."""

    def send(self, data: bytes) -> None:
        """Send one message, or count it as dropped."""
        if not self._try(data):
            self.sent.dropped_messages += 1
            self.sent.dropped_bytes += len(data)

    async def send_all(self, data: bytes) -> None:
        """Send one message; wait while there is no room."""
        while not self._try(data):  # noqa: ASYNC110  the kernel does not tell when there is room
            await asyncio.sleep(RETRY_S)
