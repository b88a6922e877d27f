"""Messages of the bus for the tests of the sinks, and arbitrary ones."""

from __future__ import annotations

import json
import math
import time
from typing import Any

import orjson
from hypothesis import strategies as st
from msgspec.structs import asdict

from fti.bus.message import encode_with_age
from fti.messages.outputs import NavSolution, Output
from fti.messages.reasons import Reason
from fti.messages.topics import OUTPUT_MAX_AGE_MS, output_topic
from fti.publish.message import PublishedMessage

#: 2026-11-29 18:14:08.040 UTC.
T_NS = 1_795_976_048_040_000_000
LAT_DEG, LON_DEG, ALT_M = 49.2057611, 11.2057611, 607.6
#: 100 m/s towards 30 degrees, climbing with 2 m/s.
SPEED_MPS, TRACK_DEG, CLIMB_MPS = 100.0, 30.0, 2.0
ROLL_DEG, PITCH_DEG, HEADING_DEG = -12.5, 3.25, 33.5


def ignore(level: str, text: str) -> None:
    """Events that a test does not look at."""


def solution(**changes: Any) -> NavSolution:
    """A valid solution with the values above."""
    values: dict[str, Any] = {
        "t_ns": T_NS,
        "t_valid_ns": T_NS,
        "valid": True,
        "reasons": (),
        "lat": math.radians(LAT_DEG),
        "lon": math.radians(LON_DEG),
        "alt": ALT_M,
        "vel_north": SPEED_MPS * math.cos(math.radians(TRACK_DEG)),
        "vel_east": SPEED_MPS * math.sin(math.radians(TRACK_DEG)),
        "vel_down": -CLIMB_MPS,
        "horizontal_sd": 1.5,
        "vertical_sd": 2.5,
        "hpl": 20.0,
        "vpl": 30.0,
        "roll": math.radians(ROLL_DEG),
        "pitch": math.radians(PITCH_DEG),
        "heading": math.radians(HEADING_DEG),
        "attitude_valid": True,
    }
    return NavSolution(**{**values, **changes})


def invalid_solution(**changes: Any) -> NavSolution:
    """A solution that states its values and is not valid."""
    return solution(**{"valid": False, "attitude_valid": False, "reasons": (Reason.NO_POSITION,), **changes})


def message(output: Output, *, age_ms: float = 20.0, received_s: float | None = None) -> PublishedMessage:
    """An output as it comes from the bus now."""
    payload = encode_with_age(asdict(output), output.t_ns, output.t_ns + round(age_ms * 1e6), OUTPUT_MAX_AGE_MS)
    return PublishedMessage(output_topic(output), payload, 1, time.monotonic() if received_s is None else received_s)


def late(published: PublishedMessage) -> PublishedMessage:
    """The same message, which states that it is late, and no more."""
    return published._replace(payload=published.payload.replace(b'"late":false', b'"late":true'))


def json_field(published: PublishedMessage, name: str) -> object:
    """A field of the payload; None if there is no such thing."""
    try:
        fields = json.loads(published.payload)
    except ValueError:
        return None
    return fields.get(name) if isinstance(fields, dict) else None


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


@st.composite
def arbitrary_messages(draw: st.DrawFn, output: Output) -> PublishedMessage:
    """A message of the topic of an output whose fields are missing, of any type, extreme, or right; or any bytes."""
    payload = draw(st.binary(max_size=50))
    if draw(st.integers(0, 9)):
        fields = orjson.loads(message(output).payload)
        numbers = st.floats() | st.integers(-(2**63), 2**63) | st.sampled_from([0.0, 1e-9, math.pi, -math.pi, 1e300])
        for name in draw(st.lists(st.sampled_from(sorted(fields)), max_size=6)):
            fields[name] = draw(
                numbers if isinstance(fields[name], int | float) and draw(st.booleans()) else JSON_VALUES
            )
        for name in draw(st.lists(st.sampled_from(sorted(fields)), max_size=2)):
            fields.pop(name, None)
        payload = (
            orjson.dumps(fields, option=orjson.OPT_PASSTHROUGH_SUBCLASS, default=str) if _fits(fields) else payload
        )
    return PublishedMessage(output_topic(output), payload, 1, time.monotonic())


def _fits(value: Any) -> bool:
    """Is it JSON?  Integers have 64 bits, and texts are Unicode."""
    try:
        orjson.dumps(value)
    except (TypeError, ValueError):
        return False
    return True
