"""Messages as JSON tables and back: a field with the value ``ABSENT`` is left out."""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Callable
from enum import Enum, StrEnum
from functools import cache, partial
from typing import Any, Literal, TypeVar

from fti.messages.units import union_members

T = TypeVar("T")
#: Maximum length of the path of a wrong field in an error.
MAX_PATH = 80


class Absent(Enum):
    """The value of a field that the message does not have; false, as None is."""

    ABSENT = "absent"

    def __bool__(self) -> Literal[False]:
        return False


ABSENT = Absent.ABSENT


#: Types of JSON values without parts.
_SCALARS = frozenset({str, int, float, bool, types.NoneType})


def to_table(value: Any) -> Any:
    """A message, or a part of one, as JSON types: fields in class order, without absent ones."""
    cls: Any = type(value)
    if cls in _SCALARS:
        return value
    is_message = dataclasses.is_dataclass(cls)
    if is_message:
        pairs = [(name, getattr(value, name)) for name in required_of_fields(cls)]
        return {name: to_table(item) for name, item in pairs if item is not ABSENT}
    if isinstance(value, dict):
        return {key: to_table(item) for key, item in value.items()}
    return [to_table(item) for item in value] if isinstance(value, tuple | list) else value


def from_table(cls: type[T], table: object) -> T:
    """The message of a table.  Raises ValueError, which names the field that is wrong."""
    try:
        message: T = _parser((cls,))(table)
    except _FieldError as error:
        path = "".join(reversed(error.path)).removeprefix(".")[:MAX_PATH]
        raise ValueError(f"{path or 'the message'}: {error.text}") from None
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


class _FieldError(Exception):
    """What is wrong with a value.  path : where it is, from the inside"""

    def __init__(self, text: str, *path: str) -> None:
        self.text, self.path = text, [*path]


@cache
def _parser(kinds: tuple[Any, ...]) -> Callable[[Any], Any]:
    """The parser of values of some types: made once, as messages come twice a second and in thousands of a session."""
    scalars: set[Any] = set()
    members: dict[str, Any] = {}
    builders: list[tuple[type, Callable[[Any], Any]]] = []
    for kind in kinds:
        args = typing.get_args(kind)
        if typing.get_origin(kind) is dict:
            builders.append((dict, partial(_parse_dict, _parser(present_members(args[1])))))
        elif typing.get_origin(kind) is tuple:
            builders.append((list, partial(_parse_list, _parser(present_members(args[0])))))
        elif dataclasses.is_dataclass(kind):
            builders.append((dict, partial(_parse_fields, kind)))
        elif issubclass(kind, StrEnum):
            members |= {member.value: member for member in kind}
        else:
            scalars |= {kind, int} if kind is float else {kind}
    allowed = " or ".join("null" if kind is types.NoneType else getattr(kind, "__name__", str(kind)) for kind in kinds)

    def parse(value: Any) -> Any:
        if type(value) in scalars:
            return value
        if isinstance(value, str) and (value in members or str in scalars):
            return members.get(value, value)
        for kind, build in builders:
            if isinstance(value, kind):
                return build(value)
        raise _FieldError(f"{str(value)[:80]!r} is not {allowed}")

    return parse


def _parse_dict(parse: Callable[[Any], Any], table: dict[str, Any]) -> dict[str, Any]:
    key = ""
    try:
        return {(key := name): parse(item) for name, item in table.items()}
    except _FieldError as error:
        error.path.append(f".{key}")
        raise


def _parse_list(parse: Callable[[Any], Any], items: list[Any]) -> tuple[Any, ...]:
    parsed = list[Any]()
    try:
        parsed.extend(map(parse, items))
    except _FieldError as error:
        error.path.append(f"[{len(parsed)}]")
        raise
    return tuple(parsed)


def _parse_fields(cls: Any, table: dict[str, Any]) -> Any:
    required, parsers = required_of_fields(cls), _parsers_of_fields(cls)
    if not table.keys() <= parsers.keys():
        unknown = next(name for name in table if name not in parsers)
        raise _FieldError(f"unknown field; there are {', '.join(required)}", f".{unknown}")
    for name, is_required in required.items():
        if is_required and name not in table:
            raise _FieldError("is missing", f".{name}")
    name = ""
    try:
        values = {(name := key): parsers[key](item) for key, item in table.items()}
    except _FieldError as error:
        error.path.append(f".{name}")
        raise
    return cls(**values)


@cache
def _parsers_of_fields(cls: type) -> dict[str, Callable[[Any], Any]]:
    return {name: _parser(kinds) for name, kinds in types_of_fields(cls).items()}
