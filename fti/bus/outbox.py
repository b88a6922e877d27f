"""Bounded message queue of one reader, so that a slow reader does not affect the others.

A fast reader gets every message in order.  When more than ``MAX_FRAMES`` or ``MAX_BYTES`` are queued, only all events
and the newest message of each other topic are kept (``replaced`` counts the others); if that is still too much, the
oldest are dropped (``lost``).
"""

from __future__ import annotations

from collections import deque

from fti.bus.frame import EVENT, BusFrame

MAX_FRAMES = 1024
MAX_BYTES = 8 * 2**20
#: Maximum size of one send call.
SEND_BYTES = 2**16


class Outbox:
    """replaced : messages replaced by a newer one of their topic; lost : messages dropped without a newer one"""

    def __init__(self) -> None:
        self._frames: deque[BusFrame] = deque()
        self._bytes = 0
        self._rest = b""  # rest of a partly sent chunk
        self.replaced = 0
        self.lost = 0

    def __bool__(self) -> bool:
        return bool(self._rest or self._frames)

    def __len__(self) -> int:
        return len(self._frames)

    def add(self, frame: BusFrame) -> None:
        """Queue a message."""
        self._frames.append(frame)
        self._bytes += len(frame.raw)
        if self._is_full():
            self._keep_newest()
            while self._is_full(2):  # by half, so that this is rare
                self._bytes -= len(self._frames.popleft().raw)
                self.lost += 1

    def _is_full(self, share: int = 1) -> bool:
        return len(self._frames) > MAX_FRAMES // share or self._bytes > MAX_BYTES // share

    def _keep_newest(self) -> None:
        newest = {frame.topic: n for n, frame in enumerate(self._frames)}
        remaining = [f for n, f in enumerate(self._frames) if f.topic == EVENT or newest[f.topic] == n]
        self.replaced += len(self._frames) - len(remaining)
        self._frames = deque(remaining)
        self._bytes = sum(len(frame.raw) for frame in remaining)

    def next_bytes(self) -> bytes:
        """The next bytes to send; return unsent bytes with ``keep_unsent``."""
        parts, size, self._rest = [self._rest], len(self._rest), b""
        while self._frames and size < SEND_BYTES:
            raw = self._frames.popleft().raw
            self._bytes -= len(raw)
            size += len(raw)
            parts.append(raw)
        return b"".join(parts)

    def keep_unsent(self, rest: bytes) -> None:
        """Store unsent bytes of ``next_bytes``."""
        self._rest = rest
