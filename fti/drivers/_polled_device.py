"""The emulator's side of a device that sends only on request."""

from __future__ import annotations

MAX_HELD_BYTES = 256


class PolledDevice:
    """Answers every request with the last message; without a request, sends messages at once."""

    def __init__(self, request: bytes) -> None:
        self._request = request
        self._last: list[bytes] = []
        self._pending = b""

    def offer(self, messages: list[bytes]) -> list[bytes]:
        """The messages to send now."""
        if not self._request:
            return messages
        self._last = messages or self._last
        return []

    def respond(self, data: bytes) -> list[bytes]:
        """Answers to the requests that these bytes complete."""
        if not self._request:
            return []
        *requests, rest = (self._pending + data).split(self._request)
        self._pending = rest[-MAX_HELD_BYTES:]
        return self._last * len(requests)
