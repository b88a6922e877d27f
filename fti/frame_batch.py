"""Frames of one link that go from reader to writer as one thing: what arrived between two hand-overs.

A busy link brings dozens of frames with one call of the kernel, a serial line one message with several.  Handing them
on one by one would cost more than receiving them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

#: Position in the session and FTI time of arrival [ns] of each frame, neither of which goes back, the bytes of each,
#: the bytes of all together [B].  At least one frame.
FrameBatch = tuple[Sequence[int], Sequence[int], Sequence[bytes], int]
#: One frame: position in the session, FTI time of arrival [ns], bytes.
NumberedFrame = tuple[int, int, bytes]


def make_batch(first_seq: int, times_ns: Sequence[int], frames: Sequence[bytes]) -> FrameBatch:
    """Frames that arrived together, numbered one after another from first_seq on."""
    return range(first_seq, first_seq + len(frames)), times_ns, frames, sum(map(len, frames))


def single_frame_batch(seq: int, t_ns: int, data: bytes) -> FrameBatch:
    """A frame that arrived alone."""
    return (seq,), (t_ns,), (data,), len(data)


def entries(bursts: Iterable[FrameBatch]) -> Iterator[NumberedFrame]:
    """Each frame for itself."""
    for seqs, times_ns, frames, _ in bursts:
        yield from zip(seqs, times_ns, frames, strict=True)


def split(burst: FrameBatch, count: int) -> tuple[FrameBatch, FrameBatch]:
    """The first ``count`` frames, and the others; both have some."""
    seqs, times_ns, frames, payload = burst
    size = sum(map(len, frames[:count]))
    head = seqs[:count], times_ns[:count], frames[:count], size
    return head, (seqs[count:], times_ns[count:], frames[count:], payload - size)
