"""Where frames get their number: one counter for all links, the ring and the buffers."""

from __future__ import annotations

from collections.abc import Sequence

from fti.buffers.ring import Group, Ring
from fti.buffers.triple import TripleBuffer
from fti.links import Sink

#: So many groups do not wait for the beat.
MOST_GROUPS = 64


class Intake:
    """Numbers what arrives and hands it on to ring and buffer.  For the one thread that reads.

    What arrives between two beats of the recorder, on all links, is handed on together.
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self._seq = ring.next_seq
        self._arrived: list[Group] = []
        self._buffers: list[TripleBuffer] = []

    @property
    def seq(self) -> int:
        """The number that the next frame gets; all before it are in their buffers."""
        self.hand_on()
        return self._seq

    def sink(self, index: int, buffer: TripleBuffer) -> Sink:
        """A function that takes the frames of one link, and their times of arrival [ns]."""

        def accept(frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
            self._arrived.append((index, times_ns, frames))
            self._buffers.append(buffer)
            if len(self._arrived) >= MOST_GROUPS:
                self.hand_on()

        return accept

    def hand_on(self) -> None:
        """Number what has arrived, and hand it on.

        First the ring: it tells the next recorder where to go on, and no number may stand in a file that it does not
        know of.
        """
        if not self._arrived:
            return
        arrived, buffers, seq = self._arrived, self._buffers, self._seq
        self._arrived, self._buffers = [], []
        self._seq += sum(len(frames) for _, _, frames in arrived)
        self._ring.put(seq, arrived)
        for buffer, (_, times_ns, frames) in zip(buffers, arrived, strict=True):
            buffer.put_many(seq, times_ns, frames)
            seq += len(frames)
