"""A message as JSON for sinks whose protocol has no age of its own."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from fti.publish.message import PublishedMessage

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
