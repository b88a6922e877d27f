"""Errors of position, altitude and attitude against the protection levels of navigation and of the monitor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from fti.arrays import Array, Mask
from fti.hil.oracle.flag_definitions import SOLUTION
from fti.hil.oracle.required_outputs import LOCATION
from fti.post.score.outputs.errors import QuantityError
from fti.post.score.outputs.row import OutputCheck, OutputRow, result_of
from fti.post.score.series import TopicSeries
from fti.post.score.truth_table import TruthTable

#: Field with the protection level of each quantity.
LEVELS = {"horizontal": "hpl", "altitude": "vpl", "roll": "tilt_pl", "pitch": "tilt_pl", "heading": "heading_pl"}
ANGLES = frozenset(("roll", "pitch", "heading"))
#: Attitudes are compared five times a second, with data of 0.4 s before: delay until their level covers a fault [s].
ANGLES_COMPARED_S = 1.0


def stated_level(series: TopicSeries, others: Mapping[str, TopicSeries], quantity: str) -> Array:
    """Protection level of a quantity in each message [m, deg], shape (n,), NaN where none.

    others : series by topic; a location has the level of its solution
    """
    field = LEVELS.get(quantity, "")
    if quantity in ANGLES:
        return np.asarray(np.rad2deg(series.column(field)))
    if series.topic != LOCATION or SOLUTION not in others:
        return series.column(field)
    solution = others[SOLUTION]
    levels = dict(zip(solution.log_ns.tolist(), solution.column(field).tolist(), strict=True))
    return np.array([levels.get(t_ns, np.nan) for t_ns in series.log_ns.tolist()], dtype=np.float64)


def protection_row(topic: str, quantity: QuantityError, valid: Mask, t: Array, level: Array) -> Iterator[OutputRow]:
    """One row: no valid value has an error beyond its stated protection level.

    valid : valid messages, shape (n,); t : their times [s of the flight]; level : in the unit of the quantity, NaN
    where none, same shape
    """
    if topic != LOCATION:
        yield from _level_row((topic, quantity.name, quantity.unit), quantity.error, level, valid, t)


def navigated_error(integrity: TopicSeries, solution: TopicSeries, table: TruthTable) -> Array:
    """Error of the navigated altitude at the times of the monitor's messages [m], shape (n,)."""
    altitude = solution.column("alt")
    known = solution.valid & np.isfinite(altitude)
    if not known.any():
        return np.full(len(integrity), np.nan)
    times = table.seconds(solution.valid_ns[known])
    order = np.argsort(times, kind="stable")
    error = (altitude - table.at("alt", solution.valid_ns))[known][order]
    return np.interp(table.seconds(integrity.valid_ns), times[order], error)


def height_error(integrity: TopicSeries, error: Array, limit_m: float) -> QuantityError:
    """Error of b(0) of the monitor, its estimate of the error of the navigated altitude."""
    estimate = integrity.column("height_error")
    return QuantityError(
        "height error", "m", estimate - error, integrity.column("height_error_sd"), limit_m, must_state=True
    )


def protection(integrity: TopicSeries, error: Array, valid: Mask, t: Array) -> Iterator[OutputRow]:
    """One row: hazardously misleading information is a valid state with an error beyond its protection level.

    error : of the navigated altitude [m], shape (n,); valid : valid messages of the monitor; t : their times [s of the
    flight]
    """
    level = integrity.column("protection_level_v")
    yield from _level_row((integrity.topic, "navigated altitude", "m"), error, level, valid, t)


def _level_row(what: tuple[str, str, str], error: Array, level: Array, valid: Mask, t: Array) -> Iterator[OutputRow]:
    at = np.flatnonzero(valid & np.isfinite(level) & np.isfinite(error))
    if not len(at):
        return
    excess = np.abs(error[at]) - level[at]
    worst = int(np.argmax(excess))
    topic, name, unit = what
    yield OutputRow(
        topic,
        OutputCheck.PROTECTED,
        name,
        result_of(not bool(np.any(excess > 0.0))),
        f"error {abs(error[at][worst]):.3g} {unit}",
        f"<= {level[at][worst]:.3g} {unit}",
        float(t[at[worst]]),
    )
