"""JSON schemas of the recorded measurements, outputs and notes, in the form that ``encoding`` writes.

A viewer (Foxglove) needs one plain ``type`` per field; a validator must allow null.  In draft 7 a validator follows
``$ref`` and ignores its siblings, and a viewer does the opposite.  A field that may be null therefore has both.
"""

from __future__ import annotations

import dataclasses
import json
import typing
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Any

from fti.logger import foxglove
from fti.logger.encoding import encode
from fti.messages.outputs import Event, HeightAboveGround
from fti.messages.topic_fields import units
from fti.messages.topics import (
    ALARM_REPORT_TOPIC,
    ALARM_TOPIC,
    CLOCK_TOPIC,
    DEVICE_CLOCK_TOPIC,
    EVENT_TOPIC,
    GAP_TOPIC,
    HEALTH_TOPIC,
    LEDGER_TOPIC,
    READMISSION_TOPIC,
    TERRAIN_TOPIC,
)
from fti.messages.units import union_members

JSON_SCHEMA = "jsonschema"
DRAFT = "http://json-schema.org/draft-07/schema#"
Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Schema:
    """An MCAP schema."""

    name: str
    encoding: str
    data: bytes


_SCHEMAS: dict[type, Schema] = {}
#: Descriptions of classes whose fields had another meaning in recordings of an earlier version.
DESCRIPTIONS: dict[type, str] = {
    HeightAboveGround: "height_agl, sd: height of the reference point above the ground straight below it, and one "
    "sigma of its error [m]. nearest, nearest_sd: height above what the beam sees. A schema without a field nearest is "
    "that of fti 0.1: there height_agl, sd are what nearest, nearest_sd are here, and compensated, compensated_sd the "
    "height straight below where the terrain was known.",
}


def json_schema(cls: type) -> Json:
    """JSON schema of a dataclass."""
    definitions: Json = {}
    root = _object_schema(cls, definitions)
    description = {"description": DESCRIPTIONS[cls]} if cls in DESCRIPTIONS else {}
    return {"$schema": DRAFT, "title": f"fti.{cls.__name__}", **description, **root, "definitions": definitions}


def schema_of(cls: type) -> Schema:
    """The JSON schema of a dataclass as an MCAP schema."""
    if cls not in _SCHEMAS:
        text = json.dumps(json_schema(cls), separators=(",", ":"))
        _SCHEMAS[cls] = Schema(f"fti.{cls.__name__}", JSON_SCHEMA, text.encode())
    return _SCHEMAS[cls]


def _object_schema(cls: Any, definitions: Json) -> Json:
    hints = typing.get_type_hints(cls)
    names = [field.name for field in dataclasses.fields(cls)]
    properties = {name: _field_schema(hints[name], definitions) for name in names}
    for name in properties.keys() & units(cls).keys():
        properties[name]["description"] = f"[{units(cls)[name]}]"
    return {"type": "object", "properties": properties, "required": list(names)}


def _field_schema(hint: Any, definitions: Json) -> Json:
    members = union_members(hint)
    bare = next(member for member in members if member is not type(None))
    schema = _bare_schema(bare, definitions)
    return _nullable(schema, bare, definitions) if len(members) > 1 or bare is float else schema


def _bare_schema(hint: Any, definitions: Json) -> Json:
    simple = {bool: "boolean", int: "integer", float: "number", str: "string"}
    if hint in simple:
        return {"type": simple[hint]}
    if typing.get_origin(hint) is tuple:
        return {"type": "array", "items": _field_schema(typing.get_args(hint)[0], definitions)}
    if issubclass(hint, StrEnum):
        return {"type": "string", "enum": [member.value for member in hint]}
    return _object_schema(hint, definitions)


def _nullable(schema: Json, hint: Any, definitions: Json) -> Json:
    """The type for viewers and, for validators, a reference to the same type or null."""
    name = f"{getattr(hint, '__name__', 'value')}_or_null"
    definitions[name] = {"anyOf": [schema, {"type": "null"}]}
    plain = {key: value for key, value in schema.items() if key in ("type", "items", "properties")}
    return {**plain, "$ref": f"#/definitions/{name}"}


# ------------------------------------------------------------------------------------------------------------ notes

_INTEGER: Json = {"type": "integer"}
_STRING: Json = {"type": "string"}
_STRINGS: Json = {"type": "array", "items": _STRING}
#: As in ``_nullable``: the type for viewers and, for validators, a reference to the same type or null.
_OR_NULL: Json = {
    f"{name}_or_null": {"anyOf": [{"type": name}, {"type": "null"}]} for name in ("string", "integer", "number")
}
_MAYBE_STRING, _MAYBE_INTEGER, _MAYBE_NUMBER = (
    {"type": name.removesuffix("_or_null"), "$ref": f"#/definitions/{name}"} for name in _OR_NULL
)
_TABLE: Json = {"type": "object", "properties": {}}
_COUNTS: Json = {f"{part}_{what}": _INTEGER for part in ("in", "recorded", "held") for what in ("frames", "bytes")}
#: By reason; bytes are null where the kernel dropped an unknown number.
_DROPPED: Json = {
    **_TABLE,
    "additionalProperties": {
        "type": "object",
        "properties": {"frames": _INTEGER, "bytes": {"type": ["integer", "null"]}},
    },
}
#: in = recorded + held + dropped; see ``fti.service.recorder.link_ledger``.
_ACCOUNT: Json = {"type": "object", "properties": {**_COUNTS, "dropped": _DROPPED}}
_LINK_ACCOUNT: Json = {
    "type": "object",
    "properties": {**_ACCOUNT["properties"], "sent": _ACCOUNT, "errors": _TABLE, "stamp_refused": _INTEGER},
}
_RECORDER: Json = {"type": "object", "properties": dict.fromkeys(("pid", "started_ns", "first_seq"), _INTEGER)}
#: Fields of notes that are recorded as changes; see ``fti.logger.note_changes``.
_CHANGES: Json = {
    "complete": {
        "type": "boolean",
        "description": "true: everything is in this record. false: an entry of links, devices or processes that is not "
        "in this record has not changed since the record of this topic with log time since_ns; only its age_ms has "
        "grown with the time. Without this field a record is complete.",
    },
    "since_ns": {
        "type": "integer",
        "description": "Log time of the record that this one continues; only where complete is false. When that record "
        "is not there, the entries that are not in this one are unknown until the next complete record, at most 10 s.",
    },
}
_NOTES: dict[str, tuple[str, Json]] = {
    CLOCK_TOPIC: (
        "fti.Clock",
        {"t_ns": _INTEGER, "monotonic_ns": _INTEGER, "monotonic_raw_ns": _INTEGER, "realtime_ns": _INTEGER}
        | {"width_ns": _INTEGER},
    ),
    LEDGER_TOPIC: (
        "fti.Ledger",
        {"t_ns": _INTEGER, **_CHANGES}
        | {"recorder": _RECORDER, "next_seq": _INTEGER, "final": {"type": "boolean"}}
        | {"ticks": _ACCOUNT, "links": {**_TABLE, "additionalProperties": _LINK_ACCOUNT}},
    ),
    HEALTH_TOPIC: (
        "fti.Health",
        {"t_ns": _INTEGER, **_CHANGES}
        | {"session": _TABLE, "processes": _TABLE, "links": _TABLE, "devices": _TABLE}
        | {"storage": _TABLE, "navigation": _TABLE},
    ),
    DEVICE_CLOCK_TOPIC: ("fti.DeviceClock", {"t_ns": _INTEGER, "clocks": _TABLE, "gnss": _TABLE}),
    TERRAIN_TOPIC: (
        "fti.Terrain",
        {"t_ns": _INTEGER, "after_seq": _INTEGER, "name": _STRING, "sha256": _STRING, "fault": _STRING},
    ),
    READMISSION_TOPIC: ("fti.Readmission", {"t_ns": _INTEGER, "after_seq": _INTEGER, "source": _STRING}),
    GAP_TOPIC: ("fti.Gap", {"t_ns": _INTEGER, "text": _STRING}),
    ALARM_REPORT_TOPIC: (
        "fti.AlarmReport",
        {"t_ns": _INTEGER, "subject": _STRING, "id": _MAYBE_STRING, "severity": _MAYBE_STRING}
        | {"title": _MAYBE_STRING, "cause": _MAYBE_STRING, "value": _MAYBE_NUMBER, "explained_by": _STRINGS}
        | {"is_latched": {"type": "boolean"}},
    ),
    ALARM_TOPIC: (
        "fti.Alarm",
        {"t_ns": _INTEGER, "change": _STRING, "id": _STRING, "severity": _STRING, "title": _STRING, "cause": _STRING}
        | {"value": _MAYBE_NUMBER, "first_ns": _INTEGER, "begin_ns": _INTEGER, "end_ns": _MAYBE_INTEGER}
        | {"count": _INTEGER, "acknowledged_ns": _MAYBE_INTEGER, "acknowledged_by": _MAYBE_STRING},
    ),
}
#: Topics whose fields may be null.
WITH_NULLS = (ALARM_REPORT_TOPIC, ALARM_TOPIC)


@cache
def note_schema(topic: str) -> Schema:
    """Schema of a note of the service.  Raises ValueError for a topic without notes."""
    if topic == EVENT_TOPIC:
        return foxglove_schema("Log")
    if topic not in _NOTES:
        raise ValueError(f"{topic!r} is not a topic of notes; there are {EVENT_TOPIC}, {', '.join(_NOTES)}")
    name, properties = _NOTES[topic]
    table = {"$schema": DRAFT, "title": name, "type": "object", "properties": properties}
    if topic in WITH_NULLS:
        table["definitions"] = _OR_NULL
    return Schema(name, JSON_SCHEMA, json.dumps(table, separators=(",", ":")).encode())


def encode_note(topic: str, obj: Any) -> bytes:
    """Encode a note as JSON; an event, with its originator ``who``, becomes a ``foxglove.Log``."""
    if topic == EVENT_TOPIC:
        if isinstance(obj, Event):
            return encode(foxglove.log(obj))
        return encode(foxglove.log(Event(**{key: obj[key] for key in obj if key != "who"}), obj.get("who", "")))
    return encode(obj)


@cache
def foxglove_schema(name: str) -> Schema:
    """The MCAP schema of a Foxglove message."""
    return Schema(f"foxglove.{name}", JSON_SCHEMA, foxglove.schema_text(name))
