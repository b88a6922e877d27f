"""The payload of the bus: ages, lateness, and only valid JSON."""

import contextlib
import functools
import io
import json
import math
import os
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import asdict
from rich.console import Console

from fti.bus import message
from fti.cli._watch_view import render
from fti.messages.outputs import ClearanceIntegrity, Event, HeightAboveGround, IntegrityState
from fti.messages.reasons import Reason
from fti.web.live_state import LiveState
from tests.web.fake_daemon import Approach, make_health, make_laboratory, make_sinks

MAX_AGE_MS = 200.0


def make_height(**changes: object) -> dict[str, object]:
    height = HeightAboveGround(
        t_ns=0, t_valid_ns=0, sensor="ra", raw=10.0, height_agl=9.5, sd=0.2, valid=True, reasons=(Reason.ROLL,)
    )
    return {**asdict(height), **changes}


@given(st.integers(min_value=-1_000_000_000, max_value=10_000_000_000))
def test_late_is_not_valid(age_ns: int) -> None:
    content = json.loads(message.encode_with_age(make_height(), 5_000, 5_000 + age_ns, MAX_AGE_MS))
    assert abs(content["age_ms"] - age_ns / 1e6) <= 0.001
    assert content["late"] == (age_ns > MAX_AGE_MS * 1e6)
    assert content["valid"] == (not content["late"])
    assert content["max_age_ms"] == MAX_AGE_MS


def test_enums_are_words_and_nan_is_null() -> None:
    content = json.loads(message.encode_with_age(make_height(raw=math.nan, sd=math.inf), 0, 0, MAX_AGE_MS))
    assert (content["raw"], content["sd"], content["height_agl"]) == (None, None, 9.5)
    assert (content["reasons"], content["datum"]) == (["roll"], "agl")


def test_health_with_a_path_that_is_not_utf_8_and_a_long_hint_is_taken() -> None:
    health = make_health(20.0, 20_000_000_000, 0)
    health["session"]["folder"] = os.fsdecode(b"/data/\xff")
    health["storage"]["hint"] = "x" * 100_000
    content = message.decode("/health", message.encode(health))
    assert (content["session"]["folder"], content["storage"]["hint"]) == ("/data/?", "x" * 100_000)


def test_nan_inside_a_list_is_null() -> None:
    assert json.loads(message.encode({"a": [1.0, math.nan], "b": {"c": math.inf}})) == {
        "a": [1.0, None],
        "b": {"c": None},
    }


def test_integrity_keeps_every_field() -> None:
    output = ClearanceIntegrity(t_ns=1, t_valid_ns=None, state=IntegrityState.OK, reasons=(), valid=True, t1_ratio=0.5)
    content = json.loads(message.encode_with_age(asdict(output), 1, 1, MAX_AGE_MS))
    assert set(content) == {*asdict(output), "age_ms", "max_age_ms", "late"}
    assert content["state"] == "ok"


# ------------------------------------------------------------------------------------------------- what arrives

HEIGHT = "/nav/height_above_ground/ra"
TOPICS = {
    **{topic: asdict(output) for topic, output in Approach().outputs(20.0, 20_000_000_000).items()},
    "/health": {**make_health(20.0, 20_000_000_000, 0), "sinks": make_sinks()},
    "/hil": make_laboratory(20.0),
    "/event": asdict(Event(t_ns=1, level="info", source="test", text="it goes")),
}


def refusal(topic: str, payload: bytes) -> str:
    with pytest.raises(message.MessageError) as caught:
        message.decode(topic, payload)
    return str(caught.value)


@pytest.mark.parametrize("topic", TOPICS)
def test_messages_of_the_daemon_are_accepted_unchanged(topic: str) -> None:
    payload = message.encode_with_age(TOPICS[topic], 0, 0, MAX_AGE_MS)
    assert message.decode(topic, payload) == json.loads(payload)


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        (b'"age_ms":' + b"9" * 4000, "is not JSON"),
        (b'"age_ms":1' + b"0" * 300, "a number beyond"),
        (b'"age_ms":-9300000000000000000', "a number beyond"),
        (b'"age_ms":NaN', "is not JSON"),
        (b'"age_ms":-Infinity', "is not JSON"),
        (b'"age_ms":1e999', "is not JSON"),
        (b'"age_ms":"old"', "age_ms is text, not a number or a whole number"),
        (b'"age_ms":true', "age_ms is a flag, not a number or a whole number"),
        (b'"late":1', "late is a whole number, not a flag"),
        (b'"sd":[]', "sd is a list, not a number or a whole number or null"),
        (b'"reasons":"roll"', "reasons is text, not a list"),
        (b'"reasons":[{}]', "reasons[0] is a table, not text"),
        (b'"t_ns":1.5', "t_ns is a number, not a whole number"),
        (b'"sensor":"\\ud800"', "is not JSON"),
        (b'"sensor":"\xff"', "is not JSON"),
        (b'"more":' + b"[" * 17 + b"]" * 17, "is nested more than 16 deep"),
        (b'"more":' + b"[" * 20000 + b"]" * 20000, "is not JSON"),
        (b'"more":"' + b"x" * 65536 + b'"', "bytes; the limit is 65536"),
    ],
)
def test_what_no_display_could_show_is_refused_with_the_reason(fields: bytes, why: str) -> None:
    good = message.encode_with_age(make_height(), 0, 0, MAX_AGE_MS)
    assert why in refusal(HEIGHT, good[:-1] + b"," + fields + b"}")


def test_a_sink_that_no_display_could_show_is_refused() -> None:
    health, sinks = make_health(20.0, 20_000_000_000, 0), make_sinks()
    sinks["mqtt"]["lost_events"] = None
    assert refusal("/health", message.encode({**health, "sinks": sinks})).startswith("sinks.mqtt.lost_events is null")


def test_a_field_that_is_missing_is_named_unless_it_came_with_a_later_version() -> None:
    fields = make_height()
    del fields["height_agl"]
    assert refusal(HEIGHT, message.encode(fields)) == "height_agl is missing"
    fields = make_height()
    del fields["nearest"]
    assert message.decode(HEIGHT, message.encode(fields))["nearest"] is None


@pytest.mark.parametrize("topic", ["", "/", "/other", "nav", "@alive/navigation", "/nav" * 3000])
def test_other_topics_are_refused(topic: str) -> None:
    assert refusal(topic, b"{}") == "unknown topic"


def test_an_output_of_a_later_version_is_checked_for_what_all_have() -> None:
    assert message.decode("/nav/later", b'{"t_ns":1,"valid":true}') == {"t_ns": 1, "valid": True}
    assert "valid is null" in refusal("/nav/later", b'{"t_ns":1,"valid":null}')


def test_an_event_with_a_very_long_text_is_shortened_not_lost() -> None:
    event = {"t_ns": 1, "level": "error", "source": "unit", "text": "\ud800" + "é\n" * 10**6}
    content = message.decode("/event", message.encode_event(event))
    assert content["text"].startswith("?é\n")
    assert (len(content["text"]), content["text"][-1]) == (4096, "…")


# Valid and invalid JSON: an independent check of the messages for a display.
LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**30), 10**30),
    st.floats(),
    st.text(st.characters(codec=None), max_size=6),
    st.just(10**3999),
)
VALUES = st.recursive(LEAVES, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3))


def paths(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list | tuple) else ()
    return [path, *(found for key, item in inner for found in paths(item, (*path, key)))]


def changed(value: Any, path: tuple[Any, ...], new: Any) -> Any:
    if not path:
        return new
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = changed(copy[path[0]], path[1:], new)
    return copy


@functools.cache
def good_messages() -> dict[str, dict[str, Any]]:
    """One of each topic, as a display gets it."""
    return {
        topic: message.decode(topic, message.encode_with_age(fields, 0, 0, MAX_AGE_MS))
        for topic, fields in TOPICS.items()
    }


def show(topic: str, payload: bytes, *, is_printed: bool = True) -> None:
    """Feed it to a display, after one good message of each topic.

    is_printed : the terminal's view is laid out and printed, too, which takes most of the time
    """
    try:
        decoded = message.decode(topic, payload)
    except message.MessageError:
        return
    live = LiveState(0)
    for known, good in good_messages().items():
        live.update(known, good, 0)
    live.update(topic, decoded, 0)
    for now_ns in (0, 10**12):
        json.dumps(live.state(now_ns), allow_nan=False).encode()
    view = render(live.state(0))
    if is_printed:
        Console(file=io.StringIO()).print(view)
    json.dumps(live.history(), allow_nan=False)


NASTY: tuple[Any, ...] = (None, True, -(2**63), 2**63, 1e18, -1e18, -1e-300, "", "x", [], {}, [None], {"x": {}})


@pytest.mark.parametrize("topic", TOPICS)
def test_every_field_may_be_anything_that_is_taken(topic: str) -> None:
    """Page, terminal and plots live on.  Of links and devices one is enough."""
    fields = json.loads(message.encode_with_age(TOPICS[topic], 0, 0, MAX_AGE_MS))
    different = {
        tuple("*" if n == 1 and len(path) > 2 else key for n, key in enumerate(path)): path for path in paths(fields)
    }
    for path in different.values():
        for value in NASTY:
            is_text = isinstance(value, str | list | dict)
            show(topic, json.dumps(changed(fields, path, value)).encode(), is_printed=is_text)


@given(st.data(), st.sampled_from(list(TOPICS)))
def test_whatever_is_taken_can_be_shown(data: st.DataObject, topic: str) -> None:
    """Any field of any message is anything, or is missing: page, terminal and plots live on."""
    fields = json.loads(message.encode_with_age(TOPICS[topic], 0, 0, MAX_AGE_MS))
    path = data.draw(st.sampled_from(paths(fields)))
    fields = changed(fields, path, data.draw(VALUES))
    show(topic, json.dumps(fields, ensure_ascii=data.draw(st.booleans())).encode(errors="surrogatepass"))


@given(st.binary(max_size=60), st.sampled_from(list(TOPICS)))
def test_any_bytes_are_a_message_or_refused(payload: bytes, topic: str) -> None:
    with contextlib.suppress(message.MessageError):
        message.decode(topic, payload)
