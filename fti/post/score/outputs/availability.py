"""Check that an output is valid where all of its inputs are available.

Without it an output that is never valid would pass.  The required validity follows from the truth and the faults.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fti.hil.oracle.flag_definitions import FlagAllowance
from fti.hil.tables.limits import ScoreLimits
from fti.post.score.outputs.row import OutputCheck, OutputRow, result_of
from fti.post.score.rows import Result
from fti.post.score.series import Array, Mask, TopicSeries

#: Minimum number of messages for a share.
MIN_COUNT = 10
#: Maximum share of invalid messages that the flight may explain.
EXPLAINED_SHARE = 0.3


def availability(
    series: TopicSeries, due: Mask, t: Array, may: Sequence[FlagAllowance], limits: ScoreLimits
) -> Iterator[OutputRow]:
    """One row.

    due : messages that must be valid, shape (n,); t : times of all messages [s of the flight], shape (n,)
    may : flags that the flight allows
    """
    if not any("valid" in row for row in series.rows):
        return
    invalid = due & ~series.valid
    explained = np.zeros(len(t), dtype=bool)
    for i in np.flatnonzero(invalid).tolist():
        explained[i] = _is_explained(series.topic, series.rows[i].get("reasons"), float(t[i]), may)
    count = int(np.count_nonzero(due))
    share = 1.0 - int(np.count_nonzero(invalid & ~explained)) / max(count, 1)
    explained_share = int(np.count_nonzero(explained)) / max(count, 1)
    result = result_of(share >= limits.valid_share and explained_share <= EXPLAINED_SHARE)
    at = np.flatnonzero(invalid & ~explained)
    yield OutputRow(
        series.topic,
        OutputCheck.VALID,
        "",
        result if count >= MIN_COUNT else Result.NOT_COMPARED,
        f"{share:.1%} of {count} messages"
        + (f", {explained_share:.1%} not, as the flight explains" if explained_share else ""),
        f">= {limits.valid_share:.0%}",
        float(t[at[0]]) if len(at) else None,
    )


def _is_explained(topic: str, reasons: object, t: float, may: Sequence[FlagAllowance]) -> bool:
    """Does the flight explain every reason?"""
    if not isinstance(reasons, list) or not reasons:
        return False
    now = [one for one in may if one.from_s <= t <= one.until_s]
    return all(any(one.explains(topic, str(reason)) for one in now) for reason in reasons)
