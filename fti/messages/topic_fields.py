"""Fields of the messages of a topic: name, type in words, unit."""

from __future__ import annotations

import dataclasses
import types
import typing
from enum import StrEnum
from functools import cache
from typing import Annotated, Any, NamedTuple

from fti.messages.units import union_members, unit_symbol

_NAMES = {float: "number", int: "integer", bool: "true or false", str: "text", types.NoneType: "null"}


class Field(NamedTuple):
    """A field.  name : with the path, ``stamp.t_rx_ns``; type : in words; unit : "" for what is not a number"""

    name: str
    type: str
    unit: str


def fields(cls: type) -> list[Field]:
    """The fields of a message, those of a message within it by their paths."""
    found = []
    for name, hint in typing.get_type_hints(cls, include_extras=True).items():
        kind = _content(hint)
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            nested: type = kind
            found += [field._replace(name=f"{name}.{field.name}") for field in fields(nested)]
        else:
            found.append(Field(name, _words(hint), unit_symbol(kind) or ""))
    return found


@cache
def units(cls: type) -> dict[str, str]:
    """Unit of each number of a message: path of the field (``satellites.azimuth``) -> symbol."""
    return {field.name: field.unit for field in fields(cls) if field.unit}


def _content(hint: Any) -> Any:
    """The type of a value, or of the values of a list."""
    bare = next(member for member in union_members(hint) if member is not types.NoneType)
    return _content(typing.get_args(bare)[0]) if typing.get_origin(bare) is tuple else bare


def _words(hint: Any) -> str:
    """``list of number``, ``number or null``, ``text: TimeScale``."""
    if len(members := union_members(hint)) > 1:
        return " or ".join(map(_words, members))
    if typing.get_origin(hint) is Annotated:
        return _words(typing.get_args(hint)[0])
    if typing.get_origin(hint) is tuple:
        return f"list of {_words(typing.get_args(hint)[0])}"
    if issubclass(hint, StrEnum):
        return f"text: {hint.__name__}"
    return _NAMES[hint]
