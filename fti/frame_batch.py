"""A batch of frames of one link: the frames that arrived between two hand-overs from reader to writer.

One system call reads dozens of frames of a busy link; a serial line delivers one message in several reads.  Passing the
frames on one by one would cost more than receiving them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

#: Sequence number and FTI time of arrival [ns] of each frame, both nondecreasing; the data of each frame; the size of
#: all of them [B].  At least one frame.
FrameBatch = tuple[Sequence[int], Sequence[int], Sequence[bytes], int]
#: One frame: sequence number in the session, FTI time of arrival [ns], data.
NumberedFrame = tuple[int, int, bytes]


def make_batch(first_seq: int, times_ns: Sequence[int], frames: Sequence[bytes]) -> FrameBatch:
    """Frames that arrived together, numbered consecutively from first_seq on."""
    return range(first_seq, first_seq + len(frames)), times_ns, frames, sum(map(len, frames))


def single_frame_batch(seq: int, t_ns: int, data: bytes) -> FrameBatch:
    """A batch of one frame."""
    return (seq,), (t_ns,), (data,), len(data)


def iter_frames(batches: Iterable[FrameBatch]) -> Iterator[NumberedFrame]:
    """All frames of the batches, one by one."""
    for seqs, times_ns, frames, _ in batches:
        yield from zip(seqs, times_ns, frames, strict=True)


def split_batch(batch: FrameBatch, count: int) -> tuple[FrameBatch, FrameBatch]:
    """The first ``count`` frames, and the remaining ones; neither part is empty."""
    seqs, times_ns, frames, payload = batch
    size = sum(map(len, frames[:count]))
    head = seqs[:count], times_ns[:count], frames[:count], size
    return head, (seqs[count:], times_ns[count:], frames[count:], payload - size)
