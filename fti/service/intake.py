"""Where frames get their number: one counter for all links, the ring and the buffers."""

from __future__ import annotations

from collections.abc import Sequence

from fti.buffers.ring import Ring
from fti.buffers.triple import TripleBuffer
from fti.links import Sink


class Intake:
    """Numbers what arrives and hands it on to ring and buffer.  For the one thread that reads.

    seq : the number that the next frame gets
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self.seq = ring.next_seq

    def sink(self, index: int, buffer: TripleBuffer) -> Sink:
        """A function that takes the frames of one link, and their times of arrival [ns].

        First the ring: it tells the next recorder where to go on, and no number may stand in a file that it does not
        know of.
        """
        put_ring, put_buffer = self._ring.put_many, buffer.put_many

        def accept(frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
            seq = self.seq
            self.seq = seq + len(frames)
            put_ring(index, seq, times_ns, frames)
            put_buffer(seq, times_ns, frames)

        return accept
