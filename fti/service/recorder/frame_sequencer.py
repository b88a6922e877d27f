"""Assigns sequence numbers to frames, with one counter for all links, and passes them to ring and buffers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from fti.buffers.ring import EntryKind, Ring, pack_source
from fti.buffers.triple_buffer import TripleBuffer
from fti.links import Sink
from fti.messages.frames import TICK_PERIOD_NS

#: With this amount the frames are passed on before the beat, so that a fast line fills its buffer evenly [B].
MAX_WAITING_BYTES = 2**16
FRAME_BYTES = 8  # overhead of a frame
#: Up to this number, frames are numbered in order of arrival, otherwise by link, unless they span more than a beat.
MAX_SORTED_FRAMES = 256
#: Frames of several system calls are merged into a batch up to this size, the maximum of one call.
MAX_MERGED = 64


@dataclass(slots=True)
class PendingFrames:
    """Frames of a link since the last flush.

    source, buffer : of the sink; times : arrival times [ns]; payload : bytes of all frames
    """

    source: int
    buffer: TripleBuffer
    times: list[int] = field(default_factory=list)
    frames: list[bytes] = field(default_factory=list)
    payload: int = 0


class FrameSequencer:
    """Numbers frames and passes them to ring and buffers.  Only for the reader's thread.

    Frames that arrive between two beats of the recorder, on all links, are passed on together.

    soon : schedules a call after all ready sockets were read (a loop's ``call_soon``); a flush between two sockets
           would number the frames of the first before older frames of the second
    """

    def __init__(self, ring: Ring, soon: Callable[[Callable[[], object]], object]) -> None:
        self._ring = ring
        self._soon = soon
        self._seq = ring.next_seq
        self._arrived: list[PendingFrames] = []
        self._latest: dict[int, PendingFrames] = {}
        self._waiting_bytes = 0

    def sink(self, kind: EntryKind, link: int, buffer: TripleBuffer) -> Sink:
        """A function that accepts frames of one kind and link (its index) with their times [ns]."""
        source = pack_source(kind, link)

        def accept(frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
            payload = sum(map(len, frames))
            share = self._latest.get(source)
            if share is None or len(share.frames) + len(frames) > MAX_MERGED:
                share = self._latest[source] = PendingFrames(source, buffer)
                self._arrived.append(share)
            share.times += times_ns
            share.frames += frames
            share.payload += payload
            before, self._waiting_bytes = self._waiting_bytes, self._waiting_bytes + payload + FRAME_BYTES * len(frames)
            if before < MAX_WAITING_BYTES <= self._waiting_bytes:
                self._soon(self.flush)

        return accept

    def flush(self) -> int:
        """Number the pending frames, and pass them on; returns the next number.

        The ring comes first: the next recorder continues from its number, so no file may hold a number that is not
        in the ring.
        """
        if not self._arrived:
            return self._seq
        arrived, self._arrived, self._latest, self._waiting_bytes = self._arrived, [], {}, 0
        sources, times, frames = _flat(arrived)
        first, self._seq = self._seq, self._seq + len(frames)
        seqs: Sequence[int] = range(first, self._seq)
        if len(frames) > 1 and (len(frames) <= MAX_SORTED_FRAMES or max(times) - min(times) > TICK_PERIOD_NS):
            order = sorted(range(len(frames)), key=times.__getitem__)
            seqs = [first + rank for rank in sorted(range(len(frames)), key=order.__getitem__)]
            sources, times, frames = [sources[i] for i in order], [times[i] for i in order], [frames[i] for i in order]
        self._ring.put_many(sources, first, times, frames)
        at = 0
        for share in arrived:
            end = at + len(share.frames)
            share.buffer.put_batch((seqs[at:end], share.times, share.frames, share.payload))
            at = end
        return self._seq


def _flat(arrived: Sequence[PendingFrames]) -> tuple[list[int], list[int], list[bytes]]:
    """Source, arrival time and bytes of every frame, link by link."""
    sources: list[int] = []
    times: list[int] = []
    frames: list[bytes] = []
    for share in arrived:
        sources += [share.source] * len(share.frames)
        times += share.times
        frames += share.frames
    return sources, times, frames
