"""Base class of the messages, and messages as JSON tables and back: a field with the value ``UNSET`` is left out."""

from __future__ import annotations

from typing import Any, TypeVar, dataclass_transform

import msgspec

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(msgspec.field,))
class Message(msgspec.Struct, frozen=True, gc=False, forbid_unknown_fields=True):
    """A message: frozen, and without references to itself, so that the garbage collector need not visit it."""


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
