"""Schemas of Foxglove messages as JSON, and ``foxglove.LocationFix`` and ``foxglove.Log``, which files have too.

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
LOG_LEVEL_NAMES = {number: level for level, number in LOG_LEVELS.items()}
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


def _object(title: str, **properties: Json) -> Json:
    return {"title": f"foxglove.{title}", "type": "object", "properties": properties, "required": list(properties)}


_VECTOR: Json = _object("Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION: Json = _object("Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_PROPERTIES: dict[str, Json] = {
    "LocationFix": {
        "timestamp": _TIME,
        "frame_id": _STRING,
        "latitude": _NUMBER,  # [deg]
        "longitude": _NUMBER,  # [deg]
        "altitude": _NUMBER,  # [m]
        "position_covariance": {"type": "array", "items": _NUMBER, "minItems": 9, "maxItems": 9},  # ENU, by rows [m^2]
        "position_covariance_type": _choice("foxglove.PositionCovarianceType", COVARIANCE_TYPES),
        "heading": _NUMBER,  # clockwise from north [rad]
        "velocity": _VECTOR,  # east, north, up [m/s]
    },
    "Log": {
        "timestamp": _TIME,
        "level": _choice("foxglove.LogLevel", LOG_LEVELS),
        "message": _STRING,
        "name": _STRING,
        "file": _STRING,
        "line": {"type": "integer", "minimum": 0},
    },
    "FrameTransform": {
        "timestamp": _TIME,
        "parent_frame_id": _STRING,
        "child_frame_id": _STRING,
        "translation": _VECTOR,
        "rotation": _QUATERNION,
    },
    "PoseInFrame": {
        "timestamp": _TIME,
        "frame_id": _STRING,
        "pose": _object("Pose", position=_VECTOR, orientation=_QUATERNION),
    },
    "GeoJSON": {"geojson": _STRING},
}
#: Fields that a message may omit.
_OPTIONAL = frozenset({"heading", "velocity"})
NAMES: Sequence[str] = tuple(_PROPERTIES)


def schema_text(name: str) -> bytes:
    """JSON schema of one of ``NAMES``."""
    schema = _object(name, **_PROPERTIES[name])
    schema["required"] = [field for field in schema["required"] if field not in _OPTIONAL]
    return json.dumps(schema, separators=(",", ":")).encode()


def timestamp(t_ns: int) -> Json:
    """A time [ns] as Foxglove has it."""
    return {"sec": t_ns // SECOND_NS, "nsec": t_ns % SECOND_NS}


def log(event: Event, who: str = "") -> Json:
    """An event as ``foxglove.Log``; the otherwise unused field ``file`` holds ``who``, the originator."""
    level = LOG_LEVELS.get(event.level, LOG_LEVELS["unknown"])
    fields = {"level": level, "message": event.text, "name": event.source, "file": who, "line": 0}
    return {"timestamp": timestamp(event.t_ns), **fields}


def location(solution: NavSolution) -> Json | None:
    """A valid solution as ``foxglove.LocationFix``: degrees, height above the ellipsoid [m], covariance ENU [m^2].

    With a valid attitude also the heading [rad], and with a velocity that, east, north, up [m/s].
    None without a valid position.  The horizontal sigma is used for each axis.
    """
    if not solution.valid or solution.lat is None or solution.lon is None or solution.alt is None:
        return None
    covariance, kind = _covariance(solution.horizontal_sd, solution.vertical_sd)
    return {
        "timestamp": timestamp(solution.t_ns if solution.t_valid_ns is None else solution.t_valid_ns),
        "frame_id": "p",
        "latitude": math.degrees(solution.lat),
        "longitude": math.degrees(solution.lon),
        "altitude": solution.alt,
        "position_covariance": covariance,
        "position_covariance_type": kind,
        **_motion(solution),
    }


def _motion(solution: NavSolution) -> Json:
    """Heading and velocity as far as they are known."""
    found: Json = {}
    if solution.attitude_valid and solution.heading is not None:
        found["heading"] = solution.heading
    north, east, down = solution.vel_north, solution.vel_east, solution.vel_down
    if north is not None and east is not None and down is not None:
        found["velocity"] = {"x": east, "y": north, "z": -down}
    return found


def _covariance(horizontal_sd: float | None, vertical_sd: float | None) -> tuple[list[float], int]:
    if horizontal_sd is None or vertical_sd is None or not math.isfinite(horizontal_sd + vertical_sd):
        return [0.0] * 9, COVARIANCE_TYPES["unknown"]
    axis, up = horizontal_sd**2, vertical_sd**2
    return [axis, 0.0, 0.0, 0.0, axis, 0.0, 0.0, 0.0, up], COVARIANCE_TYPES["diagonal_known"]
