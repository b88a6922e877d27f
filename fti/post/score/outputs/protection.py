"""Does the protection level of the monitor hold the true error of the navigated height?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fti.post.score.outputs.row import Check, OutputRow, verdict_of
from fti.post.score.series import Array, Mask, TopicSeries
from fti.post.score.truth_table import TruthTable


def protection(
    integrity: TopicSeries, solution: TopicSeries, judged: Mask, t: Array, table: TruthTable
) -> Iterator[OutputRow]:
    """One row: hazardously misleading information is a valid state with an error beyond its protection level.

    judged : valid messages of the monitor, shape (n,); t : their times [s of the flight].  The error is that of the
    altitude that navigation gave at the same time.
    """
    known = solution.valid & np.isfinite(solution.column("alt"))
    level = integrity.column("protection_level_v")
    at = np.flatnonzero(judged & np.isfinite(level))
    if not known.any() or not len(at):
        return
    times = table.seconds(solution.valid_ns[known])
    order = np.argsort(times, kind="stable")
    wrong = (solution.column("alt") - table.at("alt", solution.valid_ns))[known][order]
    error = np.abs(np.interp(table.seconds(integrity.valid_ns[at]), times[order], wrong))
    excess = error - level[at]
    worst = int(np.nanargmax(np.where(np.isfinite(excess), excess, -np.inf)))
    yield OutputRow(
        integrity.topic,
        Check.PROTECTED,
        "navigated altitude",
        verdict_of(not bool(np.any(excess > 0.0))),
        f"error {error[worst]:.3g} m",
        f"<= {level[at][worst]:.3g} m",
        float(t[at[worst]]),
    )
