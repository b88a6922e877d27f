"""Angles of tables in degrees instead of radians."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from fti.logger.export.columns import Column

#: Unit in degrees of each unit in radians.
DEGREES = {"rad": "deg", "rad/s": "deg/s"}


class AngleColumns:
    """The columns of a table with angles in degrees.  A value in the unit that its row states is converted with it."""

    def __init__(self, columns: Sequence[Column]) -> None:
        self.columns = [dataclasses.replace(c, unit=DEGREES.get(c.unit or "", c.unit)) for c in columns]
        self._angles = [n for n, column in enumerate(columns) if column.unit in DEGREES]
        names = [column.name for column in columns]
        states_unit = any(column.unit == "unit" for column in columns) and "unit" in names
        self._stated = (names.index("value"), names.index("unit")) if states_unit and "value" in names else None

    def convert(self, cells: list[Any]) -> None:
        """Convert the cells of a row in place."""
        for n in self._angles:
            if cells[n] is not None:
                cells[n] = math.degrees(cells[n])
        if self._stated:
            value, unit = self._stated
            if cells[unit] in DEGREES:
                cells[unit] = DEGREES[cells[unit]]
                cells[value] = None if cells[value] is None else math.degrees(cells[value])
