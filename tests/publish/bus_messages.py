"""Messages of the bus other than outputs, and outputs with a time, for the tests of sinks with a schema."""

from __future__ import annotations

import math
from typing import Any

import orjson

from fti.bus.message import encode_event
from fti.messages.outputs import Event, GlideSlope, NavSolution
from fti.messages.tables import to_table
from fti.messages.topics import BUS_ALARMS, BUS_EVENT
from fti.publish.message import PublishedMessage
from tests.publish import solutions
from tests.publish.solutions import T_NS


def solution(t_ns: int = T_NS, **changes: Any) -> NavSolution:
    """A navigation solution that heads east in a right turn."""
    values = {"roll": math.radians(20.0), "pitch": math.radians(5.0), "heading": math.radians(90.0)}
    return solutions.solution(t_ns=t_ns, t_valid_ns=t_ns - 10_000_000, **{**values, **changes})


def glide_slope(t_ns: int = T_NS) -> GlideSlope:
    """A valid deviation."""
    return GlideSlope(t_ns=t_ns, t_valid_ns=t_ns, valid=True, reasons=(), s=1000.0, y=1.0, dh=2.0, dots=0.1)


def event(text: str, t_ns: int = T_NS) -> PublishedMessage:
    """An event."""
    content = Event(t_ns=t_ns, level="warning", source="radar", text=text)
    return PublishedMessage(BUS_EVENT, encode_event(to_table(content)), 1)


def alarms() -> PublishedMessage:
    """The list of alarms, with one."""
    times = {"first_ns": T_NS, "begin_ns": T_NS, "end_ns": None, "acknowledged_ns": None, "acknowledged_by": None}
    alarm = {"id": "a", "severity": "caution", "title": "A", "cause": "b", "value": None, "count": 1, **times}
    content = {"t_ns": T_NS, "alarms": [{**alarm, "is_acknowledged": False, "consequences": []}]}
    return PublishedMessage(BUS_ALARMS, orjson.dumps(content), 1)
