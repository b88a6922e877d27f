"""The payload of the bus: JSON of an output with its age.  Late is not valid.

every field of the output; enum members as strings; NaN and infinity as null
age_ms      : time of publishing minus time of the output [ms]; the publisher adds it, never ``nav``
max_age_ms  : above this age the value is late for every consumer, also while it lies there
late        : age_ms > max_age_ms when it was published; then ``valid`` is false
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

NS_PER_MS = 1_000_000


def stamped(payload_fields: Mapping[str, Any], t_ns: int, now_ns: int, max_age_ms: float) -> bytes:
    """Payload of one output with its age.

    payload_fields : the output as a mapping (``dataclasses.asdict``)
    t_ns, now_ns   : time of the output and of publishing, both FTI time [ns]
    """
    age_ms = (now_ns - t_ns) / NS_PER_MS
    late = age_ms > max_age_ms
    stamp: dict[str, Any] = {"age_ms": round(age_ms, 3), "max_age_ms": max_age_ms, "late": late}
    if late:
        stamp["valid"] = False
    return encode({**payload_fields, **stamp})


def encode(fields: Mapping[str, Any]) -> bytes:
    """A mapping as JSON; what JSON has no number for (NaN, infinity) is null."""
    try:
        text = json.dumps(fields, allow_nan=False, separators=(",", ":"))
    except ValueError:
        text = json.dumps(_finite(fields), separators=(",", ":"))
    return text.encode()


def decode(payload: bytes) -> dict[str, Any] | None:
    """The mapping in a payload; None when it is none: what arrives on the bus is not trusted."""
    try:
        found = json.loads(payload)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
