"""Ground truth for expected flags, from the columns of a truth file or from a planned flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fti.arrays import Array
from fti.config import Device
from fti.hil.environment import Environment
from fti.hil.oracle.roles import TruthSeries
from fti.hil.truth_log import RANGES, TruthRows

#: Columns of a truth file that the oracle reads.
NAMES = ("height_agl", "s", "y", "roll", "pitch", "vel_down")


def truth_of_columns(t: Array, columns: Mapping[str, Array], intercept_m: float) -> TruthSeries:
    """The truth series for expected flags.

    t : time of the flight [s], shape (n,)
    columns : by the names of ``fti.hil.truth_log``, each shape (n,), unknown names NaN; any may be missing
    intercept_m : distance of the glide path intercept point beyond the threshold [m]
    """
    unknown = np.full(len(t), np.nan)
    height_agl, s, y, roll, pitch, down = (columns.get(name, unknown) for name in NAMES)
    of_beam, *_ = RANGES
    names = sorted(name for name in columns if name.startswith(of_beam) and np.isfinite(columns[name]).any())
    beams = {name: _beam(name, columns, unknown) for name in (column.removeprefix(of_beam) for column in names)}
    return TruthSeries(t, height_agl, s - intercept_m, y, roll, pitch, -down, ranges=beams)


def _beam(name: str, columns: Mapping[str, Array], unknown: Array) -> tuple[Array, Array, Array]:
    true, low, high = (columns.get(begin + name, unknown) for begin in RANGES)
    return true, low, high


def planned_truth(world: Environment, altimeters: Sequence[Device]) -> TruthSeries:
    """The truth of a planned flight; takes about a second."""
    rows = TruthRows(world, altimeters)
    return truth_of_columns(rows.t, rows.columns, float(world.path.x_gpi))
