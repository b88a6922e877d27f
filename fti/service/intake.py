"""Where frames get their number: one counter for all links, the ring and the buffers."""

from __future__ import annotations

from collections.abc import Callable

from fti.buffers.ring import Ring
from fti.buffers.triple import TripleBuffer


class Intake:
    """Numbers what arrives and hands it on to ring and buffer.  For the one thread that reads.

    seq : the number that the next frame gets
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self.seq = ring.next_seq

    def sink(self, index: int, buffer: TripleBuffer) -> Callable[[bytes, int], None]:
        """A function that takes the frames (bytes, FTI time of arrival [ns]) of one link.

        First the ring: it tells the next recorder where to go on, and no number may stand in a file that it does not
        know of.
        """

        def accept(data: bytes, t_ns: int) -> None:
            seq = self.seq
            self.seq = seq + 1
            self._ring.put(index, seq, t_ns, data)
            buffer.put(seq, t_ns, data)

        return accept
