"""Time stamps and triple buffer of source 003: capacity, and lost frames after a stall.

Source 003, section 6.3, eq. 6.1 and 6.2.  Closed forms are exact.  The stall is fed through the recorder's buffer:
100 messages a second of 66 B, each in two receptions of 33 B, while storage accepts nothing.  N = runs, each with a
stall of a length of its own; the unit is the stall.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from fti.buffers.triple_buffer import TripleBuffer
from fti.config import LinkTable
from fti.frame_batch import iter_frames
from fti.parallel_runs import Progress
from fti.study import StudyResult

RUNS = 10
SEED = 10

SECOND_NS = 1_000_000_000
DAY_S = 86_400.0
LINKS, QUEUES = 23, 3
RATE_HZ, MESSAGE_BYTES, RECEPTIONS = 100, 66, 2
EXPECTED_STALL_S = 121.5
#: Stalls are drawn from this interval [s]; all exceed the capacity.
STALLS_S = (122.0, 240.0)


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Closed forms, then the stalls."""
    rng = np.random.default_rng(seed)
    stalls = []
    for run in range(runs):
        stalls.append(stall(float(rng.uniform(*STALLS_S))))
        progress((run + 1) / runs)
    return [*closed_forms(), *_judge(stalls)]


def closed_forms() -> list[StudyResult]:
    """Results that follow from the widths of the numbers and the size of the buffers."""
    fine_d = (2**32 - 1) * 50e-6 / DAY_S
    coarse_d = (2**32 - 1) * 1e-3 / DAY_S
    capacity = int(LinkTable.model_fields["buffer_bytes"].default)
    total = LINKS * QUEUES * capacity
    survived_s = TripleBuffer(capacity).capacity_s(RATE_HZ, MESSAGE_BYTES, RECEPTIONS)
    return [
        StudyResult("T10.fine", "32 bits of 50 us last [d] (eq. 6.1)", fine_d, "2.49", round(fine_d, 2) == 2.49),
        StudyResult("T10.coarse", "32 bits of 1 ms last [d]", coarse_d, "49.7", round(coarse_d, 1) == 49.7),
        StudyResult("T10.bytes", "buffers of 23 links [B]", total, "23 x 3 x 2^19", total == 23 * 3 * 2**19),
        StudyResult(
            "T10.capacity",
            "stall that a link survives [s] (eq. 6.2)",
            survived_s,
            f"{EXPECTED_STALL_S}",
            round(survived_s, 1) == EXPECTED_STALL_S,
        ),
    ]


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


def _judge(stalls: list[StallResult]) -> list[StudyResult]:
    min_s = min(stall.first_loss_s for stall in stalls)
    right = sum(stall.oldest_only for stall in stalls)
    return [
        StudyResult(
            "T10.stall",
            f"time without loss, the shortest of {len(stalls)} stalls [s]",
            min_s,
            ">= 121.4",
            min_s >= 121.4,
        ),
        StudyResult(
            "T10.oldest",
            f"stalls of {len(stalls)} after which exactly the oldest frames are missing",
            right,
            f"{len(stalls)}",
            right == len(stalls),
        ),
    ]
