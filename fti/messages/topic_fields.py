"""Fields of the messages of a topic: name, type in words, unit."""

from __future__ import annotations

import types
import typing
from enum import StrEnum
from functools import cache
from typing import Annotated, Any, NamedTuple

from msgspec import UnsetType

from fti.messages.tables import Message, recorded_hints
from fti.messages.units import present_members, union_members, unit_symbol

_NAMES = {float: "number", int: "integer", bool: "true or false", str: "text", types.NoneType: "null"}


class Field(NamedTuple):
    """A field.  name : with the path, ``stamp.t_rx_ns``; type : in words; unit : "" for what is not a number"""

    name: str
    type: str
    unit: str


def fields(cls: type) -> list[Field]:
    """The fields of a message, those of a message within it by their paths."""
    found = []
    for name, hint in recorded_hints(cls, include_extras=True).items():
        kind = _content(hint)
        if isinstance(kind, type) and issubclass(kind, Message):
            path = f"{name}.<name>" if _is_map(hint) else name
            found += [field._replace(name=f"{path}.{field.name}") for field in fields(kind)]
        else:
            found.append(Field(name, _words(hint), unit_symbol(kind) or ""))
    return found


@cache
def units(cls: type) -> dict[str, str]:
    """Unit of each number of a message: path of the field (``satellites.azimuth``) -> symbol."""
    return {field.name: field.unit for field in fields(cls) if field.unit}


def _content(hint: Any) -> Any:
    """The type of a value, or of the values of a list or a table."""
    bare = next(member for member in union_members(hint) if member is not types.NoneType)
    return _content(typing.get_args(bare)[-1 if _is_map(bare) else 0]) if _is_container(bare) else bare


def _is_map(hint: Any) -> bool:
    return any(typing.get_origin(member) is dict for member in union_members(hint))


def _is_container(hint: Any) -> bool:
    return typing.get_origin(hint) in (tuple, dict)


def _words(hint: Any) -> str:
    """``list of number``, ``number or null``, ``text: TimeScale``, ``number, may be absent``."""
    if UnsetType in (members := union_members(hint)):
        return f"{' or '.join(map(_words, present_members(hint)))}, may be absent"
    if len(members) > 1:
        return " or ".join(map(_words, members))
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        return _words(args[0])
    if origin in (tuple, dict):
        return f"list of {_words(args[0])}" if origin is tuple else f"{_words(args[1])} by name"
    return f"text: {hint.__name__}" if issubclass(hint, StrEnum) else _NAMES[hint]
