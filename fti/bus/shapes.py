"""Required structure of each message of the bus, as far as a display relies on it.

A shape is a set of JSON types, a list of one shape, or a table of shapes.  In a table, ``name?`` may be missing and
``*`` stands for every other name; unlisted names are allowed.  The shapes of outputs come from their classes in
``fti.messages``.
"""

from __future__ import annotations

import typing
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from msgspec.structs import fields

from fti.messages.topics import BUS_ALARMS, BUS_EMULATOR, BUS_EVENT, BUS_HEALTH, OUTPUT_CLASSES, SOURCE_FIELDS
from fti.messages.units import union_members


class Nullable(NamedTuple):
    """A shape, or null."""

    shape: Any


Table = dict[str, Any]
Shape = frozenset[type] | list[Any] | Table | Nullable

#: Limit of the cache: clients may send any topic.
TOPICS_CACHED = 512
NULL = type(None)
TEXT: Shape = frozenset({str})
WHOLE: Shape = frozenset({int})
FLAG: Shape = frozenset({bool})
NUMBER: Shape = frozenset({int, float})
MAYBE_TEXT: Shape = frozenset({str, NULL})
MAYBE_NUMBER: Shape = frozenset({int, float, NULL})
COUNTS: Table = {"*": WHOLE}
TEXTS: Shape = [TEXT]

STAMP: Table = {"age_ms?": NUMBER, "max_age_ms?": NUMBER, "late?": FLAG}
#: An unknown output: the common fields.
ANY_OUTPUT: Table = {**STAMP, "t_ns?": WHOLE, "valid?": FLAG, "reasons?": TEXTS, "unchecked?": TEXTS, "state?": TEXT}
EVENT: Table = {"t_ns": WHOLE, "level": TEXT, "source": TEXT, "text": TEXT}
_LATENESS: Table = {"messages": WHOLE, "p50_ms": MAYBE_NUMBER, "p99_ms": MAYBE_NUMBER, "max_ms": MAYBE_NUMBER}
HIL: Table = {
    **STAMP,
    "scenario": TEXT,
    "flight_s": MAYBE_NUMBER,
    "duration_s": MAYBE_NUMBER,
    "devices": {"*": {"breaker": MAYBE_TEXT, "messages": WHOLE, "faults": TEXTS}},
    "faults": [{"kind": TEXT, "words": TEXT, "on": TEXTS, "until_s": MAYBE_NUMBER}],
    "supply_v": MAYBE_NUMBER,
    "lateness": _LATENESS,
    "holds": FLAG,
    "not_held": TEXTS,
}
_LINK: Table = {
    "kind?": TEXT,
    "state": TEXT,
    "hint?": MAYBE_TEXT,
    "bytes": WHOLE,
    "frames?": WHOLE,
    "rate_hz?": MAYBE_NUMBER,
    "age_ms?": MAYBE_NUMBER,
    "dropped_frames": WHOLE,
    "dropped_bytes?": WHOLE,
    "tx_frames?": WHOLE,
    "load?": {"*": NUMBER},
    "ledger?": {"errors?": COUNTS},
}
_CLOCK: Table = {
    "scale": TEXT,
    "state": TEXT,
    "used": FLAG,
    **dict.fromkeys(("offset_ms", "offset_sd_ms", "drift_ppm", "drift_sd_ppm", "late_share"), MAYBE_NUMBER),
}
_DEVICE: Table = {
    "driver?": TEXT,
    "state": TEXT,
    "hint?": MAYBE_TEXT,
    "rate_hz?": MAYBE_NUMBER,
    "age_ms?": MAYBE_NUMBER,
    "skipped?": COUNTS,
    "clocks?": [_CLOCK],
}
_SINK: Table = {
    "state": TEXT,
    "hint": TEXT,
    "peers": frozenset({int, NULL}),
    **dict.fromkeys(("connects", "sent", "replaced", "skipped", "waiting_events", "lost_events"), WHOLE),
}
HEALTH: Table = {
    "t_ns": WHOLE,
    "session": {"name": TEXT, "origin?": TEXT, "mode?": TEXT, "state": TEXT, "started_ns?": WHOLE},
    "processes": {"*": {"state": TEXT, "pid?": frozenset({int, NULL}), "restarts?": WHOLE}},
    "links": {"*": _LINK},
    "devices": {"*": _DEVICE},
    "storage": {
        "state?": TEXT,
        "hint?": MAYBE_TEXT,
        **{f"{name}?": MAYBE_NUMBER for name in ("file_bytes", "file_age_s", "free_mb")},
    },
    "navigation": {
        "lag_ms?": MAYBE_NUMBER,
        "output_delay?": Nullable({"p50_ms": MAYBE_NUMBER, "p99_ms": MAYBE_NUMBER}),
        "ring_lost_frames?": WHOLE,
        "last_seq?": WHOLE,
    },
    "sinks?": {"*": _SINK},
}

_ALARM: Table = {
    "id": TEXT,
    "severity": TEXT,
    "title": TEXT,
    "cause": TEXT,
    "value": MAYBE_NUMBER,
    **dict.fromkeys(("first_ns", "begin_ns", "count"), WHOLE),
    **dict.fromkeys(("end_ns", "acknowledged_ns"), frozenset({int, NULL})),
    "acknowledged_by": MAYBE_TEXT,
}
ALARMS: Table = {
    "t_ns": WHOLE,
    "alarms": [{**_ALARM, "is_acknowledged": FLAG, "consequences": [_ALARM]}],
}


@lru_cache(TOPICS_CACHED)
def shape_of(topic: str) -> Shape | None:
    """The shape of a topic's messages; None for an unknown topic."""
    fixed = {BUS_HEALTH: HEALTH, BUS_ALARMS: ALARMS, BUS_EVENT: EVENT, BUS_EMULATOR: HIL}
    if topic in fixed:
        return fixed[topic]
    if not topic.startswith("/nav/"):
        return None
    name, _, sensor = topic.removeprefix("/nav/").partition("/")
    cls = OUTPUT_CLASSES.get(name)
    if cls is None or bool(sensor) != (cls in SOURCE_FIELDS):
        return ANY_OUTPUT
    hints = typing.get_type_hints(cls)
    shapes = {f.name + ("" if f.required else "?"): _shape_of_hint(hints[f.name]) for f in fields(cls)}
    return {**STAMP, **shapes}


@lru_cache(TOPICS_CACHED)
def defaults_of(topic: str) -> Mapping[str, Any]:
    """Default values of fields that a publisher of an earlier version may omit."""
    cls = OUTPUT_CLASSES.get(topic.removeprefix("/nav/").partition("/")[0])
    return {f.name: f.default for f in fields(cls) if not f.required} if cls else {}


def _shape_of_hint(hint: Any) -> Shape:
    if typing.get_origin(hint) is tuple:
        return [_shape_of_hint(typing.get_args(hint)[0])]
    found: set[type] = set()
    for option in union_members(hint):
        if option is float:
            found |= {int, float, NULL}  # NaN is null
        else:
            found.add(str if issubclass(option, str) else option)
    return frozenset(found)


def describe_mismatch(value: Any, shape: Shape, name: str = "") -> str | None:
    """A text about the first field with a wrong type; None if all fit."""
    if isinstance(shape, Nullable):
        return None if value is None else describe_mismatch(value, shape.shape, name)
    wanted = shape if isinstance(shape, frozenset) else {type(shape)}
    if type(value) not in wanted:
        return f"{name or 'the message'} is {_name(type(value))}, not {' or '.join(sorted(map(_name, wanted)))}"
    if isinstance(shape, list):
        return next(
            (found for n, item in enumerate(value) if (found := describe_mismatch(item, shape[0], f"{name}[{n}]"))),
            None,
        )
    return _describe_table_mismatch(value, shape, f"{name}." if name else "") if isinstance(shape, dict) else None


def _describe_table_mismatch(table: dict[str, Any], shape: dict[str, Any], prefix: str) -> str | None:
    for key, inner in shape.items():
        if key == "*":
            pairs = list(table.items())
        elif (name := key.removesuffix("?")) in table:
            pairs = [(name, table[name])]
        elif key.endswith("?"):
            continue
        else:
            return f"{prefix}{key} is missing"
        for name, value in pairs:
            if found := describe_mismatch(value, inner, f"{prefix}{name[:80]}"):
                return found
    return None


def _name(kind: type) -> str:
    names = {str: "text", int: "a whole number", float: "a number", bool: "a flag", NULL: "null", dict: "a table"}
    return names.get(kind, "a list")
