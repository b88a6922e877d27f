"""The error of the navigated altitude beside what the monitor says of it: its estimate, and its protection level."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fti.post.score.outputs.errors import QuantityError
from fti.post.score.outputs.row import Check, OutputRow, verdict_of
from fti.post.score.series import Array, Mask, TopicSeries
from fti.post.score.truth_table import TruthTable


def navigated_error(integrity: TopicSeries, solution: TopicSeries, table: TruthTable) -> Array:
    """Error of the altitude that navigation gave at the times of the monitor's messages [m], shape (n,)."""
    altitude = solution.column("alt")
    known = solution.valid & np.isfinite(altitude)
    if not known.any():
        return np.full(len(integrity), np.nan)
    times = table.seconds(solution.valid_ns[known])
    order = np.argsort(times, kind="stable")
    wrong = (altitude - table.at("alt", solution.valid_ns))[known][order]
    return np.interp(table.seconds(integrity.valid_ns), times[order], wrong)


def height_error(integrity: TopicSeries, error: Array, limit_m: float) -> QuantityError:
    """b(0) of the monitor, beside the error of the navigated altitude, which it estimates."""
    found = integrity.column("height_error")
    return QuantityError(
        "height error", "m", found - error, integrity.column("height_error_sd"), limit_m, must_state=True
    )


def protection(integrity: TopicSeries, error: Array, judged: Mask, t: Array) -> Iterator[OutputRow]:
    """One row: hazardously misleading information is a valid state with an error beyond its protection level.

    error : of the navigated altitude [m], shape (n,); judged : valid messages of the monitor; t : their times [s of the
    flight]
    """
    level = integrity.column("protection_level_v")
    at = np.flatnonzero(judged & np.isfinite(level) & np.isfinite(error))
    if not len(at):
        return
    excess = np.abs(error[at]) - level[at]
    worst = int(np.argmax(excess))
    yield OutputRow(
        integrity.topic,
        Check.PROTECTED,
        "navigated altitude",
        verdict_of(not bool(np.any(excess > 0.0))),
        f"error {abs(error[at][worst]):.3g} m",
        f"<= {level[at][worst]:.3g} m",
        float(t[at[worst]]),
    )
