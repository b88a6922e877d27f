"""Where frames get their number: one counter for all links, the ring and the buffers."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from fti.buffers.ring import Ring
from fti.buffers.triple import TripleBuffer
from fti.links import Sink


class Intake:
    """Numbers what arrives and hands it on to ring and buffer.  For the one thread that reads.

    What arrives in the same turn of the loop, on all links, is handed on together at its end.
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self._seq = ring.next_seq
        self._begin()

    def _begin(self) -> None:
        self._links: list[int] = []
        self._times: list[int] = []
        self._frames: list[bytes] = []
        self._shares: list[tuple[TripleBuffer, int, Sequence[int], Sequence[bytes]]] = []

    @property
    def seq(self) -> int:
        """The number that the next frame gets; all before it are in their buffers."""
        self.hand_on()
        return self._seq

    def sink(self, index: int, buffer: TripleBuffer) -> Sink:
        """A function that takes the frames of one link, and their times of arrival [ns]."""

        def accept(frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
            if not self._shares:
                asyncio.get_running_loop().call_soon(self.hand_on)
            self._shares.append((buffer, self._seq, times_ns, frames))
            self._seq += len(frames)
            self._links += [index] * len(frames)
            self._times += times_ns
            self._frames += frames

        return accept

    def hand_on(self) -> None:
        """Hand on what has arrived.

        First the ring: it tells the next recorder where to go on, and no number may stand in a file that it does not
        know of.
        """
        if not self._shares:
            return
        links, times_ns, frames, shares = self._links, self._times, self._frames, self._shares
        self._begin()
        self._ring.put_many(links, self._seq - len(frames), times_ns, frames)
        for buffer, first_seq, share_times, share in shares:
            buffer.put_many(first_seq, share_times, share)
