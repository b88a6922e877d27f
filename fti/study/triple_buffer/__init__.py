"""Time stamps and triple buffer of source 003: capacity, and lost frames after a stall.

Source 003, section 6.3, eq. 6.1 and 6.2.  Closed forms are exact.  The stall is fed through the recorder's buffer:
100 messages a second of 66 B, each in two receptions of 33 B, while storage accepts nothing.  N = runs, each with a
stall of a length of its own; the unit is the stall.
"""

from __future__ import annotations

from fti.parallel_runs import Progress
from fti.study import StudyResult
from fti.study.triple_buffer.experiment import stalls
from fti.study.triple_buffer.judge import closed_forms, judge_stalls

RUNS = 10
SEED = 10


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Closed forms, then the stalls."""
    return [*closed_forms(), *judge_stalls(stalls(runs, seed, progress))]
