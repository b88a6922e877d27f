"""Columns of the table of a topic, with type and unit, found by reading its messages."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from fti.logger.export.units import unit_of, with_unit

#: Largest integer of an integer column; a larger one is a float.
MAX_INT64 = 2**63 - 1


class Type(StrEnum):
    """Type of a column."""

    INT = "int64"
    FLOAT = "float64"
    BOOL = "bool"
    TEXT = "string"
    TEXTS = "list<string>"
    BYTES = "binary"


@dataclass(frozen=True, slots=True)
class Column:
    """A column.  name : path of the field (``stamp.t_rx_ns``, ``accel_b.0``); unit : None when it is not a number."""

    name: str
    type: Type
    unit: str | None = None

    @property
    def head(self) -> str:
        """The name with its unit: ``height_agl [m]``."""
        return with_unit(self.name, self.unit)


def flatten(value: Any, name: str = "") -> dict[str, Any]:
    """Cells of a JSON value: ``stamp.t_rx_ns``, ``accel_b.0``.

    A list of texts is one cell; a list of tables is one cell of JSON.
    """
    cells: dict[str, Any] = {}
    _flatten(value, name, cells)
    return cells


def _flatten(value: Any, name: str, cells: dict[str, Any]) -> None:
    if isinstance(value, dict):
        for key, item in value.items():
            path = f"{name}.{key}" if name else key
            if isinstance(item, dict | list):
                _flatten(item, path, cells)
            else:
                cells[path] = item
    elif not isinstance(value, list) or all(isinstance(item, str) for item in value):
        cells[name] = value
    elif any(isinstance(item, dict | list) for item in value):
        cells[name] = json.dumps(value)
    else:
        cells.update((f"{name}.{n}", item) for n, item in enumerate(value))


class ColumnFinder:
    """Collects the columns of one topic, in order of appearance."""

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._types: dict[str, set[type]] = {}

    def add(self, message: Any) -> int:
        """Add a JSON message; returns the number of new columns."""
        found = self._types
        before = len(found)
        for name, value in flatten(message).items():
            kind = float if type(value) is int and abs(value) > MAX_INT64 else type(value)
            if name in found:
                found[name].add(kind)
            else:
                found[name] = {kind}
        return len(found) - before

    def columns(self) -> list[Column]:
        """The columns.  A list that was null in a message has no column of its own."""
        names = [name for name in self._types if f"{name}.0" not in self._types]
        return [self._column(name, self._types[name] - {type(None)}) for name in names]

    def _column(self, name: str, kinds: set[type]) -> Column:
        unit = unit_of(self._topic, name)
        if not kinds:  # never known
            return Column(name, Type.FLOAT if unit else Type.TEXT, unit)
        if kinds <= {int, float}:
            return Column(name, Type.INT if kinds == {int} else Type.FLOAT, unit)
        plain = {bool: Type.BOOL, list: Type.TEXTS}
        return Column(name, plain.get(next(iter(kinds)), Type.TEXT) if len(kinds) == 1 else Type.TEXT)


def cell(value: Any, kind: Type) -> Any:
    """Convert a value to the type of its column; a text column holds other values as JSON."""
    if value is None or kind in (Type.INT, Type.BOOL, Type.TEXTS, Type.BYTES):
        return value
    if kind is Type.FLOAT:
        return float(value)
    return value if isinstance(value, str) else json.dumps(value)
