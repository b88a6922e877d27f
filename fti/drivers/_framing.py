"""Framing for every driver: find frames, wait for their ends, stamp their first bytes, count every byte.

A protocol is one pure function that checks the start of the held bytes:

    measure(buffer) -> n > 0    a complete, checked frame of n bytes
                    -> 0        an incomplete frame: more bytes are needed
                    -> Skip     the first ``size`` bytes are not a frame, for ``reason``

After a Skip the search continues after the skipped bytes, so a lost header costs as few bytes as possible.
``limit`` bounds the held bytes and the argument of ``measure``: a corrupted length must not block the stream, and the
division into reads must not change the result.  For the same reason ``measure`` may depend only on a prefix of the
buffer and on its previous results.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

from fti.drivers import Counters
from fti.messages.measurements import Measurement


class Skip(NamedTuple):
    """The first ``size`` bytes (>= 1) are not part of a frame."""

    size: int
    reason: str


Measure = Callable[[bytearray], "int | Skip"]


def skip_to(buffer: bytearray, sync: bytes, reason: str = "no_sync") -> Skip | None:
    """The Skip to the next sync (or to a prefix of it at the end of the buffer); None if the buffer begins with it."""
    at = buffer.find(sync)
    if at < 0:
        at = len(buffer) - _overlap(buffer, sync)
    return Skip(at, reason) if at else None


def _overlap(buffer: bytearray, sync: bytes) -> int:
    """Length of the longest suffix of the buffer that is a prefix of sync."""
    for n in range(min(len(sync) - 1, len(buffer)), 0, -1):
        if buffer.endswith(sync[:n]):
            return n
    return 0


class Framer:
    """Divides a byte stream into frames.  measure : see above; limit : maximum of held bytes of an incomplete frame."""

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
        self._discard_old_stamps()
        buffer += data
        counters.bytes_in += len(data)
        while buffer:
            result = self._measure_full() if len(buffer) >= self._limit else self._measure(buffer)
            if isinstance(result, Skip):
                counters.skipped[result.reason] += result.size
                self._drop(result.size)
            elif result:
                frame = bytes(buffer if result == len(buffer) else buffer[:result])
                stamp = self._stamps[0][1]
                counters.framed += result
                self._drop(result)
                counters.held = len(buffer)
                yield stamp, frame
            else:
                break
        counters.held = len(buffer)

    def _measure_full(self) -> int | Skip:
        """Measure the maximum of held bytes: an incomplete frame is too long."""
        return self._measure(self._buffer[: self._limit]) or Skip(1, "too_long")

    def _drop(self, count: int) -> None:
        del self._buffer[:count]
        self._base += count
        if len(self._stamps) > 1:
            self._discard_old_stamps()

    def _discard_old_stamps(self) -> None:
        """Keep the stamps of the read with the first held byte, and later ones."""
        while len(self._stamps) > 1 and self._stamps[1][0] <= self._base:
            self._stamps.popleft()


class FramedDecoder(ABC):
    """Base class of decoders that decode one frame after the other.  measure, limit : see ``Framer``"""

    def __init__(self, measure: Measure, limit: int) -> None:
        self.counters = Counters()
        self._framer = Framer(measure, self.counters, limit)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        measurements: list[Measurement] = []
        for t_ns, frame in self._framer.feed(data, t_rx_ns):
            name, decoded = self._decode(frame, t_ns)
            self.counters.messages[name] += 1
            measurements += decoded
        return measurements

    @abstractmethod
    def _decode(self, frame: bytes, t_rx_ns: int) -> tuple[str, list[Measurement]]:
        """Name and measurements of a frame whose first byte arrived at t_rx_ns."""
