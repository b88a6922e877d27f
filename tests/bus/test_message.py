"""The payload of the bus: ages, lateness, and nothing that JSON cannot say."""

import json
import math
from dataclasses import asdict

from hypothesis import given
from hypothesis import strategies as st

from fti.bus import message
from fti.types import ClearanceIntegrity, HeightAboveGround, IntegrityState, Reason

MAX_AGE_MS = 200.0


def make_height(**changes: object) -> dict[str, object]:
    height = HeightAboveGround(
        t_ns=0, t_valid_ns=0, sensor="ra", raw=10.0, height_agl=9.5, sd=0.2, valid=True, reasons=(Reason.ROLL,)
    )
    return {**asdict(height), **changes}


@given(st.integers(min_value=-1_000_000_000, max_value=10_000_000_000))
def test_late_is_not_valid(age_ns: int) -> None:
    found = json.loads(message.stamped(make_height(), 5_000, 5_000 + age_ns, MAX_AGE_MS))
    assert abs(found["age_ms"] - age_ns / 1e6) <= 0.001
    assert found["late"] == (age_ns > MAX_AGE_MS * 1e6)
    assert found["valid"] == (not found["late"])
    assert found["max_age_ms"] == MAX_AGE_MS


def test_enums_are_words_and_nan_is_null() -> None:
    found = json.loads(message.stamped(make_height(raw=math.nan, sd=math.inf), 0, 0, MAX_AGE_MS))
    assert (found["raw"], found["sd"], found["height_agl"]) == (None, None, 9.5)
    assert (found["reasons"], found["datum"]) == (["roll"], "agl")


def test_nan_inside_a_list_is_null() -> None:
    assert json.loads(message.encode({"a": [1.0, math.nan], "b": {"c": math.inf}})) == {
        "a": [1.0, None],
        "b": {"c": None},
    }


def test_integrity_keeps_every_field() -> None:
    output = ClearanceIntegrity(t_ns=1, t_valid_ns=None, state=IntegrityState.OK, reasons=(), valid=True, t1_ratio=0.5)
    found = json.loads(message.stamped(asdict(output), 1, 1, MAX_AGE_MS))
    assert set(found) == {*asdict(output), "age_ms", "max_age_ms", "late"}
    assert found["state"] == "ok"


@given(st.binary(max_size=40))
def test_decode_takes_anything(payload: bytes) -> None:
    found = message.decode(payload)
    assert found is None or isinstance(found, dict)


def test_decode_is_the_inverse_of_encode() -> None:
    assert message.decode(message.encode({"a": [1, "b", None]})) == {"a": [1, "b", None]}
    assert message.decode(b"[1]") is None
