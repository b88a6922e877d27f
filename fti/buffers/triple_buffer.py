"""Triple buffer of one link: bytes on their way from the reader to the writer, and neither waits for the other.

    put -> receive -> global -> write -> storage
           reader's   hand-over  writer's

Each queue has a lock of its own.  A move to the next queue is a try: when that queue is held, the frames wait where
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
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from fti.frame_batch import FrameBatch, entries, make_batch, single_frame_batch, split

OVERFLOW_LOAD = 0.9
#: More spans than this are told as one: a span then covers everything from its first to its last frame.
MAX_SPANS = 64


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
    """Bursts in order, their lock, how many frames they have, and their size with the overhead of each frame."""

    __slots__ = ("bursts", "frames", "lock", "overhead", "payload", "size")

    def __init__(self, overhead: int) -> None:
        self.lock = threading.Lock()
        self.bursts: deque[FrameBatch] = deque()
        self.overhead = overhead
        self.frames = 0
        self.payload = 0
        self.size = 0

    def append(self, burst: FrameBatch) -> None:
        frames, payload = len(burst[2]), burst[3]
        self.bursts.append(burst)
        self.frames += frames
        self.payload += payload
        self.size += payload + frames * self.overhead

    def popleft(self, count: int | None = None) -> FrameBatch:
        """The first burst, or its first frames."""
        burst = self.bursts.popleft()
        if count is not None and count < len(burst[2]):
            burst, rest = split(burst, count)
            self.bursts.appendleft(rest)
        frames, payload = len(burst[2]), burst[3]
        self.frames -= frames
        self.payload -= payload
        self.size -= payload + frames * self.overhead
        return burst

    def clear(self) -> None:
        self.bursts.clear()
        self.frames = self.payload = self.size = 0

    def fits(self, size: int, capacity: int) -> bool:
        return self.size + size <= capacity or not self.bursts

    def room(self, burst: FrameBatch, capacity: int) -> int:
        """How many frames of a burst fit; one larger than everything does when nothing else is there."""
        _, _, frames, payload = burst
        free = capacity - self.size
        if payload + len(frames) * self.overhead <= free:
            return len(frames)
        for count, frame in enumerate(frames):
            free -= len(frame) + self.overhead
            if free < 0 and (self.bursts or count):
                return count
        return len(frames)

    def move_to(self, other: _Queue, capacity: int) -> bool:
        """Move the oldest frames as far as they fit; true when any did.  Both locks are held."""
        before = self.frames
        if not other.bursts and self.size <= capacity:
            self._swap_into(other)
            return before > 0
        while self.bursts and (count := other.room(self.bursts[0], capacity)):
            other.append(self.popleft(count))
        return self.frames < before

    def _swap_into(self, empty: _Queue) -> None:
        """Hand everything over at once, so that the locks are held for no longer with a full queue."""
        self.bursts, empty.bursts = empty.bursts, self.bursts
        empty.frames, empty.payload, empty.size = self.frames, self.payload, self.size
        self.frames = self.payload = self.size = 0


class TripleBuffer:
    """The three queues of one link.  One thread puts, one other takes, any asks for ``stats``.

    capacity_bytes : of each queue [B]
    threshold      : load of ``global`` at which the writer is called
    overhead       : what a reception costs besides its payload [B]
    on_ready       : called by ``put_burst``, outside all locks, when ``global`` is at the threshold; once per ``take``
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
        self._threshold_bytes = threshold * capacity_bytes
        self._receive, self._global, self._write = (_Queue(overhead) for _ in range(3))
        self._on_ready = on_ready
        self._is_writer_called = False
        self._frames_in = self._bytes_in = self._frames_out = self._bytes_out = 0
        self._dropped_frames = self._dropped_bytes = 0
        self._drops: list[DropSpan] = []
        self._dropping = False

    @property
    def ready(self) -> bool:
        """``global`` has reached the threshold: writing pays."""
        return self._global.size >= self._threshold_bytes

    @property
    def empty(self) -> bool:
        """Everything that came in has been written (or dropped)."""
        return not (self._receive.bursts or self._global.bursts or self._write.bursts)

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
        self.put_burst(single_frame_batch(seq, t_rx_ns, data))

    def put_many(self, first_seq: int, times_ns: Sequence[int], frames: Sequence[bytes]) -> None:
        """Keep what arrived together, numbered from first_seq on."""
        self.put_burst(make_batch(first_seq, times_ns, frames))

    def put_burst(self, burst: FrameBatch) -> None:
        """Keep what arrived together.  Never waits for the writer; the oldest frames go when everything is full."""
        receive, hand_over = self._receive, self._global
        with receive.lock:
            self._frames_in += len(burst[2])
            self._bytes_in += burst[3]
            if receive.bursts or not self._pass_on(burst, hand_over):
                self._take_in(burst)
        if hand_over.size >= self._threshold_bytes and self._on_ready and not self._is_writer_called:
            self._is_writer_called = True
            self._on_ready()

    def _pass_on(self, burst: FrameBatch, hand_over: _Queue) -> bool:
        """Straight to ``global``, as nothing waits in ``receive``; false when it is held or has no room for all."""
        if not hand_over.lock.acquire(blocking=False):
            return False
        if fits := hand_over.size + self._size(burst) <= self._capacity:
            hand_over.append(burst)
        hand_over.lock.release()
        return fits

    def _size(self, burst: FrameBatch) -> int:
        return burst[3] + len(burst[2]) * self._receive.overhead

    def _take_in(self, burst: FrameBatch) -> None:
        """Into ``receive``, and from there to ``global`` as far as it is free and has room."""
        free = self._global.lock.acquire(blocking=False)
        if free:
            self._move_on()
        after = self._receive.size + self._size(burst)
        if after < OVERFLOW_LOAD * self._capacity or (not free and after <= self._capacity):
            self._keep(burst, free)
        else:
            self._displace(burst, free)
        if free:
            self._global.lock.release()

    def _keep(self, burst: FrameBatch, free: bool) -> None:
        self._receive.append(burst)
        if free:
            self._move_on()

    def _displace(self, burst: FrameBatch, free: bool) -> None:
        """Each frame for itself, after so many of the oldest that it fits."""
        for entry in entries((burst,)):
            self._make_room(len(entry[2]) + self._receive.overhead, free)
            self._keep(single_frame_batch(*entry), free)

    def _make_room(self, size: int, free: bool) -> None:
        """Drop the oldest of ``receive`` when it is at 90 % and ``global`` is full, or when nothing fits any more.

        free : ``global`` is ours, and has taken what it can
        """
        receive, limit = self._receive, OVERFLOW_LOAD * self._capacity
        while receive.bursts and ((free and receive.size >= limit) or not receive.fits(size, self._capacity)):
            self._drop(receive.popleft(1))

    def _hand_over(self) -> None:
        """receive -> global, with ``receive`` held, unless ``global`` is held by another."""
        if self._global.lock.acquire(blocking=False):
            self._move_on()
            self._global.lock.release()

    def _move_on(self) -> None:
        """receive -> global, with both held."""
        if self._receive.bursts and self._receive.move_to(self._global, self._capacity):
            self._dropping = False  # frames flow again: the next drop is another one

    def _drop(self, frame: FrameBatch) -> None:
        (seq,), (t_rx_ns,), _, size = frame
        self._dropped_frames += 1
        self._dropped_bytes += size
        if not self._drops or (not self._dropping and len(self._drops) < MAX_SPANS):
            self._drops.append(DropSpan(seq, seq, t_rx_ns, t_rx_ns))
        self._dropping = True
        span = self._drops[-1]
        span.last_seq, span.last_t_ns = seq, t_rx_ns
        span.frames += 1
        span.bytes += size

    # ---------------------------------------------------------------------------------------------- writer's thread

    def take(self) -> list[FrameBatch]:
        """What is to be written now, in order; it stays in ``write`` until ``confirm_written``.

        What an earlier call returned and storage did not accept comes first, filled up to the capacity.
        """
        with self._write.lock:
            self._collect()
            if self._receive.bursts and self._receive.lock.acquire(blocking=False):
                self._hand_over()
                self._receive.lock.release()
                self._collect()
            self._is_writer_called = False
            return list(self._write.bursts)

    def _collect(self) -> None:
        """global -> write, with ``write`` held."""
        if self._global.bursts and self._global.lock.acquire(blocking=False):
            self._global.move_to(self._write, self._capacity)
            self._global.lock.release()

    def confirm_written(self, count: int | None = None) -> None:
        """Storage has accepted the first ``count`` bursts that ``take`` returned (all when None)."""
        write = self._write
        with write.lock:
            frames, payload = write.frames, write.payload
            if count is None or count == len(write.bursts):
                write.clear()
            else:
                for _ in range(count):
                    write.popleft()
            self._frames_out += frames - write.frames
            self._bytes_out += payload - write.payload

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
                frames_held=sum(queue.frames for queue in queues),
                bytes_held=sum(queue.payload for queue in queues),
                dropped_frames=self._dropped_frames,
                dropped_bytes=self._dropped_bytes,
                drops=tuple(replace(span) for span in self._drops),
            )
