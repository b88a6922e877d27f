"""Columns of the table of a topic, with type and unit: by the class of its messages, or found by reading them."""

from __future__ import annotations

import json
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Any

from fti.logger.export.units import class_of, unit_of, with_unit
from fti.messages.tables import Message, recorded_hints
from fti.messages.units import present_members

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
    UTC = "timestamp"  # in ns since 1970


@dataclass(frozen=True, slots=True)
class Column:
    """A column.  name : path of the field (``stamp.t_rx_ns``, ``accel_b.0``); unit : None when it is not a number;
    nullable : it may have unknown values.
    """

    name: str
    type: Type
    unit: str | None = None
    nullable: bool = True

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


@cache
def types_of_class(cls: type) -> dict[str, Type]:
    """Types of the columns of a class of messages by their names; a list of messages is a text, of JSON."""
    found: dict[str, Type] = {}
    for name, hint in recorded_hints(cls).items():
        kind = next(member for member in present_members(hint) if member is not types.NoneType)
        arguments = typing.get_args(kind)
        if typing.get_origin(kind) is tuple and ... not in arguments:
            found |= {f"{name}.{n}": _scalar(member) for n, member in enumerate(arguments)}
        elif typing.get_origin(kind) is tuple:
            found[name] = Type.TEXTS if issubclass(arguments[0], str) else Type.TEXT
        elif isinstance(kind, type) and issubclass(kind, Message):
            found |= {f"{name}.{inner}": scalar for inner, scalar in types_of_class(kind).items()}
        elif isinstance(kind, type):
            found[name] = _scalar(kind)
    return found


def _scalar(kind: type) -> Type:
    return {bool: Type.BOOL, int: Type.INT, float: Type.FLOAT}.get(kind, Type.TEXT)


class ColumnFinder:
    """Collects the columns of one topic, in order of appearance."""

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._stated = types_of_class(cls) if (cls := class_of(topic)) else {}
        self._types: dict[str, set[type]] = {}

    def add(self, cells: Mapping[str, Any]) -> int:
        """Add the cells of a message; returns the number of new columns."""
        found = self._types
        before = len(found)
        for name, value in cells.items():
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
        stated = self._stated.get(name)
        if not kinds:  # never known
            return Column(name, stated or (Type.FLOAT if unit else Type.TEXT), unit)
        if kinds <= {int, float}:
            return Column(name, Type.INT if kinds == {int} and stated is not Type.FLOAT else Type.FLOAT, unit)
        plain = {bool: Type.BOOL, list: Type.TEXTS}
        return Column(name, plain.get(next(iter(kinds)), Type.TEXT) if len(kinds) == 1 else Type.TEXT)


def cell(value: Any, kind: Type) -> Any:
    """Convert a value to the type of its column; a text column holds other values as JSON."""
    if value is None or kind in (Type.INT, Type.BOOL, Type.TEXTS, Type.BYTES):
        return value
    if kind is Type.FLOAT:
        return float(value)
    return value if isinstance(value, str) else json.dumps(value)
