"""Topics and schemas of the bus for Foxglove: those of the MCAP files where a file has them.

An output has the same topic and schema as in a file, and three fields more: ``age_ms``, ``max_age_ms``, ``late``.
``/event`` is ``/fti/event`` (``foxglove.Log``) and ``/health`` is ``/fti/health``, as in files.  ``/alarms`` (the list,
where files have its changes) and ``/hil`` are only live.
"""

from __future__ import annotations

import json
from functools import lru_cache
from typing import Any, NamedTuple

from fti.bus.shapes import STAMP, Shape, shape_of
from fti.logger.schemas import DRAFT, JSON_SCHEMA, Json, Schema, json_schema, note_schema
from fti.messages.topics import (
    BUS_ALARMS,
    BUS_EMULATOR,
    BUS_EVENT,
    BUS_HEALTH,
    EVENT_TOPIC,
    HEALTH_TOPIC,
    OUTPUT_CLASSES,
    topics,
)
from fti.publish.sink_queue import MAX_TOPICS

#: Topics that have another name in files.
FILE_TOPICS = {BUS_EVENT: EVENT_TOPIC, BUS_HEALTH: HEALTH_TOPIC}
#: Names of schemas that no file has.
SCHEMA_NAMES = {BUS_ALARMS: "fti.Alarms", BUS_EMULATOR: "fti.Emulator"}
UNKNOWN_OUTPUT = "fti.Output"
#: Types of JSON; of several the first one counts for viewers.
_TYPES: dict[type, str] = {float: "number", int: "integer", str: "string", bool: "boolean"}


class LiveTopic(NamedTuple):
    """A topic as Foxglove gets it."""

    name: str
    schema: Schema


@lru_cache(MAX_TOPICS)
def live_topic(bus_topic: str) -> LiveTopic | None:
    """Name and schema of a topic of the bus; None for an unknown topic."""
    if bus_topic in FILE_TOPICS:
        name = FILE_TOPICS[bus_topic]
        return LiveTopic(name, note_schema(name))
    shape = shape_of(bus_topic)
    if shape is None:
        return None
    cls = OUTPUT_CLASSES.get(bus_topic.removeprefix("/nav/").partition("/")[0])
    title = SCHEMA_NAMES.get(bus_topic, UNKNOWN_OUTPUT)
    schema = _root_schema(title, shape) if cls is None else _output_schema(cls)
    return LiveTopic(
        bus_topic, Schema(schema["title"], JSON_SCHEMA, json.dumps(schema, separators=(",", ":")).encode())
    )


def fixed_topics() -> list[LiveTopic]:
    """The topics of the bus whose names do not depend on the configuration."""
    buses = [topic.bus for topic in topics() if topic.bus and "<" not in topic.bus]
    return [found for bus in buses if (found := live_topic(bus))]


def _output_schema(cls: type) -> Json:
    """The schema of an output in files, with its age."""
    schema, ages = json_schema(cls), _schema_of_shape(STAMP)["properties"]
    for name in ("age_ms", "max_age_ms"):
        ages[name]["description"] = "[ms]"
    return {**schema, "properties": {**schema["properties"], **ages}}


def _root_schema(title: str, shape: Shape) -> Json:
    """Schema of a message that no file has."""
    nullable = {f"{name}_or_null": {"type": [name, "null"]} for name in _TYPES.values()}
    return {"$schema": DRAFT, "title": title, **_schema_of_shape(shape), "definitions": nullable}


def _schema_of_shape(shape: Any) -> Json:
    """JSON schema of a shape of ``fti.bus.shapes``, for viewers and validators as in ``fti.logger.schemas``."""
    if isinstance(shape, list):
        return {"type": "array", "items": _schema_of_shape(shape[0])}
    if isinstance(shape, frozenset):
        name = next(name for kind, name in _TYPES.items() if kind in shape)
        return {"type": name, "$ref": f"#/definitions/{name}_or_null"} if type(None) in shape else {"type": name}
    properties = {key.removesuffix("?"): _schema_of_shape(inner) for key, inner in shape.items() if key != "*"}
    others = {"additionalProperties": _schema_of_shape(shape["*"])} if "*" in shape else {}
    return {"type": "object", "properties": properties, **others}
