"""Reader of the ring: frames in order, from where the last reader stopped; it never blocks the writer."""

from __future__ import annotations

import contextlib
import os
import select
import zlib
from array import array
from collections.abc import Iterator
from typing import NamedTuple

from fti.buffers.ring import COLUMNS, FIELDS, HEAD, LINK_BITS, READ_BYTES, RECORD, EntryKind, ReaderState, Ring

LINK_MASK = (1 << LINK_BITS) - 1
KINDS = tuple(EntryKind)


class RingFrame(NamedTuple):
    """An entry of the ring.  link_index : of the link that received or sent it; 0 for a tick"""

    kind: EntryKind
    link_index: int
    seq: int
    t_rx_ns: int
    data: bytes


class RingReader:
    """The only reader of a ring.  A new reader continues exactly where the last one stopped.

    Frames count as consumed with the next ``read`` or with ``commit``: after a kill the next reader gets the frames of
    the last ``read`` again.  A reader that was overrun continues with the next new frame, not with the oldest one:
    there it would be overrun again at once, and stay late by the whole content of the ring.
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self._state = ring.reader_state()
        self._event = ring.fds[1]
        self._poll = select.poll()
        self._poll.register(self._event, select.POLLIN)

    @property
    def lost_frames(self) -> int:
        """Number of frames overwritten or skipped before they were read, since the creation of the ring."""
        return self._state.lost

    @property
    def next_seq(self) -> int:
        """The seq after the last frame that was read or skipped; 0 before the first."""
        return self._state.next_seq

    @property
    def is_finished(self) -> bool:
        """The writer has ended and all frames have been read."""
        return self._ring.has_ended and self._state.position == self._ring.writer_state().end

    def wait(self, limit_s: float) -> None:
        """Wait until the writer has put frames since the last ``wait``, or has ended; at most limit_s [s]."""
        if self._poll.poll(1e3 * limit_s):
            with contextlib.suppress(BlockingIOError):  # a killed reader has consumed the event
                os.eventfd_read(self._event)

    def commit(self) -> None:
        """Mark the frames of the last ``read`` as consumed."""
        self._ring.publish_reader(self._state)

    def read(self, limit: int = 1000) -> list[RingFrame]:
        """The next frames in order; empty if there are none, and after an overrun.

        Ends with the record that reaches ``limit``: the frames of a record are read together.
        """
        self.commit()
        writer = self._ring.writer_state()
        position = self._state.position
        if position == writer.end:
            return []
        data = self._ring.load(position, min(writer.end - position, READ_BYTES))
        overrun = self._ring.writer_state().oldest > position  # also during the copy
        found = [] if overrun else self._parse(data, limit, writer.first_seq)
        if not found:  # or the memory is damaged
            self.skip()
        return found

    def skip(self) -> int:
        """Skip all waiting frames; returns their number."""
        writer = self._ring.writer_state()
        position, expected, lost = self._state
        skipped = max(writer.next_seq - (expected if position else writer.first_seq), 0)
        self._state = ReaderState(writer.end, writer.next_seq, lost + skipped)
        return skipped

    def _parse(self, data: bytes, limit: int, first_seq: int) -> list[RingFrame]:
        """Parse the records at the present position; first_seq : of the first record of the ring"""
        found: list[RingFrame] = []
        position, _, lost = self._state
        expected = self._state.next_seq if position else first_seq
        at = 0
        while len(found) < limit and at + HEAD <= len(data):
            length, crc = RECORD.unpack_from(data, at)
            end = at + HEAD + length
            if end > len(data):
                break
            covered = memoryview(data)[at + RECORD.size : end]
            if zlib.crc32(covered, (position + at) & 0xFFFF_FFFF) != crc:
                break
            seq, count = FIELDS.unpack_from(covered)
            lost += max(seq - expected, 0)
            expected = seq + count
            found += _unpack(data[at + RECORD.size : end])
            at = end
        if found:
            self._state = ReaderState(position + at, expected, lost)
        return found


def _unpack(content: bytes) -> Iterator[RingFrame]:
    seq, count = FIELDS.unpack_from(content)
    at = FIELDS.size
    columns = []
    for code in COLUMNS:
        column = array(code)
        end = at + count * column.itemsize
        column.frombytes(content[at:end])
        columns.append(column)
        at = end
    for t_rx_ns, size, source in zip(*columns, strict=True):
        yield RingFrame(KINDS[source >> LINK_BITS], source & LINK_MASK, seq, t_rx_ns, content[at : at + size])
        seq += 1
        at += size
