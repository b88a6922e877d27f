"""Pacing of a line: bytes leave no faster than the line carries them.

The time of a byte on a serial line includes start, parity and stop bits; the time of a CAN frame includes the
intermission.  Bytes leave in chunks of CHUNK_S, as from the receive buffer of a UART or the latency timer of a USB
adapter; the last queued byte leaves at its exact time (docs/decisions/0020).  A CAN frame leaves whole, at its end.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from fti.canframe import EXTENDED
from fti.config import SerialLink
from fti.formats.can_identifiers import frame_head

CHUNK_S = 0.001
#: Times within this tolerance are equal, because sums of floats have rounding errors.
TIME_TOLERANCE_S = 1e-9
#: Bits of a frame without its data: from start of frame to the third bit of the intermission, no stuff bit counted.
STANDARD_BITS, EXTENDED_BITS = 47, 67


def byte_s(link: SerialLink) -> float:
    """Transmission time of a byte on a serial line [s]."""
    return (1 + link.data_bits + (link.parity != "none") + link.stop_bits) / link.baud


def frame_s(frame: bytes, bitrate: int) -> float:
    """Shortest transmission time of a ``can_frame`` [s]: without stuff bits, which add up to a fifth."""
    word, length = frame_head(frame)
    return ((EXTENDED_BITS if word & EXTENDED else STANDARD_BITS) + 8 * length) / bitrate


@dataclass(slots=True)
class PacedMessage:
    """A queued message.  whole : it leaves at its end only; written : number of bytes that have left"""

    data: bytes
    duration_s: float
    whole: bool
    written: int = 0

    def bytes_passed(self, elapsed_s: float) -> int:
        """Number of bytes that have left elapsed_s [s] after its begin."""
        if elapsed_s >= self.duration_s - TIME_TOLERANCE_S:
            return len(self.data)
        return 0 if self.whole else int((elapsed_s + TIME_TOLERANCE_S) / self.duration_s * len(self.data))


class LinePacer:
    """Queue of the messages on a line.  Times are those of any clock [s]."""

    def __init__(self) -> None:
        self._waiting: deque[PacedMessage] = deque()
        self._begin_s = 0.0  # begin of the first queued message, or earliest begin of the next one
        self.waiting_s = 0.0
        self.waiting_bytes = 0

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, message: PacedMessage, now_s: float) -> None:
        """Append a message."""
        if not self._waiting:
            self._begin_s = max(self._begin_s, now_s)
        self._waiting.append(message)
        self.waiting_s += message.duration_s
        self.waiting_bytes += len(message.data)

    def due(self, now_s: float) -> bytes:
        """Bytes that may leave now, of all messages together."""
        elapsed_s, parts = now_s - self._begin_s, []
        for message in self._waiting:
            bytes_passed = message.bytes_passed(elapsed_s)
            if bytes_passed > message.written:
                parts.append(message.data[message.written : bytes_passed])
            if bytes_passed < len(message.data):
                break
            elapsed_s -= message.duration_s
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def mark_written(self, count: int) -> int:
        """Record that the first ``count`` bytes have left.  Returns the number of messages completed by them."""
        complete = 0
        while count:
            first = self._waiting[0]
            part = min(count, len(first.data) - first.written)
            first.written += part
            count -= part
            if first.written == len(first.data):
                self._begin_s += first.duration_s
                self._remove(0)
                complete += 1
        return complete

    def drop_oldest(self) -> PacedMessage:
        """Remove the oldest message of which nothing has left, or the only one."""
        index = 1 if self._waiting[0].written and len(self._waiting) > 1 else 0
        return self._remove(index)

    def next_s(self, now_s: float) -> float:
        """Time of the next bytes [s], at the latest the end of the queue."""
        first = self._waiting[0]
        min_s = first.duration_s if first.whole else 0.0
        return max(self._begin_s + min_s, min(self._begin_s + self.waiting_s, now_s + CHUNK_S))

    def _remove(self, index: int) -> PacedMessage:
        message = self._waiting[index]
        del self._waiting[index]
        self.waiting_s = self.waiting_s - message.duration_s if self._waiting else 0.0
        self.waiting_bytes -= len(message.data)
        return message
