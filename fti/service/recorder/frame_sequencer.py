"""Where frames get their number: one counter for all links, the ring and the buffers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from fti.buffers.ring import Ring
from fti.buffers.triple_buffer import TripleBuffer
from fti.links import Sink
from fti.types import TICK_PERIOD_NS

#: So much does not wait for the beat: a fast line must not come to a buffer all at once [B].
MAX_WAITING_BYTES = 2**16
FRAME_BYTES = 8  # what a frame counts besides its payload
#: So many frames are numbered in order of arrival; more too when they span more than a beat, but a flood link by link.
MAX_SORTED_FRAMES = 256
#: What a link brings with several calls of the kernel is one burst up to so many frames, as many as one call brings.
MAX_MERGED = 64


@dataclass(slots=True)
class PendingFrames:
    """Frames that a link has brought since the last hand-over.

    index, buffer : of the link; times : of arrival [ns]; payload : bytes of all frames
    """

    index: int
    buffer: TripleBuffer
    times: list[int] = field(default_factory=list)
    frames: list[bytes] = field(default_factory=list)
    payload: int = 0


class FrameSequencer:
    """Numbers what arrives and hands it on to ring and buffer.  For the one thread that reads.

    What arrives between two beats of the recorder, on all links, is handed on together.

    soon : calls when all that is there has been read (a loop's ``call_soon``): what is handed on between two sockets
           would be numbered before what the second has had for longer
    """

    def __init__(self, ring: Ring, soon: Callable[[Callable[[], None]], object]) -> None:
        self._ring = ring
        self._soon = soon
        self._seq = ring.next_seq
        self._arrived: list[PendingFrames] = []
        self._latest: dict[int, PendingFrames] = {}
        self._waiting_bytes = 0

    @property
    def seq(self) -> int:
        """The number that the next frame gets; all before it are in their buffers."""
        self.flush()
        return self._seq

    def sink(self, index: int, buffer: TripleBuffer) -> Sink:
        """A function that takes the frames of one link, and their times of arrival [ns]."""

        def accept(frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
            payload = sum(map(len, frames))
            share = self._latest.get(index)
            if share is None or len(share.frames) + len(frames) > MAX_MERGED:
                share = self._latest[index] = PendingFrames(index, buffer)
                self._arrived.append(share)
            share.times += times_ns
            share.frames += frames
            share.payload += payload
            before, self._waiting_bytes = self._waiting_bytes, self._waiting_bytes + payload + FRAME_BYTES * len(frames)
            if before < MAX_WAITING_BYTES <= self._waiting_bytes:
                self._soon(self.flush)

        return accept

    def flush(self) -> None:
        """Number what has arrived, and hand it on.

        First the ring: it tells the next recorder where to go on, and no number may stand in a file that it does not
        know of.
        """
        if not self._arrived:
            return
        arrived, self._arrived, self._latest, self._waiting_bytes = self._arrived, [], {}, 0
        links, times, frames = _flat(arrived)
        first, self._seq = self._seq, self._seq + len(frames)
        seqs: Sequence[int] = range(first, self._seq)
        if len(frames) > 1 and (len(frames) <= MAX_SORTED_FRAMES or max(times) - min(times) > TICK_PERIOD_NS):
            order = sorted(range(len(frames)), key=times.__getitem__)
            seqs = [first + rank for rank in sorted(range(len(frames)), key=order.__getitem__)]
            links, times, frames = [links[i] for i in order], [times[i] for i in order], [frames[i] for i in order]
        self._ring.put_many(links, first, times, frames)
        at = 0
        for share in arrived:
            end = at + len(share.frames)
            share.buffer.put_burst((seqs[at:end], share.times, share.frames, share.payload))
            at = end


def _flat(arrived: Sequence[PendingFrames]) -> tuple[list[int], list[int], list[bytes]]:
    """Link, time of arrival and bytes of every frame, link by link."""
    links: list[int] = []
    times: list[int] = []
    frames: list[bytes] = []
    for share in arrived:
        links += [share.index] * len(share.frames)
        times += share.times
        frames += share.frames
    return links, times, frames
