"""The Foxglove messages ``foxglove.LocationFix`` and ``foxglove.Log`` as JSON.

Source of field names, types and enumerations: https://docs.foxglove.dev/docs/sdk/schemas.  The schemas omit the fields
that this service does not fill.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

from fti.constants import SECOND_NS
from fti.messages.outputs import Event, NavSolution

Json = dict[str, Any]
LOG_LEVELS = {"unknown": 0, "debug": 1, "info": 2, "warning": 3, "error": 4, "fatal": 5}
COVARIANCE_TYPES = {"unknown": 0, "approximated": 1, "diagonal_known": 2, "known": 3}

_NUMBER: Json = {"type": "number"}
_STRING: Json = {"type": "string"}
_TIME: Json = {
    "type": "object",
    "title": "time",
    "properties": {
        "sec": {"type": "integer", "minimum": 0},
        "nsec": {"type": "integer", "minimum": 0, "maximum": 999_999_999},
    },
}


def _choice(title: str, values: dict[str, int]) -> Json:
    return {"title": title, "oneOf": [{"title": name.upper(), "const": value} for name, value in values.items()]}


_PROPERTIES: dict[str, Json] = {
    "LocationFix": {
        "timestamp": _TIME,
        "frame_id": _STRING,
        "latitude": _NUMBER,  # [deg]
        "longitude": _NUMBER,  # [deg]
        "altitude": _NUMBER,  # [m]
        "position_covariance": {"type": "array", "items": _NUMBER, "minItems": 9, "maxItems": 9},  # ENU, by rows [m^2]
        "position_covariance_type": _choice("foxglove.PositionCovarianceType", COVARIANCE_TYPES),
    },
    "Log": {
        "timestamp": _TIME,
        "level": _choice("foxglove.LogLevel", LOG_LEVELS),
        "message": _STRING,
        "name": _STRING,
        "file": _STRING,
        "line": {"type": "integer", "minimum": 0},
    },
}
NAMES: Sequence[str] = tuple(_PROPERTIES)


def schema_text(name: str) -> bytes:
    """JSON schema of ``LocationFix`` or ``Log``."""
    properties = _PROPERTIES[name]
    table = {"title": f"foxglove.{name}", "type": "object", "properties": properties, "required": list(properties)}
    return json.dumps(table, separators=(",", ":")).encode()


def _time(t_ns: int) -> Json:
    return {"sec": t_ns // SECOND_NS, "nsec": t_ns % SECOND_NS}


def log(event: Event, who: str = "") -> Json:
    """An event as ``foxglove.Log``; the otherwise unused field ``file`` holds ``who``, the originator."""
    level = LOG_LEVELS.get(event.level, LOG_LEVELS["unknown"])
    fields = {"level": level, "message": event.text, "name": event.source, "file": who, "line": 0}
    return {"timestamp": _time(event.t_ns), **fields}


def location(solution: NavSolution) -> Json | None:
    """A valid solution as ``foxglove.LocationFix``: degrees, height above the ellipsoid [m], covariance ENU [m^2].

    None without a valid position.  The horizontal sigma is used for each axis.
    """
    if not solution.valid or solution.lat is None or solution.lon is None or solution.alt is None:
        return None
    covariance, kind = _covariance(solution.horizontal_sd, solution.vertical_sd)
    return {
        "timestamp": _time(solution.t_ns if solution.t_valid_ns is None else solution.t_valid_ns),
        "frame_id": "p",
        "latitude": math.degrees(solution.lat),
        "longitude": math.degrees(solution.lon),
        "altitude": solution.alt,
        "position_covariance": covariance,
        "position_covariance_type": kind,
    }


def _covariance(horizontal_sd: float | None, vertical_sd: float | None) -> tuple[list[float], int]:
    if horizontal_sd is None or vertical_sd is None or not math.isfinite(horizontal_sd + vertical_sd):
        return [0.0] * 9, COVARIANCE_TYPES["unknown"]
    axis, up = horizontal_sd**2, vertical_sd**2
    return [axis, 0.0, 0.0, 0.0, axis, 0.0, 0.0, 0.0, up], COVARIANCE_TYPES["diagonal_known"]
