"""Which alarms stand when."""

from dataclasses import replace
from typing import Any

import pytest

from fti.web.alarms import Sight, find_alarms


def make_health(**changes: Any) -> dict[str, Any]:
    running = {"state": "running"}
    return {
        "session": {"state": "recording"},
        "storage": {"state": "ok", "hint": ""},
        "processes": {"recorder": running, "navigation": running, "display": running},
        "links": {"can1": {"dropped_frames": 0}},
    } | changes


GOOD = Sight(
    health=make_health(),
    health_silence_ms=400.0,
    nav_silence_ms=30.0,
    nav_age_ms=40.0,
    integrity={"state": "ok"},
    dead=frozenset(),
)


def found(sight: Sight) -> dict[str, tuple[str, str]]:
    return {alarm["id"]: (alarm["level"], alarm["detail"]) for alarm in find_alarms(sight)}


def with_processes(**states: str) -> Sight:
    return replace(GOOD, health=make_health(processes={name: {"state": state} for name, state in states.items()}))


def test_no_alarm_when_all_is_well() -> None:
    assert found(GOOD) == {}


@pytest.mark.parametrize(
    "sight", [replace(GOOD, health_silence_ms=2001.0), replace(GOOD, dead=frozenset({"supervisor"}))]
)
def test_daemon_stopped(sight: Sight) -> None:
    assert list(found(sight)) == ["daemon_stopped"]


@pytest.mark.parametrize(
    ("sight", "why"),
    [
        (replace(GOOD, nav_silence_ms=1001.0, nav_age_ms=1040.0), "no output for 1.0 s"),
        (replace(GOOD, dead=frozenset({"navigation"})), "process ended"),
        (with_processes(recorder="running", navigation="stopped"), "process stopped"),
        (with_processes(recorder="running", navigation="restarting"), "process restarting"),
    ],
)
def test_navigation_stopped(sight: Sight, why: str) -> None:
    assert found(sight) == {"navigation_stopped": ("red", f"{why}; its last values are struck out")}


def test_navigation_that_starts_is_no_failure() -> None:
    sight = replace(with_processes(navigation="starting"), nav_silence_ms=9000.0, nav_age_ms=None)
    assert found(sight) == {"navigation_starting": ("amber", "recording already runs")}


def test_navigation_that_catches_up_is_late_not_stopped() -> None:
    assert found(replace(GOOD, nav_age_ms=3200.0)) == {"navigation_late": ("amber", "catching up, 3.2 s behind")}


def test_a_refusing_medium_is_said_loudly() -> None:
    changes = {"session": {"state": "storage_error"}, "storage": {"state": "error", "hint": "EIO"}}
    assert found(replace(GOOD, health=make_health(**changes))) == {"storage": ("red", "EIO")}


@pytest.mark.parametrize(
    ("state", "level"),
    [
        ("error", "red"),
        ("gone", "red"),
        ("full", "amber"),
        ("overdue", "amber"),
        ("slow", "amber"),
        ("fallback", "amber"),
        ("of_the_future", "amber"),
    ],
)
def test_every_state_of_the_storage_but_ok_is_an_alarm(state: str, level: str) -> None:
    health = make_health(storage={"state": state, "hint": "why and what to do"})
    assert found(replace(GOOD, health=health)) == {"storage": (level, "why and what to do")}


def test_a_recorder_that_is_not_there() -> None:
    assert found(with_processes(recorder="restarting")) == {"recorder": ("red", "the recorder is restarting")}


def test_losses_name_the_link() -> None:
    health = make_health(links={"can1": {"dropped_frames": 12}, "ins": {"dropped_frames": 0}})
    assert found(replace(GOOD, health=health)) == {"losses": ("amber", "12 frames on can1")}


def test_integrity_in_words() -> None:
    sight = replace(GOOD, integrity={"state": "caution", "reasons": ["shifted"]})
    assert found(sight) == {"integrity_caution": ("amber", "another position fits better")}


def test_the_most_urgent_comes_first() -> None:
    sight = replace(GOOD, health_silence_ms=5000.0, nav_age_ms=5000.0, integrity={"state": "caution"})
    assert list(found(sight)) == ["daemon_stopped", "navigation_late", "integrity_caution"]


@pytest.mark.parametrize(
    ("sources", "identity", "title", "detail"),
    [
        (("filter", "filter", "ins"), "position_source", "POSITION BY FILTER", "no device gives it; ± 12 m"),
        (("radio", "radio", "ins"), "position_source", "POSITION BY RADIO", "no device gives it; ± 12 m"),
        (("gnss", "gnss", "filter"), "attitude_source", "ATTITUDE BY FILTER", "no device gives it"),
        (("gnss", "vertical", "ins"), "altitude_source", "ALTITUDE BY VERTICAL CHANNEL", "no device gives it; ± 3 m"),
        ((None, None, "ins"), "position_source", "NO POSITION", "no device gives it, nor anything else"),
    ],
)
def test_what_no_device_gives_is_told_with_who_has_taken_its_place(
    sources: tuple[str | None, ...], identity: str, title: str, detail: str
) -> None:
    names = ("position_source", "altitude_source", "attitude_source")
    solution = {**dict(zip(names, sources, strict=True)), "horizontal_sd": 12.3, "vertical_sd": 2.6}
    sight = replace(GOOD, solution=solution, had=frozenset({"position", "attitude"}))
    (alarm,) = find_alarms(sight)
    assert alarm == {"id": identity, "level": "amber", "title": title, "detail": detail}


def test_devices_that_give_all_and_a_bench_that_never_had_any_are_no_alarm() -> None:
    names = ("position_source", "altitude_source", "attitude_source")
    assert found(replace(GOOD, solution=dict.fromkeys(names, "ins"), had=frozenset({"position"}))) == {}
    assert found(replace(GOOD, solution=dict.fromkeys(names))) == {}


def test_a_stopped_navigation_judges_nothing() -> None:
    sight = replace(GOOD, dead=frozenset({"navigation"}), integrity={"state": "alert"})
    assert list(found(sight)) == ["navigation_stopped"]
