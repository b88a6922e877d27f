"""The ground truth of a flight as columns over time, interpolated at any time of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fti.arrays import Array, Ints
from fti.constants import SECOND_NS
from fti.errors import MissingError
from fti.hil.truth_log import TOPIC
from fti.logger.reading.json_message import parse_table, using_message
from fti.logger.reading.mcap_file import McapFile, McapMessage

#: Angles that pass through half a turn [rad].
CIRCULAR = ("heading", "roll", "lon")


@dataclass(frozen=True, slots=True)
class TruthTable:
    """Rows of ``/truth/state``.

    t_ns : FTI time of each row [ns], shape (n,), ascending; columns : quantity -> values, shape (n,), NaN where a row
    has none; units and frames as ``fti.hil.truth_log.QUANTITIES`` states them
    """

    t_ns: Ints
    columns: Mapping[str, Array]

    @classmethod
    def read(cls, path: Path) -> TruthTable:
        """Read a truth file.  Raises MissingError where it has no rows, RecordingError where it cannot be read."""
        items = [item for item in McapFile(path).items() if item.topic.name == TOPIC]
        if not items:
            raise MissingError(f"{path}: contains no {TOPIC}: the flight did not begin")
        return cls.of_rows(items)

    @classmethod
    def of_rows(cls, items: Sequence[McapMessage]) -> TruthTable:
        """Make the table of at least one message.  Raises RecordingError."""
        rows = [_numbers(item) for item in items]
        columns = {name: np.array([row.get(name, math.nan) for row in rows]) for name in sorted(set().union(*rows))}
        return cls(np.array([item.log_time for item in items], dtype=np.int64), columns)

    @property
    def begin_ns(self) -> int:
        """FTI time of the first row [ns]."""
        return int(self.t_ns[0])

    @property
    def duration_s(self) -> float:
        """From the first row to the last one [s]."""
        return float(self.t_ns[-1] - self.t_ns[0]) / SECOND_NS

    def seconds(self, t_ns: Ints) -> Array:
        """Time of the flight [s], shape as t_ns."""
        return np.asarray((t_ns - self.t_ns[0]) / SECOND_NS, dtype=np.float64)

    def at(self, name: str, t_ns: Ints) -> Array:
        """A quantity at FTI times [ns], linear between rows, shape as t_ns; angles are unwrapped.

        NaN next to a row without it, outside the flight, and where the truth has no such quantity.
        """
        column = self.columns.get(name)
        if column is None:
            return np.full(np.shape(t_ns), math.nan)
        column = np.unwrap(column) if name in CIRCULAR else column
        t, rows = self.seconds(t_ns), self.seconds(self.t_ns)
        return np.asarray(np.interp(t, rows, column, left=math.nan, right=math.nan), dtype=np.float64)


def _numbers(item: McapMessage) -> dict[str, float]:
    """The numbers of a row; other values are left out.  Raises RecordingError."""
    with using_message(item.topic.name, item.log_time):
        return {key: float(value) for key, value in parse_table(item.data).items() if isinstance(value, int | float)}
