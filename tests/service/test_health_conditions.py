"""Conditions of recording, processes, links and devices, and expected states."""

from __future__ import annotations

from typing import Any

import pytest

from fti.logger.storage import StorageState
from fti.service.supervisor.health_conditions import MIN_RESTARTS, START_NS, STORAGE, HealthConditions, find_losses

SECOND_NS = 10**9


def health(t_s: float = 100.0, **changes: Any) -> dict[str, Any]:
    running = {"state": "running", "restarts": 0}
    return {
        "t_ns": round(t_s * SECOND_NS),
        "session": {"state": "recording"},
        "storage": {"state": "ok", "hint": "", "free_mb": 1e6},
        "processes": {name: dict(running) for name in ("recorder", "navigation", "display")},
        "links": {"line": {"state": "good", "hint": "", "dropped_frames": 0, "stamp_refused": 0}},
        "devices": {"ins": {"link": "line", "state": "good", "hint": ""}},
        "navigation": {"lag_ms": 10.0},
    } | changes


def link(state: str, **counts: int) -> dict[str, Any]:
    return {"line": {"state": state, "hint": "why", "dropped_frames": 0, "stamp_refused": 0, **counts}}


def device(state: str) -> dict[str, Any]:
    return {"ins": {"link": "line", "state": state, "hint": "why"}}


def found(conditions: HealthConditions, message: dict[str, Any]) -> dict[str, tuple[str, str]]:
    """Severity and cause of each condition."""
    reports = [report.condition for report in conditions.reports(message)]
    return {condition.id: (str(condition.severity), condition.cause) for condition in reports if condition}


def test_all_is_well() -> None:
    assert found(HealthConditions(0), health()) == {}


@pytest.mark.parametrize(("state", "severity"), [(state, severity.value) for state, (severity, _) in STORAGE.items()])
def test_every_state_of_the_storage_but_ok_is_an_alarm(state: str, severity: str) -> None:
    name = "recording" if severity == "warning" else f"storage_{state}"
    restarted = {"recorder": {"state": "running", "restarts": 1}}
    message = health(storage={"state": state, "hint": "why and what to do"}, processes=restarted)
    assert found(HealthConditions(0), message) == {name: (severity, "why and what to do")}


def test_the_first_file_of_a_session_that_is_being_opened_is_expected() -> None:
    message = health(storage={"state": "opening", "hint": "the first file is being opened"})
    assert found(HealthConditions(0), message) == {}


def test_the_storage_has_no_other_states() -> None:
    assert set(STORAGE) == set(StorageState) - {StorageState.OK}
    assert found(HealthConditions(0), health(storage={"state": "new"})) == {"storage_new": ("caution", "storage new")}


def test_a_recorder_that_is_not_there() -> None:
    processes = health()["processes"] | {"recorder": {"state": "restarting"}}
    message = health(processes=processes)
    assert found(HealthConditions(0), message) == {"recording": ("warning", "the recorder is restarting")}


def test_a_navigation_that_starts_is_an_advisory_and_one_that_ended_a_warning() -> None:
    conditions = HealthConditions(0)

    def severity(state: str) -> dict[str, str]:
        processes = health()["processes"] | {"navigation": {"state": state}}
        return {name: severity for name, (severity, _) in found(conditions, health(processes=processes)).items()}

    assert severity("starting") == {"navigation_starting": "advisory"}
    assert severity("running") == {}
    assert severity("restarting") == severity("starting") == {"navigation": "warning"}


def test_a_process_that_was_started_again_and_again_within_a_minute() -> None:
    conditions = HealthConditions(0)

    def names(t_s: float, restarts: int) -> list[str]:
        processes = health()["processes"] | {"display": {"state": "running", "restarts": restarts}}
        return list(found(conditions, health(t_s, processes=processes)))

    for count in range(MIN_RESTARTS):
        assert names(100.0 + count, count) == []
    assert names(110.0, MIN_RESTARTS) == ["process:display"]
    assert names(160.0, MIN_RESTARTS) == ["process:display"]
    assert names(162.0, MIN_RESTARTS) == [], "the first one was more than a minute ago"


@pytest.mark.parametrize(("lag_ms", "is_assessed"), [(None, True), (500.0, True), (501.0, False), (50_000.0, False)])
def test_no_device_is_assessed_while_navigation_is_behind(lag_ms: float | None, is_assessed: bool) -> None:
    """Its report is about a time before the start of an emulator or the power-on of a device."""
    message = health(devices=device("silent"), navigation={"lag_ms": lag_ms})
    subjects = {report.subject for report in HealthConditions(0).reports(message)}
    assert ("device ins" in subjects) is is_assessed


def test_a_device_of_which_a_fresh_navigation_knows_nothing_yet_is_not_assessed() -> None:
    conditions = HealthConditions(0)
    found(conditions, health())
    unknown = {"ins": {"link": "line", "state": "silent", "hint": "", "is_known": False}}
    assert found(conditions, health(devices=unknown)) == {}


def test_a_link_with_bytes_is_not_silent_because_its_device_is() -> None:
    conditions = HealthConditions(0)
    found(conditions, health())
    merged = {"line": {**link("silent")["line"], "port_state": "good"}}
    assert list(found(conditions, health(links=merged, devices=device("silent")))) == ["device:ins"]


@pytest.mark.parametrize("state", ["silent", "absent", "denied", "busy"])
def test_a_link_without_bytes_explains_its_devices(state: str) -> None:
    conditions = HealthConditions(0)
    found(conditions, health())
    message = health(links=link(state), devices=device("silent"))
    assert found(conditions, message) == {"link:line": ("caution", "why"), "device:ins": ("caution", "why")}
    reports = [report.condition for report in conditions.reports(message)]
    (of_device,) = [condition for condition in reports if condition and condition.id == "device:ins"]
    assert "link:line" in of_device.explained_by


def test_a_rate_is_wrong_when_it_has_been_counted() -> None:
    """A device that has just come back has too few messages in the last seconds."""
    conditions = HealthConditions(0)

    def names(t_s: float, state: str) -> list[str]:
        return list(found(conditions, health(t_s, devices=device(state))))

    assert [names(t_s, "wrong rate") for t_s in (100.0, 102.0, 104.5)] == [[], [], []]
    assert names(105.0, "wrong rate") == ["device:ins"]
    assert names(106.0, "good") == []
    assert names(107.0, "wrong rate") == []
    assert names(108.0, "silent") == ["device:ins"]
    assert names(109.0, "wrong rate") == []


@pytest.mark.parametrize("state", ["noise", "invalid"])
def test_a_device_that_is_not_understood(state: str) -> None:
    message = health(links=link(state), devices=device(state))
    assert found(HealthConditions(0), message) == {"device:ins": ("caution", "why")}


def test_a_device_that_is_not_switched_on_yet_is_expected_for_a_while() -> None:
    begin_s = 100.0
    conditions = HealthConditions(round(begin_s * SECOND_NS))
    silent: dict[str, Any] = {"links": link("absent"), "devices": device("silent")}
    assert found(conditions, health(begin_s + 1.0, **silent)) == {}
    assert set(found(conditions, health(begin_s + START_NS / SECOND_NS, **silent))) == {"link:line", "device:ins"}
    assert found(conditions, health(begin_s + 20.0)) == {}
    assert set(found(conditions, health(begin_s + 21.0, **silent))) == {"link:line", "device:ins"}, "it was good before"
    conditions.start_new_flight(round((begin_s + 22.0) * SECOND_NS))
    assert found(conditions, health(begin_s + 23.0, **silent)) == {}, "another flight begins"


def test_devices_that_somebody_has_yet_to_switch_on_are_no_alarm() -> None:
    """On a new machine an emulator compiles first; and behind a flight its devices fall silent one after the other."""
    conditions = HealthConditions(0)
    silent: dict[str, Any] = {"links": link("absent"), "devices": device("silent")}
    assert found(conditions, health(1.0)) == {}
    conditions.suppress_device_alarms()
    assert found(conditions, health(100.0, **silent)) == {}
    conditions.start_new_flight(100 * SECOND_NS)  # as a person does by `fti readmit --all`
    assert found(conditions, health(120.0, **silent)) == {}
    conditions.resume_device_alarms(101 * SECOND_NS)
    assert found(conditions, health(110.9, **silent)) == {}
    assert set(found(conditions, health(111.1, **silent))) == {"link:line", "device:ins"}


def test_no_device_is_assessed_while_navigation_is_silent() -> None:
    """Frames arrive; the cable is not the reason."""
    conditions = HealthConditions(0)
    message = health(devices=device("silent"), navigation={"lag_ms": 5000.0, "hint": "it has said nothing for 5 s"})
    assert "device ins" not in {report.subject for report in conditions.reports(message)}


def test_the_end_of_a_session_is_no_alarm() -> None:
    ended: dict[str, Any] = {"processes": {"recorder": {"state": "stopped"}, "navigation": {"state": "stopped"}}}
    assert found(HealthConditions(0), health(session={"state": "stopping"}, links=link("silent"), **ended)) == {}


@pytest.mark.parametrize(("rate_mb_s", "expected"), [(1.0, {"space"}), (0.1, set()), (-1.0, set())])
def test_space_for_less_than_an_hour(rate_mb_s: float, expected: set[str]) -> None:
    """1000 MB are 1000 s at 1 MB/s, and 10,000 s at 0.1 MB/s."""
    conditions, names = HealthConditions(0), set[str]()
    for k in range(41):
        storage = {"state": "ok", "free_mb": 1000.0 - 0.5 * k * rate_mb_s}
        names |= set(found(conditions, health(100.0 + 0.5 * k, storage=storage)))
    assert names == expected


def test_the_forecast_has_the_remaining_time() -> None:
    conditions = HealthConditions(0)
    for k in range(41):
        storage = {"state": "ok", "free_mb": 1000.0 - 0.5 * k}
        reports = list(conditions.reports(health(100.0 + 0.5 * k, storage=storage)))
    (space,) = [report.condition for report in reports if report.condition]
    assert space.value == pytest.approx(980.0)
    assert space.cause == "980 MB are free, 1.00 MB/s are used"


def test_terrain_that_is_loading() -> None:
    message = health(navigation={"is_terrain_loading": True})
    assert {name: severity for name, (severity, _) in found(HealthConditions(0), message).items()} == {
        "terrain_loading": "advisory"
    }


def test_losses_name_the_link_and_how_many_since_the_last_time() -> None:
    before, after = health(links=link("good", dropped_frames=5)), health(links=link("good", dropped_frames=17))
    (lost,) = find_losses(before, after)
    assert (lost.id, lost.cause, lost.value) == ("losses", "frames were dropped: 12 on line", 12.0)
    assert list(find_losses(after, after)) == []
    (refused,) = find_losses(before, health(links=link("good", dropped_frames=5, stamp_refused=1)))
    assert refused.id == "stamps"


def test_a_recorder_that_counts_anew_has_lost_nothing() -> None:
    assert list(find_losses(health(links=link("good", dropped_frames=5)), health())) == []
