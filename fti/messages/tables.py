"""Messages as JSON tables and back: a field with the value ``ABSENT`` is left out."""

from __future__ import annotations

import dataclasses
import types
import typing
from enum import Enum, StrEnum
from functools import cache
from typing import Any, Literal, TypeVar

from fti.messages.units import union_members

T = TypeVar("T")


class Absent(Enum):
    """The value of a field that the message does not have; false, as None is."""

    ABSENT = "absent"

    def __bool__(self) -> Literal[False]:
        return False


ABSENT = Absent.ABSENT


def to_table(value: Any) -> Any:
    """A message, or a part of one, as JSON types: fields in class order, without absent ones."""
    cls: Any = type(value)
    is_message = dataclasses.is_dataclass(cls)
    if is_message:
        pairs = ((name, getattr(value, name)) for name in required_of_fields(cls))
        return {name: to_table(item) for name, item in pairs if item is not ABSENT}
    if isinstance(value, dict):
        return {key: to_table(item) for key, item in value.items()}
    return [to_table(item) for item in value] if isinstance(value, tuple | list) else value


def from_table(cls: type[T], table: object) -> T:
    """The message of a table.  Raises ValueError, which names the field that is wrong."""
    message: T = _parse(cls, table, "")
    return message


@cache
def required_of_fields(cls: Any) -> dict[str, bool]:
    """Names of the fields of a class, in order, and whether a message must have them: no default."""
    nothing = dataclasses.MISSING
    return {f.name: f.default is nothing and f.default_factory is nothing for f in dataclasses.fields(cls)}


@cache
def types_of_fields(cls: type) -> dict[str, tuple[Any, ...]]:
    """Possible types of each field of a class, without ``Absent``."""
    return {name: present_members(hint) for name, hint in typing.get_type_hints(cls).items()}


def present_members(hint: Any) -> tuple[Any, ...]:
    """The members of a type without ``Absent``."""
    return tuple(member for member in union_members(hint) if member is not Absent)


def _parse(hint: Any, value: Any, path: str) -> Any:
    kinds = hint if isinstance(hint, tuple) else (hint,)
    for kind in kinds:
        origin: Any = typing.get_origin(kind)
        args = typing.get_args(kind)
        if origin is dict and isinstance(value, dict):
            return {key: _parse(present_members(args[1]), item, f"{path}.{key}") for key, item in value.items()}
        if origin is tuple and isinstance(value, list):
            return tuple(_parse(present_members(args[0]), item, f"{path}[{n}]") for n, item in enumerate(value))
        if dataclasses.is_dataclass(kind) and isinstance(value, dict):
            return _parse_fields(kind, value, path)
        if type(value) is kind or (kind is float and type(value) is int) or (kind is str and isinstance(value, str)):
            return value
        if isinstance(kind, type) and issubclass(kind, StrEnum) and value in list(kind):
            return kind(value)
    allowed = " or ".join("null" if kind is types.NoneType else getattr(kind, "__name__", str(kind)) for kind in kinds)
    raise ValueError(f"{path.removeprefix('.') or 'the message'}: {str(value)[:80]!r} is not {allowed}")


def _parse_fields(cls: Any, table: dict[str, Any], path: str) -> Any:
    required, kinds = required_of_fields(cls), types_of_fields(cls)
    for name in table:
        if name not in required:
            raise ValueError(
                f"{f'{path}.{name}'.removeprefix('.')[:80]}: unknown field; there are {', '.join(required)}"
            )
    for name, is_required in required.items():
        if is_required and name not in table:
            raise ValueError(f"{f'{path}.{name}'.removeprefix('.')}: is missing")
    return cls(**{name: _parse(kinds[name], item, f"{path}.{name}") for name, item in table.items()})
