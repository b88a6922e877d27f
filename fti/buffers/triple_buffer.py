"""Triple buffer of one link: passes frames from the reader to the writer; neither blocks the other.

    put -> receive -> global -> write -> storage
           reader's   hand-over  writer's

Each queue has its own lock.  Transfers to the next queue use try-lock: if that queue is locked, the frames wait until
the next attempt.  The writer is called when ``global`` has reached its threshold, and also runs at its flush period.
Frames that the writer has taken stay in ``write`` until storage has accepted them.

Capacity counts payload + 8 bytes per frame and applies to each queue.  When storage stalls, ``global`` fills, then
``receive``; when ``global`` is full and ``receive`` at 90 %, the oldest frames of ``receive`` are dropped and counted.
A frame larger than a queue is accepted when that queue is empty.

Source: Spiegel 2018, section 6.3, figure 6.7, eq. 6.2.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from fti.frame_batch import FrameBatch, iter_frames, make_batch, single_frame_batch, split_batch

OVERFLOW_LOAD = 0.9
#: Maximum number of spans; further drops extend the last span.
MAX_SPANS = 64


@dataclass(slots=True)
class DropSpan:
    """A run of dropped frames: first and last seq and time, number of frames and bytes."""

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
    """Batches in order, their lock, number of frames, and size including the overhead of each frame."""

    __slots__ = ("batches", "frames", "lock", "overhead", "payload", "size")

    def __init__(self, overhead: int) -> None:
        self.lock = threading.Lock()
        self.batches: deque[FrameBatch] = deque()
        self.overhead = overhead
        self.frames = 0
        self.payload = 0
        self.size = 0

    def append(self, batch: FrameBatch) -> None:
        frames, payload = len(batch[2]), batch[3]
        self.batches.append(batch)
        self.frames += frames
        self.payload += payload
        self.size += payload + frames * self.overhead

    def popleft(self, count: int | None = None) -> FrameBatch:
        """Remove the first batch, or its first frames."""
        batch = self.batches.popleft()
        if count is not None and count < len(batch[2]):
            batch, rest = split_batch(batch, count)
            self.batches.appendleft(rest)
        frames, payload = len(batch[2]), batch[3]
        self.frames -= frames
        self.payload -= payload
        self.size -= payload + frames * self.overhead
        return batch

    def clear(self) -> None:
        self.batches.clear()
        self.frames = self.payload = self.size = 0

    def fits(self, size: int, capacity: int) -> bool:
        return self.size + size <= capacity or not self.batches

    def fitting_frames(self, batch: FrameBatch, capacity: int) -> int:
        """Number of frames of a batch that fit; a frame larger than the capacity fits an empty queue."""
        _, _, frames, payload = batch
        free = capacity - self.size
        if payload + len(frames) * self.overhead <= free:
            return len(frames)
        for count, frame in enumerate(frames):
            free -= len(frame) + self.overhead
            if free < 0 and (self.batches or count):
                return count
        return len(frames)

    def move_to(self, other: _Queue, capacity: int) -> bool:
        """Move the oldest frames as far as they fit; true when any did.  Both locks are held."""
        before = self.frames
        if not other.batches and self.size <= capacity:
            self._swap_into(other)
            return before > 0
        while self.batches and (count := other.fitting_frames(self.batches[0], capacity)):
            other.append(self.popleft(count))
        return self.frames < before

    def _swap_into(self, empty: _Queue) -> None:
        """Move all batches in constant time, so that the locks are held only briefly."""
        self.batches, empty.batches = empty.batches, self.batches
        empty.frames, empty.payload, empty.size = self.frames, self.payload, self.size
        self.frames = self.payload = self.size = 0


class TripleBuffer:
    """The three queues of one link.  One thread puts, one takes, any thread may read ``stats``.

    capacity_bytes : of each queue [B]
    threshold      : load of ``global`` at which the writer is called
    overhead       : bytes of a frame in addition to its payload [B]
    on_ready       : called by ``put_batch``, outside all locks, when ``global`` is at the threshold; once per ``take``
    """

    def __init__(
        self,
        capacity_bytes: int = 2**19,
        threshold: float = 0.5,
        overhead: int = 8,
        on_ready: Callable[[], None] | None = None,
    ) -> None:
        if capacity_bytes <= 0 or not 0 < threshold <= 1:
            raise ValueError(f"capacity {capacity_bytes} B, threshold {threshold}; must be > 0 and 0 < threshold <= 1")
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
    def is_ready(self) -> bool:
        """``global`` has reached the threshold for writing."""
        return self._global.size >= self._threshold_bytes

    @property
    def is_empty(self) -> bool:
        """All frames have been written or dropped."""
        return not (self._receive.batches or self._global.batches or self._write.batches)

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
        """Put one frame."""
        self.put_batch(single_frame_batch(seq, t_rx_ns, data))

    def put_many(self, first_seq: int, times_ns: Sequence[int], frames: Sequence[bytes]) -> None:
        """Put frames that arrived together, numbered from first_seq on."""
        self.put_batch(make_batch(first_seq, times_ns, frames))

    def put_batch(self, batch: FrameBatch) -> None:
        """Put frames that arrived together.  Never blocks; the oldest frames are dropped when all queues are full."""
        receive, hand_over = self._receive, self._global
        with receive.lock:
            self._frames_in += len(batch[2])
            self._bytes_in += batch[3]
            if receive.batches or not self._put_into_global(batch, hand_over):
                self._put_into_receive(batch)
        if hand_over.size >= self._threshold_bytes and self._on_ready and not self._is_writer_called:
            self._is_writer_called = True
            self._on_ready()

    def _put_into_global(self, batch: FrameBatch, hand_over: _Queue) -> bool:
        """Put into ``global`` directly, as ``receive`` is empty; false if it is locked or too full for the batch."""
        if not hand_over.lock.acquire(blocking=False):
            return False
        if fits := hand_over.size + self._size(batch) <= self._capacity:
            hand_over.append(batch)
        hand_over.lock.release()
        return fits

    def _size(self, batch: FrameBatch) -> int:
        return batch[3] + len(batch[2]) * self._receive.overhead

    def _put_into_receive(self, batch: FrameBatch) -> None:
        """Put into ``receive``, and move frames to ``global`` as far as it is unlocked and has space."""
        free = self._global.lock.acquire(blocking=False)
        if free:
            self._move_to_global()
        after = self._receive.size + self._size(batch)
        if after < OVERFLOW_LOAD * self._capacity or (not free and after <= self._capacity):
            self._enqueue(batch, free)
        else:
            self._put_with_drops(batch, free)
        if free:
            self._global.lock.release()

    def _enqueue(self, batch: FrameBatch, free: bool) -> None:
        self._receive.append(batch)
        if free:
            self._move_to_global()

    def _put_with_drops(self, batch: FrameBatch, free: bool) -> None:
        """Put each frame separately, after dropping oldest frames until it fits."""
        for entry in iter_frames((batch,)):
            self._make_room(len(entry[2]) + self._receive.overhead, free)
            self._enqueue(single_frame_batch(*entry), free)

    def _make_room(self, size: int, free: bool) -> None:
        """Drop the oldest frames of ``receive`` at 90 % load with a full ``global``, or when the frame does not fit.

        free : ``global`` is locked by this thread, and full
        """
        receive, limit = self._receive, OVERFLOW_LOAD * self._capacity
        while receive.batches and ((free and receive.size >= limit) or not receive.fits(size, self._capacity)):
            self._drop(receive.popleft(1))

    def _hand_over(self) -> None:
        """receive -> global, with ``receive`` locked, unless ``global`` is locked by another thread."""
        if self._global.lock.acquire(blocking=False):
            self._move_to_global()
            self._global.lock.release()

    def _move_to_global(self) -> None:
        """receive -> global, with both locked."""
        if self._receive.batches and self._receive.move_to(self._global, self._capacity):
            self._dropping = False  # frames flow again: the next drop begins a new span

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
        """The batches to write now, in order; they stay in ``write`` until ``confirm_written``.

        Batches of earlier calls without confirmation come first, filled up to the capacity.
        """
        with self._write.lock:
            self._collect()
            if self._receive.batches and self._receive.lock.acquire(blocking=False):
                self._hand_over()
                self._receive.lock.release()
                self._collect()
            self._is_writer_called = False
            return list(self._write.batches)

    def _collect(self) -> None:
        """global -> write, with ``write`` locked."""
        if self._global.batches and self._global.lock.acquire(blocking=False):
            self._global.move_to(self._write, self._capacity)
            self._global.lock.release()

    def confirm_written(self, count: int | None = None) -> None:
        """Storage has accepted the first ``count`` batches that ``take`` returned (all when None)."""
        write = self._write
        with write.lock:
            frames, payload = write.frames, write.payload
            if count is None or count == len(write.batches):
                write.clear()
            else:
                for _ in range(count):
                    write.popleft()
            self._frames_out += frames - write.frames
            self._bytes_out += payload - write.payload

    def take_drops(self, *, final: bool = False) -> list[DropSpan]:
        """Remove and return the spans that have ended, oldest first; none while the reader has locked ``receive``.

        final : also the span that has not ended
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
        """A consistent account, counted with all locks held."""
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
