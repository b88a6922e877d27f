"""Targets of the study ``triple_buffer``: closed forms, and stalls."""

from __future__ import annotations

from fti.buffers.triple_buffer import TripleBuffer
from fti.config import LinkTable
from fti.study import StudyResult
from fti.study.triple_buffer.experiment import MESSAGE_BYTES, RATE_HZ, RECEPTIONS, StallResult

DAY_S = 86_400.0
LINKS, QUEUES = 23, 3
EXPECTED_STALL_S, MIN_STALL_S = 121.5, 121.4


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


def judge_stalls(stalls: list[StallResult]) -> list[StudyResult]:
    """The shortest time without loss, and which frames are missing."""
    count, shortest_s = len(stalls), min(stall.first_loss_s for stall in stalls)
    right = sum(stall.oldest_only for stall in stalls)
    text = f"stalls of {count} after which exactly the oldest frames are missing"
    return [
        StudyResult.at_least(
            "T10.stall", f"time without loss, the shortest of {count} stalls [s]", shortest_s, MIN_STALL_S
        ),
        StudyResult("T10.oldest", text, right, f"{count}", right == count),
    ]
