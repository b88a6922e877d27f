"""Stalls of storage, fed through the recorder's buffer."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from fti.buffers.triple_buffer import TripleBuffer
from fti.config import LinkTable
from fti.constants import SECOND_NS
from fti.frame_batch import iter_frames
from fti.parallel_runs import Progress, run_all

RATE_HZ, MESSAGE_BYTES, RECEPTIONS = 100, 66, 2
#: Stalls are drawn from this interval [s]; all exceed the capacity.
STALLS_S = (122.0, 240.0)


def stalls(runs: int, seed: int, progress: Progress) -> list[StallResult]:
    """Stalls of drawn lengths."""
    return run_all(stall, np.random.default_rng(seed).uniform(*STALLS_S, runs).tolist(), progress)


@dataclass(frozen=True, slots=True)
class StallResult:
    """Result of a stall.

    first_loss_s : when the first frame was dropped; oldest_only : exactly the oldest frames are missing, all
    newer ones are kept, and the buffer's gap record has number, bytes and time span of the missing frames
    """

    first_loss_s: float
    oldest_only: bool


def stall(length_s: float) -> StallResult:
    """Feed a stall through a buffer."""
    buffer = TripleBuffer(int(LinkTable.model_fields["buffer_bytes"].default))
    reception = bytes(MESSAGE_BYTES // RECEPTIONS)
    period_ns = SECOND_NS // (RATE_HZ * RECEPTIONS)
    first_loss_s: float | None = None
    count = int(length_s * RATE_HZ * RECEPTIONS)
    for seq in range(count):
        buffer.put(seq, seq * period_ns, reception)
        if first_loss_s is None and buffer.stats.dropped_frames:
            first_loss_s = seq * period_ns / SECOND_NS
    numbers = _drain(buffer)
    return StallResult(first_loss_s or length_s, _oldest_only(buffer, numbers, count, period_ns))


def _drain(buffer: TripleBuffer) -> list[int]:
    """Storage accepts again: sequence numbers of the kept frames in order."""
    numbers: list[int] = []
    while not buffer.is_empty:
        data = buffer.take()
        numbers += [entry[0] for entry in iter_frames(data)]
        buffer.confirm_written(len(data))
    return numbers


def _oldest_only(buffer: TripleBuffer, numbers: list[int], count: int, period_ns: int) -> bool:
    """One gap in the numbers: after the frames in ``global`` when the stall began, before all newer frames."""
    gaps = [(a + 1, b - 1) for a, b in itertools.pairwise(numbers) if b != a + 1]
    spans = buffer.stats.drops
    if len(gaps) != 1 or len(spans) != 1 or numbers[0] != 0 or numbers[-1] != count - 1:
        return False
    (first, last), span = gaps[0], spans[0]
    named = (span.first_seq, span.last_seq, span.frames, span.first_t_ns, span.last_t_ns)
    return named == (first, last, last - first + 1, first * period_ns, last * period_ns)
