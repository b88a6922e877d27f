"""Deviations of the messages of a topic from the ground truth at the same time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.geodesy.wgs84 import metres_per_radian
from fti.post.score.series import TopicSeries
from fti.post.score.truth_table import TruthTable

#: Measurement and field -> quantity of the truth, where the names differ.
TRUTH_OF: Mapping[tuple[str, str], str] = {
    ("velocity", "north"): "vel_north",
    ("velocity", "east"): "vel_east",
    ("velocity", "down"): "vel_down",
}
#: Quantities whose differences are wrapped to half a turn [rad].
ANGLES = frozenset(("roll", "pitch", "heading", "lat", "lon", "deviation"))
SPEEDS = frozenset(("vel_north", "vel_east", "vel_down", "ground_speed", "tas"))
POSITION_ANGLES = frozenset(("lat", "lon"))


@dataclass(frozen=True, slots=True)
class TruthDeviations:
    """The messages that can be compared, shape (n,) each.

    name : quantity of the truth; rows : their positions in the series; t_s : times of validity [s of the flight]
    value, truth : in the unit of the quantity; error : their difference [unit], of lat and lon along the ground [m]
    """

    name: str
    rows: NDArray[np.intp]
    t_s: Array
    value: Array
    truth: Array
    error: Array

    @property
    def unit(self) -> str:
        """Of the error."""
        if self.name in ANGLES - POSITION_ANGLES:
            return "rad"
        return "m/s" if self.name in SPEEDS else "m"


def compare(series: TopicSeries, quantity: str, truth: TruthTable, name: str | None = None) -> TruthDeviations:
    """Compare valid messages with the truth at their time of validity, where both numbers are known.

    name : quantity of the truth; None : the same name
    """
    kind = series.topic.rpartition("/")[2]
    name = name or TRUTH_OF.get((kind, quantity), quantity)
    valid_ns, value = series.valid_ns, series.column(quantity)
    true = truth.at(name, valid_ns)
    error = value - true
    if name in ANGLES:
        error = np.arctan2(np.sin(error), np.cos(error))
    if name in POSITION_ANGLES:
        error = error * metres_per_radian(truth.at("lat", valid_ns), 0.0)[name != "lat"]  # [m]
    rows = np.flatnonzero(series.valid & np.isfinite(error))
    return TruthDeviations(name, rows, truth.seconds(valid_ns[rows]), value[rows], true[rows], error[rows])
