"""The state of a display: values age after their arrival, and a late value is not valid."""

import json
from typing import Any

import pytest
from msgspec.structs import asdict

from fti.alarms.alarm_list import Alarm
from fti.alarms.condition import Condition, Severity
from fti.bus.message import encode_with_age
from fti.messages.outputs import ClearanceIntegrity, HeightAboveGround, IntegrityState
from fti.messages.reasons import Reason
from fti.web.live_state import MAX_EVENTS, MAX_TOPICS, LiveState
from tests.web.fake_daemon import make_laboratory

MS = 1_000_000
TOPIC = "/nav/height_above_ground/ra"
INTEGRITY = "/nav/clearance_integrity"
MAX_AGE_MS = 200.0
OK: dict[str, Any] = {"state": IntegrityState.OK, "reasons": (), "valid": True}


def make_height(t_ns: int = 0, now_ns: int = 0, **changes: Any) -> dict[str, Any]:
    fields: dict[str, Any] = {"valid": True, "reasons": ()} | changes
    height = HeightAboveGround(t_ns=t_ns, t_valid_ns=t_ns, sensor="ra", raw=11.0, height_agl=10.0, sd=0.3, **fields)
    return as_received(height, t_ns, now_ns)


def as_received(output: Any, t_ns: int = 0, now_ns: int = 0) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(encode_with_age(asdict(output), t_ns, now_ns, MAX_AGE_MS))
    return content


def shown(live: LiveState, now_ns: int, topic: str = TOPIC) -> dict[str, Any]:
    content: dict[str, Any] = live.state(now_ns)["outputs"][topic]
    return content


def alarm_ids(live: LiveState, now_ns: int) -> list[str]:
    return [alarm["id"] for alarm in live.state(now_ns)["alarms"]]


def test_a_value_grows_older_until_it_is_late() -> None:
    live = LiveState(0)
    live.update(TOPIC, make_height(now_ns=50 * MS), 0)
    fresh = shown(live, 149 * MS)
    assert (fresh["age_ms"], fresh["late"], fresh["valid"]) == (199.0, False, True)
    late = shown(live, 151 * MS)
    assert (late["age_ms"], late["late"], late["valid"]) == (201.0, True, False)
    assert late["height_agl"] == 10.0, "the last value stays, struck out"


def test_late_at_publishing_stays_late() -> None:
    live = LiveState(0)
    live.update(TOPIC, make_height(now_ns=300 * MS), 0)
    assert shown(live, 0)["late"]


def test_reasons_and_states_come_in_words() -> None:
    live = LiveState(0)
    live.update(TOPIC, make_height(valid=False, reasons=(Reason.ROLL, Reason.NO_RETURN)), 0)
    assert shown(live, 0)["reasons_text"] == ["roll limit", "no return"]
    output = ClearanceIntegrity(t_ns=0, t_valid_ns=0, state=IntegrityState.ACQUIRE, reasons=(), valid=False)
    live.update(INTEGRITY, as_received(output), 0)
    assert shown(live, 0, INTEGRITY)["state_text"] == "collecting the first window"


def test_a_dead_navigation_makes_fresh_values_late() -> None:
    live = LiveState(0)
    live.update(TOPIC, make_height(), 0)
    live.set_alive("navigation", True)
    assert not shown(live, 0)["late"]
    live.set_alive("navigation", False)
    assert shown(live, 0)["late"]
    assert alarm_ids(live, 0) == [], "the daemon says so; a display decides nothing"


def make_alarm(name: str, end_ns: int | None = None) -> dict[str, Any]:
    condition = Condition(name, Severity.WARNING, name.upper())
    return {**Alarm(condition, 1, 1, end_ns).as_json(), "is_acknowledged": False, "consequences": []}


def test_alarms_are_those_of_the_daemon_however_late_the_outputs_are() -> None:
    live = LiveState(0)
    live.update("/health", {"t_ns": 0}, 0)
    live.update(INTEGRITY, as_received(ClearanceIntegrity(t_ns=0, t_valid_ns=0, **OK)), 0)
    live.update("/alarms", {"t_ns": 0, "alarms": [make_alarm("integrity_alert")]}, 0)
    for now_ns in (0, 550 * MS, 1500 * MS):
        assert alarm_ids(live, now_ns) == ["integrity_alert"]


@pytest.mark.parametrize(("name", "end_ns", "is_late"), [("navigation", None, True), ("navigation", 3, False)])
def test_outputs_are_late_while_the_daemon_reports_that_navigation_has_stopped(
    name: str, end_ns: int | None, is_late: bool
) -> None:
    live = LiveState(0)
    live.update("/health", {"t_ns": 0}, 0)
    live.update(TOPIC, make_height(), 0)
    live.update("/alarms", {"t_ns": 0, "alarms": [make_alarm(name, end_ns)]}, 0)
    assert shown(live, 0)["late"] is is_late


@pytest.mark.parametrize("ends", ["silence", "connection"])
def test_a_silent_daemon_is_an_alarm_above_its_own_alarms(ends: str) -> None:
    live = LiveState(0)
    live.update("/health", {"t_ns": 0}, 0)
    live.update("/alarms", {"t_ns": 0, "alarms": [make_alarm("integrity_alert")]}, 0)
    live.set_alive("supervisor", ends == "silence")
    assert alarm_ids(live, 2001 * MS) == ["daemon", "integrity_alert"]


@pytest.mark.parametrize(
    ("session", "expected"), [({"state": "stopped"}, []), ({"state": "x"}, ["daemon"]), (3, ["daemon"])]
)
def test_the_end_of_the_session_is_no_alarm(session: object, expected: list[str]) -> None:
    live = LiveState(0)
    live.update("/health", {"t_ns": 0, "session": session}, 0)
    live.set_alive("supervisor", False)
    assert alarm_ids(live, 5000 * MS) == expected


def test_fti_time_goes_on_from_the_last_health() -> None:
    live = LiveState(0)
    assert live.state(0)["t_ns"] is None
    live.update("/health", {"t_ns": 5_000}, 10)
    assert live.state(17)["t_ns"] == 5_007


def test_silence_of_the_bus_is_counted_from_the_last_message_of_any_kind() -> None:
    live = LiveState(0)
    assert live.state(30 * MS)["stale_bus_ms"] == 30.0
    live.update("/health", {}, 40 * MS)
    live.update(TOPIC, make_height(), 60 * MS)
    assert live.state(70 * MS)["stale_bus_ms"] == 10.0


def test_events_and_topics_are_bounded() -> None:
    live = LiveState(0)
    for i in range(MAX_EVENTS + 5):
        live.update("/event", {"text": str(i)}, 0)
    for i in range(MAX_TOPICS + 5):
        live.update(f"/nav/{i}", {}, 0)
    state = live.state(0)
    assert [event["text"] for event in state["events"]] == [str(i) for i in range(5, MAX_EVENTS + 5)]
    assert len(state["outputs"]) == MAX_TOPICS


@pytest.mark.parametrize("nonsense", [{}, {"age_ms": "old", "max_age_ms": None, "reasons": 3, "state": 7, "t_ns": "x"}])
def test_nonsense_on_the_bus_is_shown_as_invalid(nonsense: dict[str, Any]) -> None:
    live = LiveState(0)
    for topic in (TOPIC, "/health", "/event", "/hil", INTEGRITY):
        live.update(topic, nonsense, 0)
    assert not shown(live, 0)["valid"]
    assert live.state(0)["hil"] is None
    live.history()


def test_what_an_emulator_does_is_reported_until_it_is_late_and_is_no_output() -> None:
    live = LiveState(0)
    assert live.state(0)["hil"] is None
    live.update("/hil", make_laboratory(5.0) | {"age_ms": 100.0, "max_age_ms": 1500.0, "late": False}, 0)
    fresh, old = live.state(1400 * MS), live.state(1401 * MS)
    assert (fresh["hil"]["late"], old["hil"]["late"]) == (False, True)
    assert old["hil"]["age_ms"] == 1501.0
    assert old["hil"]["devices"]["gnss"]["breaker"] == "on"
    assert old["outputs"] == {}
