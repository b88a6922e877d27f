"""State of several aircraft from the messages of a router, without one."""

from __future__ import annotations

import json
import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.ground.fleet import MAX_AIRCRAFT, Fleet, Key, MissingEvents, summaries
from fti.ground.link_delay import LinkDelay
from tests.web.fake_daemon import make_health, make_laboratory

S_NS = 1_000_000_000
MS_NS = 1_000_000
START_NS = 50 * S_NS
PREFIX = "fti/D-EFTI/demo_20261129T180000Z_0"
INTEGRITY: dict[str, Any] = {
    "t_valid_ns": None,
    "valid": True,
    "reasons": [],
    "state": "ok",
    "max_age_ms": 500.0,
    "late": False,
}


def send(fleet: Fleet, topic: str, now_ns: int, fields: dict[str, Any], prefix: str = PREFIX) -> MissingEvents | None:
    return fleet.update(prefix + topic, json.dumps(fields).encode(), now_ns)


def send_event(fleet: Fleet, number: int, now_ns: int = START_NS, boot: str = "a") -> MissingEvents | None:
    fields = {"boot": boot, "number": number, "t_ns": 1, "level": "info", "source": "x", "text": f"event {number}"}
    return send(fleet, "/event", now_ns, fields)


def integrity(fleet: Fleet, now_ns: int) -> dict[str, Any]:
    shown: dict[str, Any] = fleet.states(now_ns)["D-EFTI"]["outputs"]["/nav/clearance_integrity"]
    return shown


def send_integrity(fleet: Fleet, published_ns: int, now_ns: int, age_ms: float = 20.0) -> None:
    t_ns = published_ns - round(age_ms * MS_NS)
    fields = {"boot": "a", "number": 1, "t_ns": t_ns, "age_ms": age_ms, **INTEGRITY}
    send(fleet, "/nav/clearance_integrity", now_ns, fields)


def test_the_age_of_a_value_includes_the_delay_of_the_link() -> None:
    """The clock of the aircraft is an hour ahead; the quickest message takes 0.3 s, which nobody can know."""
    fleet, hour = Fleet(2000.0), 3600 * S_NS
    send_integrity(fleet, hour + START_NS, START_NS + 300 * MS_NS)
    assert integrity(fleet, START_NS + 300 * MS_NS)["age_ms"] == pytest.approx(20.0, abs=0.1)
    now_ns = START_NS + 10 * S_NS
    send_integrity(fleet, hour + now_ns, now_ns + 1300 * MS_NS)
    shown = integrity(fleet, now_ns + 1300 * MS_NS)
    assert shown["age_ms"] == pytest.approx(1020.0, abs=2.0)  # the clocks may drift
    assert shown["valid"] and not shown["late"]


def test_a_value_that_waited_in_the_link_is_not_valid() -> None:
    fleet = Fleet(2000.0)
    send_integrity(fleet, START_NS, START_NS)
    send_integrity(fleet, START_NS + S_NS, START_NS + 4 * S_NS)
    shown = integrity(fleet, START_NS + 4 * S_NS)
    assert (shown["valid"], shown["late"]) == (False, True)


def test_a_value_grows_old_without_messages() -> None:
    fleet = Fleet(2000.0)
    send_integrity(fleet, START_NS, START_NS)
    assert integrity(fleet, START_NS + 1900 * MS_NS)["valid"]
    assert not integrity(fleet, START_NS + 2100 * MS_NS)["valid"]


def test_a_value_that_is_late_in_the_aircraft_is_late_here() -> None:
    fleet = Fleet(2000.0)
    fields = {**INTEGRITY, "late": True, "valid": False, "t_ns": 1, "age_ms": 700.0}
    send(fleet, "/nav/clearance_integrity", START_NS, fields)
    assert integrity(fleet, START_NS)["valid"] is False


def test_silence_is_an_alarm_and_ends_with_any_message() -> None:
    fleet = Fleet(2000.0)
    send_integrity(fleet, START_NS, START_NS)
    assert fleet.states(START_NS + 4 * S_NS)["D-EFTI"]["alarms"] == []
    (alarm,) = fleet.states(START_NS + 6 * S_NS)["D-EFTI"]["alarms"]
    assert (alarm["id"], alarm["title"], alarm["severity"]) == ("daemon", "NO CONTACT", "warning")
    assert "no message from the aircraft for 6.0 s" in alarm["cause"]
    send_integrity(fleet, START_NS + 7 * S_NS, START_NS + 7 * S_NS)
    assert fleet.states(START_NS + 7 * S_NS)["D-EFTI"]["alarms"] == []


def test_an_aircraft_that_has_disconnected_is_silent_at_once() -> None:
    fleet = Fleet(2000.0)
    send_integrity(fleet, START_NS, START_NS)
    fleet.set_alive(f"{PREFIX}/@alive/publish", False)
    state = fleet.states(START_NS)["D-EFTI"]
    assert [alarm["title"] for alarm in state["alarms"]] == ["NO CONTACT"]
    assert state["outputs"]["/nav/clearance_integrity"]["valid"] is False
    fleet.set_alive(f"{PREFIX}/@alive/publish", True)
    assert fleet.states(START_NS)["D-EFTI"]["alarms"] == []


def test_missing_events_are_named_and_copies_shown_once() -> None:
    fleet = Fleet(2000.0)
    assert send_event(fleet, 1) is None
    assert send_event(fleet, 2) is None
    assert send_event(fleet, 2) is None
    assert send_event(fleet, 6) == MissingEvents("D-EFTI", PREFIX.rpartition("/")[2], 3, 5)
    for number in (3, 4, 5):
        fields = {"boot": "a", "number": number, "t_ns": 1, "level": "info", "source": "x", "text": f"event {number}"}
        assert send(fleet, f"/event/{number}", START_NS, fields) is None
    texts = [event["text"] for event in fleet.states(START_NS)["D-EFTI"]["events"]]
    assert texts == [f"event {n}" for n in (1, 2, 6, 3, 4, 5)]
    assert send_event(fleet, 1, boot="b") is None  # the numbers begin again
    assert send_event(fleet, 1000, boot="b") == MissingEvents("D-EFTI", PREFIX.rpartition("/")[2], 800, 999)


def test_a_new_session_replaces_the_old_one_and_not_the_reverse() -> None:
    fleet = Fleet(2000.0)
    newer = "fti/D-EFTI/demo_20261129T190000Z_0"
    send_event(fleet, 1)
    fields = {"boot": "n", "number": 1, "t_ns": 1, "level": "info", "source": "x", "text": "new"}
    send(fleet, "/event", START_NS, fields, newer)
    send_event(fleet, 2)
    state = fleet.states(START_NS)["D-EFTI"]
    assert state["session"] == "demo_20261129T190000Z_0"
    assert [event["text"] for event in state["events"]] == ["new"]


@pytest.mark.parametrize(
    ("earlier", "later"),
    [("da42_20261129T180000Z_0", "b_20261129T190000Z_0"), ("a_20261129T180000Z_9", "a_20261129T180000Z_10")],
)
def test_the_start_of_a_session_says_which_is_newer(earlier: str, later: str) -> None:
    fleet = Fleet(2000.0)
    for session in (earlier, later, earlier):
        fields = {"boot": "n", "number": 1, "t_ns": 1, "level": "info", "source": "x", "text": "new"}
        send(fleet, "/event", START_NS, fields, f"fti/D-EFTI/{session}")
    assert fleet.states(START_NS)["D-EFTI"]["session"] == later


def test_a_silent_session_is_followed_by_one_with_an_earlier_time() -> None:
    """The computer of the aircraft was started again, and its clock has lost the time."""
    fleet = Fleet(2000.0)
    fields = {"boot": "n", "number": 1, "t_ns": 1, "level": "info", "source": "x", "text": "again"}
    send_event(fleet, 1)
    for wait_s, session in ((59, PREFIX.rpartition("/")[2]), (61, "demo_20200101T000000Z_0")):
        send(fleet, "/event", START_NS + wait_s * S_NS, fields, "fti/D-EFTI/demo_20200101T000000Z_0")
        assert fleet.states(START_NS)["D-EFTI"]["session"] == session


def test_times_that_begin_again_with_a_boot_are_no_delay() -> None:
    fleet = Fleet(2000.0)
    send_integrity(fleet, START_NS + 3600 * S_NS, START_NS)
    now_ns = START_NS + 10 * S_NS
    fields = {"boot": "b", "number": 1, "t_ns": START_NS, "age_ms": 20.0, **INTEGRITY}
    send(fleet, "/nav/clearance_integrity", now_ns, fields)
    assert integrity(fleet, now_ns)["valid"]


@pytest.mark.parametrize(("origin", "is_valid"), [("replay", True), ("flight", False)])
def test_a_replay_that_begins_again_is_not_late(origin: str, is_valid: bool) -> None:
    """Its times are those of the recording; they go back, and the link has no delay."""
    fleet = Fleet(2000.0)
    health = make_health(0.0, 1, 1)
    health["session"]["origin"] = origin
    send(fleet, "/health", START_NS, {"boot": "a", "number": 1, **health})
    send_integrity(fleet, START_NS + 3600 * S_NS, START_NS + 1 * S_NS)
    send_integrity(fleet, START_NS, START_NS + 2 * S_NS)
    assert integrity(fleet, START_NS + 2 * S_NS)["valid"] is is_valid


def test_the_laboratory_which_has_no_time_is_as_old_as_the_last_message() -> None:
    fleet = Fleet(2000.0)
    for delay_s in (0, 3):
        now_ns = START_NS + 10 * delay_s * S_NS
        send_integrity(fleet, 3600 * S_NS + now_ns, now_ns + delay_s * S_NS)
        stamp = {"boot": "a", "number": 1, "age_ms": 5.0, "max_age_ms": 1000.0, "late": False}
        laboratory = {**make_laboratory(1.0), **stamp}
        send(fleet, "/hil", now_ns + delay_s * S_NS, laboratory)
        shown = fleet.states(now_ns + delay_s * S_NS)["D-EFTI"]["hil"]
        assert shown["age_ms"] == pytest.approx(1000.0 * delay_s + 5.0, abs=5.0)
        assert shown["late"] is (delay_s == 3)


def test_several_aircraft_are_apart_and_their_number_is_limited() -> None:
    fleet = Fleet(2000.0)
    for number in range(2 * MAX_AIRCRAFT):
        fields = {"boot": "a", "number": 1, "t_ns": 1, "level": "info", "source": "x", "text": f"{number}"}
        send(fleet, "/event", START_NS, fields, f"fti/D-{number:03}/s")
    states = fleet.states(START_NS)
    assert len(states) == MAX_AIRCRAFT
    assert all(state["events"][0]["text"] == str(int(name[2:])) for name, state in states.items())
    assert [row["aircraft"] for row in summaries(states)] == sorted(states)


def test_a_wrong_message_is_refused_and_named() -> None:
    fleet = Fleet(2000.0)
    fleet.update(f"{PREFIX}/nav/clearance_integrity", b'{"valid": "yes"}', START_NS)
    fleet.update(f"{PREFIX}/command", b"{}", START_NS)
    (event,) = fleet.states(START_NS)["D-EFTI"]["events"]
    assert event["level"] == "warning" and "/nav/clearance_integrity" in event["text"]
    assert fleet.states(START_NS)["D-EFTI"]["outputs"] == {}


@pytest.mark.parametrize(
    "key", ["", "fti", "fti/a", "fti/a/b", "other/a/b/nav/x", "fti//b/nav/x", f"fti/{'x' * 65}/b/c"]
)
def test_other_keys_are_ignored(key: str) -> None:
    assert Key.parse(key) is None


Json = st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | st.text(), st.lists, max_leaves=5)
NAMES = ["t_ns", "age_ms", "max_age_ms", "late", "valid", "state", "boot", "number", "session", "text"]
Fields = st.dictionaries(st.sampled_from(NAMES), Json)
Topics = st.sampled_from(["/event", "/event/5", "/health", "/alarms", "/hil", "/nav/glide_slope", "/nav/other", "/x"])


@given(st.lists(st.tuples(Topics, Fields), max_size=10))
def test_nothing_that_arrives_breaks_it(messages: list[tuple[str, dict[str, Any]]]) -> None:
    fleet = Fleet(2000.0)
    for n, (topic, fields) in enumerate(messages):
        fleet.update(PREFIX + topic, json.dumps(fields).encode(errors="replace"), START_NS + n * S_NS)
    states = fleet.states(START_NS + 20 * S_NS)
    json.dumps([*summaries(states)], allow_nan=False)
    for state in states.values():
        assert not any(output["valid"] for output in state["outputs"].values())


def test_the_delay_is_that_beyond_the_shortest_one() -> None:
    """Random delays of 0.2 s and more; clocks that run apart by 50 ppm; the oracle knows each delay."""
    rng, delay = random.Random(24), LinkDelay()
    shortest_ns, errors = 10 * S_NS, []
    for n in range(2000):
        published_ns = n * S_NS
        added_ns = round((0.2 + rng.expovariate(1.0 / 0.3)) * S_NS)
        shortest_ns = min(shortest_ns, added_ns)
        found_ns = delay.update(round(published_ns * (1.0 + 50e-6)), published_ns + added_ns)
        errors.append((found_ns - (added_ns - shortest_ns)) / MS_NS)
    assert max(map(abs, errors[100:])) < 25.0  # [ms]; rises by 0.1 ms a second until the next quick message
