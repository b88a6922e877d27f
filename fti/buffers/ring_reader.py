"""The reading side of the ring: frames in order, from where the last reader stopped; the writer never waits for it."""

from __future__ import annotations

import contextlib
import os
import select
import zlib
from array import array
from collections.abc import Iterator
from typing import NamedTuple

from fti.buffers.ring import FIELDS, FRAME_SIZE, HEAD, LINK, READ_BYTES, RECORD, TIME, ReaderState, Ring


class RingFrame(NamedTuple):
    """One frame as it stands in the ring."""

    link_index: int
    seq: int
    t_rx_ns: int
    data: bytes


class RingReader:
    """The one reader.  A new reader on the same ring goes on exactly where the last one stopped.

    Frames count as consumed with the next ``read`` or with ``commit``: a reader that is killed while it works on what
    ``read`` returned gets the same frames again.  A reader that was overrun goes on with what comes next, not at the
    oldest: there it would be overrun again at once, and late by all that the ring holds for ever.
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self._state = ring.reader_state()
        self._event = ring.fds[1]
        self._poll = select.poll()
        self._poll.register(self._event, select.POLLIN)

    @property
    def lost_frames(self) -> int:
        """Frames that were overwritten or skipped before they were read, since the ring began."""
        return self._state.lost

    @property
    def next_seq(self) -> int:
        """The seq behind the last frame that was read or skipped; 0 before the first."""
        return self._state.next_seq

    @property
    def finished(self) -> bool:
        """The writer has put everything and everything has been read."""
        return self._ring.ended and self._state.position == self._ring.writer_state().end

    def wait(self, limit_s: float) -> None:
        """Until the writer has put something since the last ``wait``, or has ended; at most so long."""
        if self._poll.poll(1e3 * limit_s):
            with contextlib.suppress(BlockingIOError):  # a reader that was killed has taken the event
                os.eventfd_read(self._event)

    def commit(self) -> None:
        """What ``read`` returned has been worked on."""
        self._ring.publish_reader(self._state)

    def read(self, limit: int = 1000) -> list[RingFrame]:
        """The next frames in order; empty when there is none now, and when the reader was overrun.

        Ends with the record that reaches ``limit``: frames that were put together are read together.
        """
        self.commit()
        writer = self._ring.writer_state()
        position = self._state.position
        if position == writer.end:
            return []
        data = self._ring.load(position, min(writer.end - position, READ_BYTES))
        overrun = self._ring.writer_state().oldest > position  # also: while we copied
        found = [] if overrun else self._parse(data, limit, writer.first_seq)
        if not found:  # or the memory is damaged
            self.skip()
        return found

    def skip(self) -> int:
        """Give up what waits and go on with what comes next; returns the number of frames given up."""
        writer = self._ring.writer_state()
        position, expected, lost = self._state
        skipped = max(writer.next_seq - (expected if position else writer.first_seq), 0)
        self._state = ReaderState(writer.end, writer.next_seq, lost + skipped)
        return skipped

    def _parse(self, data: bytes, limit: int, first_seq: int) -> list[RingFrame]:
        """Records in data that begins at our position; first_seq : of the first record of all."""
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
    """The frames of a record."""
    seq, count = FIELDS.unpack_from(content)
    at = FIELDS.size
    columns = []
    for kind in (TIME, FRAME_SIZE, LINK):
        column = array(kind)
        end = at + count * column.itemsize
        column.frombytes(content[at:end])
        columns.append(column)
        at = end
    for t_rx_ns, size, link in zip(*columns, strict=True):
        yield RingFrame(link, seq, t_rx_ns, content[at : at + size])
        seq += 1
        at += size
