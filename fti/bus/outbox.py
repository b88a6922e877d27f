"""What waits for one reader: bounded, so that one that reads slowly costs the others nothing.

While it keeps up it gets every message in order.  When more than ``MAX_FRAMES`` or ``MAX_BYTES`` wait, only the newest
of each topic stays (``replaced`` counts the others) and every event; when that is still too much, the oldest go
(``lost``).
"""

from __future__ import annotations

from collections import deque

from fti.bus.frame import EVENT, BusFrame

MAX_FRAMES = 1024
MAX_BYTES = 8 * 2**20
#: So much is given to the kernel with one call.
SEND_BYTES = 2**16


class Outbox:
    """replaced : values that a newer one of their topic displaced; lost : messages that went without a newer one"""

    def __init__(self) -> None:
        self._frames: deque[BusFrame] = deque()
        self._bytes = 0
        self._rest = b""  # of what the kernel took in part
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
            while self._is_full(2):  # by half, so that this is done seldom
                self._bytes -= len(self._frames.popleft().raw)
                self.lost += 1

    def _is_full(self, share: int = 1) -> bool:
        return len(self._frames) > MAX_FRAMES // share or self._bytes > MAX_BYTES // share

    def _keep_newest(self) -> None:
        newest = {frame.topic: n for n, frame in enumerate(self._frames)}
        kept = [f for n, f in enumerate(self._frames) if f.topic == EVENT or newest[f.topic] == n]
        self.replaced += len(self._frames) - len(kept)
        self._frames = deque(kept)
        self._bytes = sum(len(frame.raw) for frame in kept)

    def next_bytes(self) -> bytes:
        """What is to be sent next; give back with ``keep_unsent`` what was not sent."""
        parts, size, self._rest = [self._rest], len(self._rest), b""
        while self._frames and size < SEND_BYTES:
            raw = self._frames.popleft().raw
            self._bytes -= len(raw)
            size += len(raw)
            parts.append(raw)
        return b"".join(parts)

    def keep_unsent(self, rest: bytes) -> None:
        """What ``next_bytes`` gave and the kernel did not take."""
        self._rest = rest
