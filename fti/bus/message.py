"""The payload of a bus message: an output as JSON, with its age.  A late output is not valid.

every field of the output; enum members as strings; NaN and infinity as null
age_ms      : time of publishing minus time of the output [ms]; the publisher adds it, never ``nav``
max_age_ms  : above this age the value is late for every consumer, also after its arrival
late        : age_ms > max_age_ms at publication; then ``valid`` is false

Received messages are not trusted: ``decode`` checks size, depth, types and numbers.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import orjson

from fti.bus.frame import max_bytes
from fti.bus.shapes import defaults_of, describe_mismatch, shape_of

NS_PER_MS = 1_000_000
MAX_DEPTH = 16
#: Limit of all numbers; larger ones are not valid times, ages or counts.
MAX_NUMBER = 2**63
#: Maximum length of a text in an event; longer ones are cut by the publisher.
MAX_TEXT = 4096


class MessageError(ValueError):
    """A payload that is not a valid message of its topic; the text has the reason."""


def encode_with_age(payload_fields: Mapping[str, Any], t_ns: int, now_ns: int, max_age_ms: float) -> bytes:
    """Payload of one output with its age.

    payload_fields : the output as a mapping (``msgspec.structs.asdict``)
    t_ns, now_ns   : time of the output and of publishing, both FTI time [ns]
    """
    age_ms = (now_ns - t_ns) / NS_PER_MS
    late = age_ms > max_age_ms
    stamp: dict[str, Any] = {"age_ms": round(age_ms, 3), "max_age_ms": max_age_ms, "late": late}
    if late:
        stamp["valid"] = False
    return encode({**payload_fields, **stamp})


def encode(fields: Mapping[str, Any]) -> bytes:
    """A mapping as JSON; NaN and infinity become null, a lone surrogate (of a path) becomes ``?``."""
    try:
        text = json.dumps(fields, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    except ValueError:
        text = json.dumps(_replace_non_finite(fields), ensure_ascii=False, separators=(",", ":"))
    return text.encode(errors="replace")


def encode_event(event: Mapping[str, Any]) -> bytes:
    """An event as JSON; its texts are shortened."""
    texts = {name: shorten(value) for name, value in event.items() if isinstance(value, str)}
    return encode({**event, **texts})


def shorten(text: str) -> str:
    """At most ``MAX_TEXT`` characters."""
    return text if len(text) <= MAX_TEXT else text[: MAX_TEXT - 1] + "…"


def decode(topic: str, payload: bytes) -> dict[str, Any]:
    """The message in a payload, checked: finite and bounded numbers, types of the topic.

    Raises MessageError.
    """
    shape = shape_of(topic) if len(topic) <= MAX_TEXT else None
    if shape is None:
        raise MessageError("unknown topic")
    if len(payload) > max_bytes(topic):
        raise MessageError(f"{len(payload)} bytes; the limit is {max_bytes(topic)}")
    try:
        fields = orjson.loads(payload)  # refuses NaN, infinity, numbers beyond a double, half surrogates, 1024 levels
    except orjson.JSONDecodeError as error:
        raise MessageError(f"is not JSON: {error}") from None
    if fault := _describe_excess(fields, MAX_DEPTH) or describe_mismatch(fields, shape):
        raise MessageError(fault)
    return {**defaults_of(topic), **fields}


def _describe_excess(value: Any, depth: int) -> str | None:
    """A text about excessive depth or numbers, or None."""
    if isinstance(value, dict | list):
        if not depth:
            return f"is nested more than {MAX_DEPTH} deep"
        items = value.values() if isinstance(value, dict) else value
        return next((found for item in items if (found := _describe_excess(item, depth - 1))), None)
    if isinstance(value, int | float) and not -MAX_NUMBER <= value <= MAX_NUMBER:
        return f"a number beyond ±{MAX_NUMBER:.3g}"
    return None


def _replace_non_finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _replace_non_finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_replace_non_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
