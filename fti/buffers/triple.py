"""Triple buffer of one link: bytes on their way from the reader to the writer, and neither waits for the other.

    put -> receive -> global -> write -> storage
           reader's   hand-over  writer's

Each queue has a lock of its own.  A move to the next queue is a try: when that queue is held, the entries wait where
they are and go with the next attempt.  The writer is called when ``global`` has reached its threshold, or comes by
itself when its flush period ends.  What the writer has taken stays in ``write`` until storage has accepted it.

Capacity counts payload + 8 bytes per reception and holds for each queue.  When storage stalls, ``global`` fills,
then ``receive``; when ``global`` is full and ``receive`` at 90 %, the oldest whole frames of ``receive`` go, counted.
The newest stay.  A frame larger than a whole queue is taken when that queue is empty.

Source: Spiegel 2018, section 6.3, figure 6.7, eq. 6.2.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

OVERFLOW_LOAD = 0.9
#: More spans than this are told as one: a span then covers everything from its first to its last frame.
MAX_SPANS = 64


class Entry(NamedTuple):
    """One reception: position in the session, FTI time of arrival [ns], bytes."""

    seq: int
    t_rx_ns: int
    data: bytes


@dataclass(slots=True)
class DropSpan:
    """Frames that were dropped one after the other: first and last position and time, how many, how many bytes."""

    first_seq: int
    last_seq: int
    first_t_ns: int
    last_t_ns: int
    frames: int = 0
    bytes: int = 0


@dataclass(frozen=True, slots=True)
class BufferStats:
    """Loads of the three queues (1 = full) and the account: in = out + dropped + held."""

    receive: float
    global_: float
    write: float
    frames_in: int
    bytes_in: int
    frames_out: int
    bytes_out: int
    frames_held: int
    bytes_held: int
    dropped_frames: int
    dropped_bytes: int
    drops: tuple[DropSpan, ...]


class _Queue:
    """Entries in order, their lock, and their size with the overhead."""

    __slots__ = ("entries", "lock", "overhead", "payload", "size")

    def __init__(self, overhead: int) -> None:
        self.lock = threading.Lock()
        self.entries: deque[Entry] = deque()
        self.overhead = overhead
        self.payload = 0
        self.size = 0

    def append(self, entry: Entry) -> None:
        self.entries.append(entry)
        size = len(entry.data)
        self.payload += size
        self.size += size + self.overhead

    def popleft(self) -> Entry:
        entry = self.entries.popleft()
        self.payload -= len(entry.data)
        self.size -= len(entry.data) + self.overhead
        return entry

    def fits(self, size: int, capacity: int) -> bool:
        return self.size + size <= capacity or not self.entries

    def move_to(self, other: _Queue, capacity: int) -> None:
        """Move the oldest entries as far as they fit.  Both locks are held."""
        if not other.entries and self.size <= capacity:
            self._swap_into(other)
        while self.entries and other.fits(len(self.entries[0].data) + self.overhead, capacity):
            other.append(self.popleft())

    def _swap_into(self, empty: _Queue) -> None:
        """Hand everything over at once, so that the locks are held for no longer with a full queue."""
        self.entries, empty.entries = empty.entries, self.entries
        empty.payload, empty.size = self.payload, self.size
        self.payload = self.size = 0


class TripleBuffer:
    """The three queues of one link.  One thread calls ``put``, one other ``take`` and ``written``, any ``stats``.

    capacity_bytes : of each queue [B]
    threshold      : load of ``global`` at which the writer is called
    overhead       : what a reception costs besides its payload [B]
    on_ready       : called by ``put``, outside all locks, when ``global`` has reached the threshold; once per ``take``
    """

    def __init__(
        self,
        capacity_bytes: int = 2**19,
        threshold: float = 0.5,
        overhead: int = 8,
        on_ready: Callable[[], None] | None = None,
    ) -> None:
        if capacity_bytes <= 0 or not 0 < threshold <= 1:
            raise ValueError(
                f"capacity {capacity_bytes} B, threshold {threshold}; allowed are > 0 and 0 < threshold <= 1"
            )
        self._capacity = capacity_bytes
        self._threshold = threshold
        self._receive, self._global, self._write = (_Queue(overhead) for _ in range(3))
        self._on_ready = on_ready
        self._called = False
        self._frames_in = self._bytes_in = self._frames_out = self._bytes_out = 0
        self._dropped_frames = self._dropped_bytes = 0
        self._drops: list[DropSpan] = []
        self._dropping = False

    @property
    def ready(self) -> bool:
        """``global`` has reached the threshold: writing pays."""
        return self._global.size >= self._threshold * self._capacity

    @property
    def empty(self) -> bool:
        """Everything that came in has been written (or dropped)."""
        return not (self._receive.entries or self._global.entries or self._write.entries)

    def capacity_s(self, rate_hz: float, message_bytes: float, receptions: float = 1.0) -> float:
        """How long storage may stall before the first byte is lost [s] (eq. 6.2).

        rate_hz : messages per second; message_bytes : their length [B]
        receptions : mean number of reads in which one message arrives (c_msg)
        Counted from the last write: ``global`` takes a full capacity from then on, ``receive`` 90 % of one.
        """
        if rate_hz <= 0 or message_bytes <= 0 or receptions <= 0:
            raise ValueError(f"rate {rate_hz} Hz, {message_bytes} B, {receptions} receptions; all must be positive")
        cost = message_bytes + self._receive.overhead * receptions
        return (1 + OVERFLOW_LOAD) * self._capacity / (rate_hz * cost)

    # ---------------------------------------------------------------------------------------------- reader's thread

    def put(self, seq: int, t_rx_ns: int, data: bytes) -> None:
        """Keep one reception.  Never waits for the writer; the oldest frames go when everything is full."""
        with self._receive.lock:
            self._frames_in += 1
            self._bytes_in += len(data)
            entry = Entry(seq, t_rx_ns, data)
            if self._receive.entries or not self._pass_on(entry):
                self._make_room(len(data) + self._receive.overhead)
                self._receive.append(entry)
                self._hand_over()
        if self._on_ready and not self._called and self.ready:
            self._called = True
            self._on_ready()

    def _pass_on(self, entry: Entry) -> bool:
        """Straight to ``global``, as nothing waits in ``receive``; false when it is held or full."""
        hand_over = self._global
        if not hand_over.lock.acquire(blocking=False):
            return False
        if fits := hand_over.size + len(entry.data) + hand_over.overhead <= self._capacity:
            hand_over.append(entry)
        hand_over.lock.release()
        return fits

    def _hand_over(self) -> bool:
        """receive -> global, with ``receive`` held; false when ``global`` is held by the writer."""
        if not self._global.lock.acquire(blocking=False):
            return False
        before = len(self._receive.entries)
        self._receive.move_to(self._global, self._capacity)
        self._global.lock.release()
        if len(self._receive.entries) < before:
            self._dropping = False  # entries flow again: the next drop is another one
        return True

    def _make_room(self, size: int) -> None:
        """Drop the oldest of ``receive`` when it is at 90 % and ``global`` is full, or when nothing fits any more."""
        receive, limit = self._receive, OVERFLOW_LOAD * self._capacity
        if receive.size < limit and receive.fits(size, self._capacity):
            return
        reached = self._hand_over()
        while receive.entries and ((reached and receive.size >= limit) or not receive.fits(size, self._capacity)):
            self._drop(receive.popleft())

    def _drop(self, entry: Entry) -> None:
        self._dropped_frames += 1
        self._dropped_bytes += len(entry.data)
        if not self._dropping and len(self._drops) < MAX_SPANS:
            self._drops.append(DropSpan(entry.seq, entry.seq, entry.t_rx_ns, entry.t_rx_ns))
        self._dropping = True
        span = self._drops[-1]
        span.last_seq, span.last_t_ns = entry.seq, entry.t_rx_ns
        span.frames += 1
        span.bytes += len(entry.data)

    # ---------------------------------------------------------------------------------------------- writer's thread

    def take(self) -> list[Entry]:
        """What is to be written now, in order; it stays in ``write`` until ``written``.

        What an earlier call returned and storage did not accept comes first, filled up to the capacity.
        """
        with self._write.lock:
            self._collect()
            if self._receive.lock.acquire(blocking=False):
                self._hand_over()
                self._receive.lock.release()
                self._collect()
            self._called = False
            return list(self._write.entries)

    def _collect(self) -> None:
        """global -> write, with ``write`` held."""
        if self._global.lock.acquire(blocking=False):
            self._global.move_to(self._write, self._capacity)
            self._global.lock.release()

    def written(self, count: int | None = None) -> None:
        """Storage has accepted the first ``count`` entries that ``take`` returned (all when None)."""
        with self._write.lock:
            for _ in range(len(self._write.entries) if count is None else count):
                self._bytes_out += len(self._write.popleft().data)
                self._frames_out += 1

    # --------------------------------------------------------------------------------------------------- any thread

    @property
    def stats(self) -> BufferStats:
        """A consistent account; the locks are held for the moment of counting."""
        queues = (self._receive, self._global, self._write)
        with self._receive.lock, self._global.lock, self._write.lock:
            return BufferStats(
                receive=self._receive.size / self._capacity,
                global_=self._global.size / self._capacity,
                write=self._write.size / self._capacity,
                frames_in=self._frames_in,
                bytes_in=self._bytes_in,
                frames_out=self._frames_out,
                bytes_out=self._bytes_out,
                frames_held=sum(len(queue.entries) for queue in queues),
                bytes_held=sum(queue.payload for queue in queues),
                dropped_frames=self._dropped_frames,
                dropped_bytes=self._dropped_bytes,
                drops=tuple(replace(span) for span in self._drops),
            )
