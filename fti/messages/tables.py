"""Base class of the messages, and messages as JSON tables and back: a field with the value ``UNSET`` is left out."""

from __future__ import annotations

import typing
from functools import cache
from typing import Any, TypeVar, dataclass_transform

import msgspec

T = TypeVar("T")
S = TypeVar("S", bound=msgspec.Struct)


@dataclass_transform(frozen_default=True, field_specifiers=(msgspec.field,))
class Message(msgspec.Struct, frozen=True, gc=False, forbid_unknown_fields=True):
    """A message: frozen, and without references to itself, so that the garbage collector need not visit it."""


@dataclass_transform(frozen_default=True, field_specifiers=(msgspec.field,))
class Arrays(msgspec.Struct, frozen=True, gc=False):
    """Arrays of numbers in a message, as bytes.  Navigation has them; records, tables and schemas leave them out."""


@cache
def array_fields(cls: type) -> dict[str, Arrays]:
    """The fields of a message that are arrays, with their defaults, which are empty; none of another class."""
    if not issubclass(cls, msgspec.Struct):
        return {}
    return {field.name: field.default for field in msgspec.structs.fields(cls) if isinstance(field.default, Arrays)}


def recorded_hints(cls: type, *, include_extras: bool = False) -> dict[str, Any]:
    """Types of the fields of a message that are recorded; with ``include_extras`` they have their units."""
    hints = typing.get_type_hints(cls, include_extras=include_extras)
    return {name: hint for name, hint in hints.items() if name not in array_fields(cls)}


def without_arrays(message: S) -> S:
    """The part of a message that is recorded."""
    empty = array_fields(type(message))
    return msgspec.structs.replace(message, **empty) if empty else message


def to_table(value: Any) -> Any:
    """A message, or a part of one, as types that JSON has, and tuples: fields in class order, without absent ones."""
    return msgspec.to_builtins(value, enc_hook=_to_float)


def _to_float(value: Any) -> float:
    """The value of a float of numpy."""
    if isinstance(value, float):
        return float(value)
    raise TypeError(f"{type(value).__name__} cannot be a part of a message")


def from_table(cls: type[T], table: object) -> T:
    """The message of a table.  Raises ValueError, which names the field that is wrong."""
    try:
        return msgspec.convert(table, cls)
    except msgspec.ValidationError as error:
        text, _, path = str(error).partition(" - at `$.")
        raise ValueError(f"{path[:-1]}: {text}" if path else text) from None
