"""Messages as they are on the bus, for the tests of the sinks."""

from __future__ import annotations

import math
from typing import Any

import orjson
from msgspec.structs import asdict

from fti.bus.message import encode_event, encode_with_age
from fti.messages.outputs import Event, GlideSlope, NavSolution, Output
from fti.messages.tables import to_table
from fti.messages.topics import BUS_EVENT, output_topic
from fti.publish.message import PublishedMessage

T0_NS = 1_767_225_600_000_000_000
MAX_AGE_MS = 500.0


def of_output(output: Output, *, age_ms: float = 12.0, number: int = 1) -> PublishedMessage:
    """An output."""
    now_ns = output.t_ns + round(age_ms * 1e6)
    return PublishedMessage(
        output_topic(output), encode_with_age(asdict(output), output.t_ns, now_ns, MAX_AGE_MS), number
    )


def of_event(text: str, t_ns: int = T0_NS) -> PublishedMessage:
    """An event."""
    event = Event(t_ns=t_ns, level="warning", source="radar", text=text)
    return PublishedMessage(BUS_EVENT, encode_event(to_table(event)), 1)


def of_alarms() -> PublishedMessage:
    """The list of alarms, with one."""
    times = {"first_ns": T0_NS, "begin_ns": T0_NS, "end_ns": None, "acknowledged_ns": None, "acknowledged_by": None}
    alarm = {"id": "a", "severity": "caution", "title": "A", "cause": "b", "value": None, "count": 1, **times}
    content = {"t_ns": T0_NS, "alarms": [{**alarm, "is_acknowledged": False, "consequences": []}]}
    return PublishedMessage("/alarms", orjson.dumps(content), 1)


def solution(t_ns: int = T0_NS, *, valid: bool = True, attitude_valid: bool = True, **changes: Any) -> NavSolution:
    """A navigation solution over Braunschweig, heading east in a right turn."""
    fields: dict[str, Any] = {
        "lat": math.radians(52.3),
        "lon": math.radians(10.5),
        "alt": 600.0,
        "vel_north": 3.0,
        "vel_east": 50.0,
        "vel_down": -2.0,
        "roll": math.radians(20.0),
        "pitch": math.radians(5.0),
        "heading": math.radians(90.0),
        "horizontal_sd": 2.0,
        "vertical_sd": 3.0,
    }
    return NavSolution(
        t_ns=t_ns,
        t_valid_ns=t_ns - 10_000_000,
        valid=valid,
        reasons=(),
        attitude_valid=attitude_valid,
        position_source="ins",
        **{**fields, **changes},
    )


def glide_slope(t_ns: int = T0_NS) -> GlideSlope:
    """A valid deviation."""
    return GlideSlope(t_ns=t_ns, t_valid_ns=t_ns, valid=True, reasons=(), s=1000.0, y=1.0, dh=2.0, dots=0.1)
