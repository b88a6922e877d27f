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
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

OVERFLOW_LOAD = 0.9
#: More spans than this are told as one: a span then covers everything from its first to its last frame.
MAX_SPANS = 64


#: One reception: position in the session, FTI time of arrival [ns], bytes.
Entry = tuple[int, int, bytes]


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
    """Loads of the three queues (1 = full) and the account: in = out + dropped + held.

    drops : spans of dropped frames that were not taken yet
    """

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
        size = len(entry[2])
        self.payload += size
        self.size += size + self.overhead

    def extend(self, entries: Iterable[Entry], count: int, payload: int) -> None:
        self.entries.extend(entries)
        self.payload += payload
        self.size += payload + count * self.overhead

    def popleft(self) -> Entry:
        entry = self.entries.popleft()
        size = len(entry[2])
        self.payload -= size
        self.size -= size + self.overhead
        return entry

    def clear(self) -> None:
        self.entries.clear()
        self.payload = self.size = 0

    def fits(self, size: int, capacity: int) -> bool:
        return self.size + size <= capacity or not self.entries

    def move_to(self, other: _Queue, capacity: int) -> bool:
        """Move the oldest entries as far as they fit; true when any did.  Both locks are held."""
        before = len(self.entries)
        if not other.entries and self.size <= capacity:
            self._swap_into(other)
        while self.entries and other.fits(len(self.entries[0][2]) + self.overhead, capacity):
            other.append(self.popleft())
        return len(self.entries) < before

    def _swap_into(self, empty: _Queue) -> None:
        """Hand everything over at once, so that the locks are held for no longer with a full queue."""
        self.entries, empty.entries = empty.entries, self.entries
        empty.payload, empty.size = self.payload, self.size
        self.payload = self.size = 0


class TripleBuffer:
    """The three queues of one link.  One thread puts, one other takes, any asks for ``stats``.

    capacity_bytes : of each queue [B]
    threshold      : load of ``global`` at which the writer is called
    overhead       : what a reception costs besides its payload [B]
    on_ready       : called by ``put_many``, outside all locks, when ``global`` is at the threshold; once per ``take``
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
        """Keep one reception."""
        self.put_many(seq, (t_rx_ns,), (data,))

    def put_many(self, first_seq: int, times_ns: Sequence[int], frames: Sequence[bytes]) -> None:
        """Keep what arrived together, numbered from first_seq on.

        Never waits for the writer; the oldest frames go when everything is full.
        """
        count, payload = len(frames), sum(map(len, frames))
        entries = zip(range(first_seq, first_seq + count), times_ns, frames, strict=True)
        with self._receive.lock:
            self._frames_in += count
            self._bytes_in += payload
            if self._receive.entries or not self._pass_on(entries, count, payload):
                self._take_in(entries)
        if self._on_ready and not self._called and self.ready:
            self._called = True
            self._on_ready()

    def _pass_on(self, entries: Iterable[Entry], count: int, payload: int) -> bool:
        """Straight to ``global``, as nothing waits in ``receive``; false when it is held or has no room for all."""
        hand_over = self._global
        if not hand_over.lock.acquire(blocking=False):
            return False
        if fits := hand_over.size + payload + count * hand_over.overhead <= self._capacity:
            hand_over.extend(entries, count, payload)
        hand_over.lock.release()
        return fits

    def _take_in(self, entries: Iterable[Entry]) -> None:
        """Each in turn into ``receive``, and from there to ``global`` as far as it is free and has room."""
        free = self._global.lock.acquire(blocking=False)
        for entry in entries:
            self._make_room(len(entry[2]) + self._receive.overhead, free)
            self._receive.append(entry)
            if free:
                self._move_on()
        if free:
            self._global.lock.release()

    def _make_room(self, size: int, free: bool) -> None:
        """Drop the oldest of ``receive`` when it is at 90 % and ``global`` is full, or when nothing fits any more.

        free : ``global`` is ours, and has taken what it can
        """
        receive, limit = self._receive, OVERFLOW_LOAD * self._capacity
        while receive.entries and ((free and receive.size >= limit) or not receive.fits(size, self._capacity)):
            self._drop(receive.popleft())

    def _hand_over(self) -> None:
        """receive -> global, with ``receive`` held, unless ``global`` is held by another."""
        if self._global.lock.acquire(blocking=False):
            self._move_on()
            self._global.lock.release()

    def _move_on(self) -> None:
        """receive -> global, with both held."""
        if self._receive.entries and self._receive.move_to(self._global, self._capacity):
            self._dropping = False  # entries flow again: the next drop is another one

    def _drop(self, entry: Entry) -> None:
        seq, t_rx_ns, data = entry
        self._dropped_frames += 1
        self._dropped_bytes += len(data)
        if not self._drops or (not self._dropping and len(self._drops) < MAX_SPANS):
            self._drops.append(DropSpan(seq, seq, t_rx_ns, t_rx_ns))
        self._dropping = True
        span = self._drops[-1]
        span.last_seq, span.last_t_ns = seq, t_rx_ns
        span.frames += 1
        span.bytes += len(data)

    # ---------------------------------------------------------------------------------------------- writer's thread

    def take(self) -> list[Entry]:
        """What is to be written now, in order; it stays in ``write`` until ``written``.

        What an earlier call returned and storage did not accept comes first, filled up to the capacity.
        """
        with self._write.lock:
            self._collect()
            if self._receive.entries and self._receive.lock.acquire(blocking=False):
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
            waiting, payload = len(self._write.entries), self._write.payload
            if count is None or count == waiting:
                self._write.clear()
            else:
                for _ in range(count):
                    self._write.popleft()
            self._frames_out += waiting - len(self._write.entries)
            self._bytes_out += payload - self._write.payload

    def take_drops(self, *, final: bool = False) -> list[DropSpan]:
        """The spans that have ended and were not taken yet, oldest first; none while the reader holds ``receive``.

        final : nothing follows: the span that has not ended, too
        """
        if not self._drops or not self._receive.lock.acquire(blocking=final):
            return []
        ended = len(self._drops) - (self._dropping and not final)
        taken, self._drops = self._drops[:ended], self._drops[ended:]
        self._receive.lock.release()
        return taken

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
