"""Where frames get their number: one counter for all links, the ring and the buffers."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from itertools import chain
from operator import itemgetter

from fti.buffers.ring import Group, Ring
from fti.buffers.triple import TripleBuffer
from fti.links import Sink

#: So much does not wait for the beat: a fast line must not come to a buffer all at once [B].
MOST_BYTES = 2**16
FRAME_BYTES = 8  # what a frame counts besides its payload
#: Frames of different links are numbered in order of arrival to so much; closer ones, link by link.
SLOT_NS = 5_000_000
#: What one link has brought, with the slot of its first frame, and the buffer that it goes into.
Share = tuple[int, Group, TripleBuffer]


class Intake:
    """Numbers what arrives and hands it on to ring and buffer.  For the one thread that reads.

    What arrives between two beats of the recorder, on all links, is handed on together.
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self._seq = ring.next_seq
        self._arrived: list[Share] = []
        self._waiting_bytes = 0

    @property
    def seq(self) -> int:
        """The number that the next frame gets; all before it are in their buffers."""
        self.hand_on()
        return self._seq

    def sink(self, index: int, buffer: TripleBuffer) -> Sink:
        """A function that takes the frames of one link, and their times of arrival [ns]."""

        def accept(frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
            self._arrived.append((times_ns[0] // SLOT_NS, (index, times_ns, frames), buffer))
            self._waiting_bytes += sum(map(len, frames)) + FRAME_BYTES * len(frames)
            if self._waiting_bytes >= MOST_BYTES:
                self.hand_on()

        return accept

    def hand_on(self) -> None:
        """Number what has arrived, and hand it on.

        First the ring: it tells the next recorder where to go on, and no number may stand in a file that it does not
        know of.
        """
        if not self._arrived:
            return
        arrived, self._arrived, self._waiting_bytes = self._arrived, [], 0
        shares = sorted(chain.from_iterable(map(_cut, arrived)), key=itemgetter(0))
        seq = self._seq
        self._seq += sum(len(frames) for _, (_, _, frames), _ in shares)
        self._ring.put(seq, [group for _, group, _ in shares])
        for _, (_, times_ns, frames), buffer in shares:
            buffer.put_many(seq, times_ns, frames)
            seq += len(frames)


def _cut(share: Share) -> Sequence[Share]:
    """The same frames, those of each slot for themselves."""
    slot, (index, times_ns, frames), buffer = share
    if times_ns[-1] // SLOT_NS == slot:
        return (share,)
    found, begin = [], 0
    while begin < len(times_ns):
        slot = times_ns[begin] // SLOT_NS
        end = bisect_left(times_ns, (slot + 1) * SLOT_NS, begin)
        found.append((slot, (index, times_ns[begin:end], frames[begin:end]), buffer))
        begin = end
    return found
