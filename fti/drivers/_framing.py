"""Framing for every driver: find a frame, wait for its end, stamp its first byte, account for every byte.

A protocol is one pure function that looks at the bytes held and says what it sees at their beginning:

    measure(buffer) -> n > 0    a whole, checked frame of n bytes stands at the beginning
                    -> 0        it may become a frame: more bytes are needed
                    -> Skip     the first ``size`` bytes are no frame, for ``reason``

After a Skip the search goes on behind the skipped bytes, so a lost header costs as little as it can.
``limit`` bounds what is held and what ``measure`` sees: a corrupted length must not swallow the stream, and how the
bytes were cut into reads must not change the result.  For the same reason ``measure`` may depend on nothing but a
beginning of the buffer and on what it returned before.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

from fti.drivers import Counters


class Skip(NamedTuple):
    """The first ``size`` bytes (>= 1) are not part of a frame."""

    size: int
    reason: str


Measure = Callable[[bytearray], "int | Skip"]


def skip_to(buffer: bytearray, sync: bytes, reason: str = "no_sync") -> Skip | None:
    """The Skip to the next sync (or to a beginning of it at the end of the buffer); None when it stands first."""
    at = buffer.find(sync)
    if at < 0:
        at = len(buffer) - _overlap(buffer, sync)
    return Skip(at, reason) if at else None


def _overlap(buffer: bytearray, sync: bytes) -> int:
    """Length of the longest end of the buffer that is a beginning of sync."""
    for n in range(min(len(sync) - 1, len(buffer)), 0, -1):
        if buffer.endswith(sync[:n]):
            return n
    return 0


class Framer:
    """Cuts a byte stream into frames.  measure : see above; limit : most bytes held while waiting for a frame's end."""

    def __init__(self, measure: Measure, counters: Counters, limit: int = 4096) -> None:
        self._measure = measure
        self._counters = counters
        self._limit = limit
        self._buffer = bytearray()
        self._base = 0  # stream offset of the first byte held
        self._stamps: deque[tuple[int, int]] = deque()  # (stream offset where a read begins, its time)

    def feed(self, data: bytes, t_rx_ns: int) -> Iterator[tuple[int, bytes]]:
        """Yield (arrival of the first byte [ns], frame) for every frame that is complete with these bytes."""
        if not data:
            return
        buffer, counters = self._buffer, self._counters
        self._stamps.append((self._base + len(buffer), t_rx_ns))
        self._forget_old_stamps()
        buffer += data
        counters.bytes_in += len(data)
        while buffer:
            seen = self._look() if len(buffer) >= self._limit else self._measure(buffer)
            if isinstance(seen, Skip):
                counters.skipped[seen.reason] += seen.size
                self._drop(seen.size)
            elif seen:
                frame = bytes(buffer if seen == len(buffer) else buffer[:seen])
                stamp = self._stamps[0][1]
                counters.framed += seen
                self._drop(seen)
                counters.held = len(buffer)
                yield stamp, frame
            else:
                break
        counters.held = len(buffer)

    def _look(self) -> int | Skip:
        """At as much as may be held: what is no frame by then is none."""
        return self._measure(self._buffer[: self._limit]) or Skip(1, "too_long")

    def _drop(self, count: int) -> None:
        del self._buffer[:count]
        self._base += count
        if len(self._stamps) > 1:
            self._forget_old_stamps()

    def _forget_old_stamps(self) -> None:
        """Keep the read that the first byte held came with, and later ones."""
        while len(self._stamps) > 1 and self._stamps[1][0] <= self._base:
            self._stamps.popleft()
