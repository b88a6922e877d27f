"""Ring buffer between two processes: the recorder writes without blocking, navigation reads.

One memory file, inherited by descriptor and mapped by both, so that its content survives a killed process.  An event
descriptor (``eventfd``) wakes the reader.  The first page of the file is the header, in words of 64 bits; the other
pages hold consecutive records, which wrap around at the end.

    word 0     magic                     8        writer's generation g       32       reader's generation
    1          size of the data [B]      10..14   writer's state, g even      34..36   reader's state, g even
    2          end mark                  18..22   writer's state, g odd       38..40   reader's state, g odd

    writer's state: position after the newest record | next seq | position of the oldest record | first seq
    reader's state: position after the last record consumed | next seq expected | frames lost
    positions count bytes since the creation of the ring and only grow

    record: | length u32 | crc-32 u32 | first seq u64 | count u32 | count x t_rx_ns i64 | count x size u32 |
            | count x source u16 | data |
            frames that arrived together, with consecutive numbers; length: bytes after ``count``; crc: over all that
            follows it, with the position as start value; source: ``EntryKind`` (2 high bits) and index of the link

A new state is written next to the valid one and becomes valid with its generation, one 64-bit store: a process killed
at any instruction leaves the old or the new state.  The writer discards the oldest records (and publishes this) before
it overwrites them, and publishes a record when it is complete.  A reader that was overrun finds the oldest position
after its own, and continues after the newest record; the missed frames are a gap in ``seq``.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from array import array
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from fti.config import CanLink, Link, SerialLink

MAGIC = 0x3230_676E_6972_7466  # "ftring02"
PAGE = 4096
RECORD = struct.Struct("<II")  # length, crc
FIELDS = struct.Struct("<QI")  # first seq, count
HEAD = RECORD.size + FIELDS.size
COLUMNS = TIME, FRAME_SIZE, SOURCE = "q", "I", "H"  # fields of each frame besides its data, as arrays
FRAME = sum(array(kind).itemsize for kind in COLUMNS)
SINGLE_FRAME_BYTES = HEAD + FRAME  # size of a record with one frame, without its data
_SINGLE_FRAME = struct.Struct(f"{FIELDS.format}{TIME}{FRAME_SIZE}{SOURCE}")
SIZE, ENDED, WRITER, READER = 1, 2, 8, 32
STATES = {WRITER: struct.Struct("=4Q"), READER: struct.Struct("=3Q")}
LINK_BITS = 14  # of a source
READ_BYTES = 2**18  # copied at once by the reader; a record is at most this, and a quarter of the ring
MAX_ATTEMPTS = 100

MIN_SIZE = 16 * 2**20
CAPACITY_S = 30
#: Maximum data rate of a link [B/s], with the heads of its records: bytes of a serial line in reads of 16, the
#: shortest frames of a CAN bus, 2000 datagrams of 100 B.
SERIAL_BITS, SERIAL_READ, CAN_BITS, UDP_RATE = 10, 16, 47, 2000 * (100 + SINGLE_FRAME_BYTES)
DEFAULT_BITRATE = 1_000_000
TICKS = 50 * SINGLE_FRAME_BYTES


def ring_size(links: Sequence[Link]) -> int:
    """Size of a ring that holds 30 s of these links at their full rates, at least 16 MiB [B]."""
    rate = TICKS + sum(_rate(link) for link in links)
    return max(MIN_SIZE, -(-CAPACITY_S * rate // PAGE) * PAGE)


def _rate(link: Link) -> int:
    if isinstance(link, SerialLink):
        return link.baud // SERIAL_BITS * (SERIAL_READ + SINGLE_FRAME_BYTES) // SERIAL_READ
    if isinstance(link, CanLink):
        return (link.bitrate or DEFAULT_BITRATE) // CAN_BITS * (16 + SINGLE_FRAME_BYTES)
    return UDP_RATE


class EntryKind(IntEnum):
    """What an entry of the ring is: a frame that a link has received or sent, or a tick of the recorder."""

    RECEIVED = 0
    SENT = 1
    TICK = 2


def pack_source(kind: EntryKind, link: int) -> int:
    """The source of an entry, as in a record.  link : its index; 0 for ticks"""
    return kind << LINK_BITS | link


class WriterState(NamedTuple):
    """Positions [B] and seq numbers that the writer publishes."""

    end: int
    next_seq: int
    oldest: int
    first_seq: int


class ReaderState(NamedTuple):
    """Position of the reader, and number of lost frames."""

    position: int
    next_seq: int
    lost: int


def _slot(base: int, generation: int) -> int:
    """First word of the state of a generation."""
    return base + 2 + (8 if base == WRITER else 4) * (generation & 1)


class Ring:
    """The ring and its header; ``put_many`` and ``end`` belong to the one writer.

    fds : descriptors for a child: the memory file, and the event that wakes the reader
    """

    def __init__(self, fds: tuple[int, int]) -> None:
        self.fds = fds
        fd, self._event = fds
        self._map = mmap.mmap(fd, 0)
        self._words = memoryview(self._map)[:PAGE].cast("Q")
        if self._words[0] != MAGIC:
            self.close()
            raise ValueError(f"descriptor {fd} is not a ring")
        self._size = self._words[SIZE]
        self._largest = min(self._size // 4, READ_BYTES)
        self._state = self.writer_state()

    @classmethod
    def create(cls, size_bytes: int) -> Ring:
        """A new ring with this size for records (rounded down to pages)."""
        if size_bytes < PAGE:
            raise ValueError(f"{size_bytes} B; a ring must have at least {PAGE}")
        size = size_bytes // PAGE * PAGE
        fd = os.memfd_create("fti_ring", os.MFD_CLOEXEC)
        os.ftruncate(fd, PAGE + size)
        with mmap.mmap(fd, PAGE) as header, memoryview(header) as view, view.cast("Q") as words:
            words[SIZE] = size
            words[0] = MAGIC
        return cls((fd, os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)))

    @classmethod
    def attach(cls, fds: tuple[int, int]) -> Ring:
        """The ring behind inherited descriptors; a restarted writer continues where the last one ended."""
        return cls(fds)

    def close(self) -> None:
        """Release the memory and the descriptors."""
        self._words.release()
        self._map.close()
        for fd in self.fds:
            os.close(fd)

    # ------------------------------------------------------------------------------------------------------- writer

    def put_many(
        self, sources: Sequence[int], first_seq: int, times_ns: Sequence[int], frames: Sequence[bytes]
    ) -> None:
        """Append frames, numbered from first_seq on; never blocks, the oldest frames are overwritten.

        sources : of each frame, see ``pack_source``
        Frames that exceed one record are divided.  Raises ValueError for a single frame that is too large.
        """
        content = _pack(sources, first_seq, times_ns, frames)
        need = RECORD.size + len(content)
        if need > self._largest:
            self._divide(sources, first_seq, times_ns, frames)
            return
        end, _, oldest, began = self._state
        if end + need - oldest > self._size:
            oldest = self._discard_oldest(end + need - self._size)
        self._store(end, RECORD.pack(need - HEAD, zlib.crc32(content, end & 0xFFFF_FFFF)) + content)
        self._publish(WriterState(end + need, first_seq + len(frames), oldest, began if end else first_seq))
        os.eventfd_write(self._event, 1)

    def _divide(self, sources: Sequence[int], first_seq: int, times_ns: Sequence[int], frames: Sequence[bytes]) -> None:
        """Put two records instead of one."""
        half = len(frames) // 2
        if not half:
            raise ValueError(f"frame of {len(frames[0])} B; the limit is {self._largest - SINGLE_FRAME_BYTES}")
        self.put_many(sources[:half], first_seq, times_ns[:half], frames[:half])
        self.put_many(sources[half:], first_seq + half, times_ns[half:], frames[half:])

    def _discard_oldest(self, min_position: int) -> int:
        """Discard complete records up to ``min_position`` and some more, to do so less often."""
        oldest, target = self._state.oldest, min(min_position + self._size // 16, self._state.end)
        while oldest < target:
            oldest += HEAD + RECORD.unpack(self.load(oldest, RECORD.size))[0]
        self._publish(self._state._replace(oldest=oldest))
        return oldest

    def _publish(self, state: WriterState) -> None:
        self._publish_words(WRITER, state)
        self._state = state

    def end(self) -> None:
        """Mark the end."""
        self._words[ENDED] = 1
        os.eventfd_write(self._event, 1)

    # ------------------------------------------------------------------------------------------------ both processes

    @property
    def has_ended(self) -> bool:
        """The writer has ended."""
        return bool(self._words[ENDED])

    @property
    def next_seq(self) -> int:
        """The seq after the newest frame in the ring; 0 while it is empty."""
        return self.writer_state().next_seq

    @property
    def lag_bytes(self) -> int:
        """Bytes that wait for the reader or were overwritten before it read them."""
        return self.writer_state().end - self.reader_state().position

    @property
    def oldest_seq(self) -> int | None:
        """The seq of the oldest frame in the ring; None while it is empty."""
        for _ in range(MAX_ATTEMPTS):  # the writer may discard the record meanwhile
            state = self.writer_state()
            if state.oldest == state.end:
                return None
            head = self.load(state.oldest, HEAD)
            if self.writer_state().oldest == state.oldest:
                return int(FIELDS.unpack_from(head, RECORD.size)[0])
        return None

    @property
    def oldest_waiting_ns(self) -> int | None:
        """Arrival of the oldest frame that the reader has not finished [ns]; None when it has finished all."""
        for _ in range(MAX_ATTEMPTS):
            reached = self.reader_state().position  # read before the writer's state, which can only be later
            writer = self.writer_state()
            position = max(reached, writer.oldest)
            if position >= writer.end:
                return None
            first = self.load(position, HEAD + array(TIME).itemsize)
            if self.writer_state().oldest <= position:
                return int(array(TIME, first[HEAD:])[0])
        return None

    def writer_state(self) -> WriterState:
        """The last published state of the writer."""
        return WriterState(*self._consistent(WRITER, 4))

    def reader_state(self) -> ReaderState:
        """The last published state of the reader."""
        return ReaderState(*self._consistent(READER, 3))

    def publish_reader(self, state: ReaderState) -> None:
        """Publish the state of the reader; only for the reader."""
        self._publish_words(READER, state)

    def _publish_words(self, base: int, values: Sequence[int]) -> None:
        generation = self._words[base] + 1
        slot = _slot(base, generation)
        STATES[base].pack_into(self._map, 8 * slot, *values)  # not valid yet, may be torn
        self._words[base] = generation  # one aligned 64-bit store

    def _consistent(self, base: int, count: int) -> list[int]:
        """The valid state; read again if it was replaced meanwhile."""
        while True:
            generation = self._words[base]
            slot = _slot(base, generation)
            values = self._words[slot : slot + count].tolist()
            if self._words[base] == generation:
                return values

    def load(self, position: int, count: int) -> bytes:
        """Bytes of the data from a position on, with wrap-around."""
        at = position % self._size
        first = min(count, self._size - at)
        found = self._map[PAGE + at : PAGE + at + first]
        return found if first == count else found + self._map[PAGE : PAGE + count - first]

    def _store(self, position: int, data: bytes) -> None:
        at, size = position % self._size, len(data)
        if (first := self._size - at) >= size:
            self._map[PAGE + at : PAGE + at + size] = data
        else:
            self._map[PAGE + at : PAGE + at + first] = data[:first]
            self._map[PAGE : PAGE + size - first] = data[first:]


def _pack(sources: Sequence[int], first_seq: int, times_ns: Sequence[int], frames: Sequence[bytes]) -> bytes:
    count = len(frames)
    if count == 1:
        return _SINGLE_FRAME.pack(first_seq, 1, times_ns[0], len(frames[0]), sources[0]) + frames[0]
    head = FIELDS.pack(first_seq, count)
    return b"".join((head, array(TIME, times_ns), array(FRAME_SIZE, map(len, frames)), array(SOURCE, sources), *frames))
