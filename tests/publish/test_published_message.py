"""A message as JSON for sinks whose protocol has no age of its own."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.publish.fan_out import FanOut
from fti.publish.message import PublishedMessage
from fti.publish.sink_queue import SinkQueue

OUTPUT: dict[str, Any] = {"t_ns": 5, "valid": True, "reasons": [], "age_ms": 40.0, "max_age_ms": 500.0, "late": False}


def after(waited_s: float, topic: str = "/nav/glide_slope", **fields: Any) -> dict[str, Any]:
    payload = json.dumps(fields or OUTPUT, separators=(",", ":")).encode()
    found: dict[str, Any] = json.loads(PublishedMessage(topic, payload, 3, 100.0).numbered_json("ab", 100.0 + waited_s))
    return found


def test_boot_and_number_are_in_front() -> None:
    assert PublishedMessage("/health", b'{"t_ns":5}', 3, 1.0).numbered_json("ab", 1.0) == (
        b'{"boot":"ab","number":3,"t_ns":5}'
    )
    assert PublishedMessage("/health", b"{}", 3, 1.0).numbered_json("ab", 1.0) == b'{"boot":"ab","number":3}'


def test_an_output_that_has_waited_states_its_new_age() -> None:
    assert after(0.02) == {"boot": "ab", "number": 3, **OUTPUT}
    assert after(0.2) == {"boot": "ab", "number": 3, **OUTPUT, "age_ms": 240.0}


def test_an_output_that_has_waited_too_long_is_not_valid() -> None:
    assert after(0.47) == {"boot": "ab", "number": 3, **OUTPUT, "age_ms": 510.0, "late": True, "valid": False}
    assert after(0.47, max_age_ms=2000.0, valid=True)["valid"] is True


def test_an_output_of_unknown_time_is_not_valid() -> None:
    payload = json.dumps(OUTPUT).encode()
    aged = json.loads(PublishedMessage("/nav/glide_slope", payload, 1).numbered_json("ab", 5.0))
    assert (aged["valid"], aged["late"]) == (False, True)


def test_events_and_health_stay_as_they_are() -> None:
    assert after(100.0, "/event", t_ns=5, text="x") == {"boot": "ab", "number": 3, "t_ns": 5, "text": "x"}


@given(st.floats(0.0, 1e7), st.floats(0.0, 5000.0), st.booleans(), st.booleans())
def test_it_is_never_valid_above_its_largest_age(waited_s: float, age_ms: float, late: bool, valid: bool) -> None:
    fields = {**OUTPUT, "age_ms": age_ms, "late": late or age_ms > 500.0, "valid": valid and age_ms <= 500.0}
    found = after(waited_s, **fields)
    assert not (found["valid"] and age_ms + 1000.0 * waited_s > 550.0)


VALUES = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=3)
)
TABLES = st.dictionaries(
    st.sampled_from(["age_ms", "max_age_ms", "late", "valid"]), VALUES | st.lists(VALUES, max_size=2)
)
PAYLOADS = TABLES.map(lambda fields: json.dumps(fields).encode())


@given(PAYLOADS | st.binary(max_size=40) | st.binary(max_size=40).map(b"{".__add__))
def test_any_payload_of_the_bus_gives_a_message(payload: bytes) -> None:
    """A sink that fails at a message would disconnect, and get it again."""
    queue = SinkQueue()
    FanOut([queue]).publish("/nav/x", payload)
    for message in queue.take_all():
        sent = message.numbered_json("b", message.received_s + 1.0)
        fields = json.loads(sent)
        assert (fields["boot"], fields["number"]) == ("b", 1)
        assert fields["late"] or not fields.get("valid") or fields["age_ms"] <= fields.get("max_age_ms", 500.0)


@pytest.mark.parametrize("topic", ["/nav/+", "/nav/#", "/nav/*", "/nav//x", "/nav/x/", "nav", "", "/nav/a b", "/\0"])
def test_a_topic_with_a_wildcard_is_ignored(topic: str) -> None:
    queue = SinkQueue()
    fan_out = FanOut([queue])
    fan_out.publish(topic, b"{}")
    fan_out.publish("/nav/height_above_ground/radalt_2", b"{}")
    assert [message.topic for message in queue.take_all()] == ["/nav/height_above_ground/radalt_2"]
