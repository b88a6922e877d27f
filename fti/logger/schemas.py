"""JSON schemas of the recorded measurements, outputs and notes, in the form that ``encoding`` writes.

A viewer (Foxglove) needs one plain ``type`` per field; a validator must allow null.  In draft 7 a validator follows
``$ref`` and ignores its siblings, and a viewer does the opposite.  A field that may be null therefore has both.
"""

from __future__ import annotations

import json
import typing
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Any

from msgspec import UnsetType

from fti.logger import foxglove
from fti.logger.encoding import encode
from fti.messages.outputs import Event, HeightAboveGround
from fti.messages.tables import recorded_hints
from fti.messages.topic_fields import units
from fti.messages.topics import EVENT_TOPIC, NOTE_CLASSES, schema_name
from fti.messages.units import present_members, union_members

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
    """JSON schema of a message."""
    definitions: Json = {}
    root = _object_schema(cls, definitions)
    description = {"description": DESCRIPTIONS[cls]} if cls in DESCRIPTIONS else {}
    return {"$schema": DRAFT, "title": schema_name(cls), **description, **root, "definitions": definitions}


def schema_of(cls: type) -> Schema:
    """The JSON schema of a message as an MCAP schema."""
    if cls not in _SCHEMAS:
        text = json.dumps(json_schema(cls), separators=(",", ":"))
        _SCHEMAS[cls] = Schema(schema_name(cls), JSON_SCHEMA, text.encode())
    return _SCHEMAS[cls]


def _object_schema(cls: Any, definitions: Json) -> Json:
    hints = recorded_hints(cls)
    properties = {name: _field_schema(hint, definitions) for name, hint in hints.items()}
    for name in properties.keys() & units(cls).keys():
        properties[name]["description"] = f"[{units(cls)[name]}]"
    required = [name for name, hint in hints.items() if UnsetType not in union_members(hint)]
    return {"type": "object", "properties": properties, "required": required}


def _field_schema(hint: Any, definitions: Json) -> Json:
    members = present_members(hint)
    bare = next(member for member in members if member is not type(None))
    schema = _bare_schema(bare, definitions)
    return _nullable(schema, bare, definitions) if len(members) > 1 or bare is float else schema


def _bare_schema(hint: Any, definitions: Json) -> Json:
    simple = {bool: "boolean", int: "integer", float: "number", str: "string"}
    if hint in simple:
        return {"type": simple[hint]}
    if typing.get_origin(hint) is tuple:
        return {"type": "array", "items": _field_schema(typing.get_args(hint)[0], definitions)}
    if typing.get_origin(hint) is dict:
        entries = _field_schema(typing.get_args(hint)[1], definitions)
        return {"type": "object", "properties": {}, "additionalProperties": entries}
    if issubclass(hint, StrEnum):
        return {"type": "string", "enum": [member.value for member in hint]}
    return _object_schema(hint, definitions)


def _nullable(schema: Json, hint: Any, definitions: Json) -> Json:
    """The type for viewers and, for validators, a reference to the same type or null."""
    name = f"{getattr(hint, '__name__', 'value')}_or_null"
    definitions[name] = {"anyOf": [schema, {"type": "null"}]}
    plain = {key: value for key, value in schema.items() if key in ("type", "items", "properties")}
    return {**plain, "$ref": f"#/definitions/{name}"}


@cache
def note_schema(topic: str) -> Schema:
    """Schema of a note of the service.  Raises ValueError for a topic without notes."""
    if topic == EVENT_TOPIC:
        return foxglove_schema("Log")
    if topic not in NOTE_CLASSES:
        raise ValueError(f"{topic!r} is not a topic of notes; there are {EVENT_TOPIC}, {', '.join(NOTE_CLASSES)}")
    return schema_of(NOTE_CLASSES[topic])


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
