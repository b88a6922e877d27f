"""Where frames get their number: one counter for all links, the ring and the buffers."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from fti.buffers.ring import Ring
from fti.buffers.triple import TripleBuffer
from fti.links import Sink

#: What one link has brought with one read: its index, its buffer, times of arrival [ns], frames.
Share = tuple[int, TripleBuffer, Sequence[int], Sequence[bytes]]


class Intake:
    """Numbers what arrives and hands it on to ring and buffer.  For the one thread that reads.

    What arrives in the same turn of the loop, on all links, is handed on together at its end.
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self._seq = ring.next_seq
        self._arrived: list[Share] = []

    @property
    def seq(self) -> int:
        """The number that the next frame gets; all before it are in their buffers."""
        self.hand_on()
        return self._seq

    def sink(self, index: int, buffer: TripleBuffer) -> Sink:
        """A function that takes the frames of one link, and their times of arrival [ns]."""

        def accept(frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
            if not self._arrived:
                asyncio.get_running_loop().call_soon(self.hand_on)
            self._arrived.append((index, buffer, times_ns, frames))

        return accept

    def hand_on(self) -> None:
        """Number what has arrived and hand it on.

        First the ring: it tells the next recorder where to go on, and no number may stand in a file that it does not
        know of.
        """
        if not self._arrived:
            return
        arrived, self._arrived = self._arrived, []
        first = seq = self._seq
        links, all_times, all_frames = list[int](), list[int](), list[bytes]()
        for index, _, times_ns, frames in arrived:
            links += [index] * len(frames)
            all_times += times_ns
            all_frames += frames
        self._seq = first + len(links)
        self._ring.put_many(links, first, all_times, all_frames)
        for _, buffer, times_ns, frames in arrived:
            buffer.put_many(seq, times_ns, frames)
            seq += len(frames)
