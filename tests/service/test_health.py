"""The state of a link: the state of the port has priority, then that of its best device."""

from typing import Any

import pytest

from fti.service.supervisor.health import LATE_NS, HealthBoard, merge_link


def _device(state: str, hint: str = "") -> dict[str, Any]:
    return {"link": "a", "state": state, "hint": hint}


@pytest.mark.parametrize(
    ("port", "devices", "expected"),
    [
        ("absent", {"d": _device("good")}, "absent"),
        ("silent", {"d": _device("noise")}, "silent"),
        ("good", {}, "good"),
        ("good", {"d": _device("noise", "baud?")}, "noise"),
        ("good", {"d": _device("silent"), "e": _device("good")}, "good"),
        ("good", {"d": _device("invalid"), "e": _device("noise")}, "invalid"),
        ("good", {"d": {**_device("noise"), "link": "other"}}, "good"),
    ],
)
def test_state(port: str, devices: dict[str, dict[str, Any]], expected: str) -> None:
    assert merge_link("a", {"state": port, "hint": ""}, devices)["state"] == expected


def test_the_hint_names_the_device() -> None:
    assert merge_link("a", {"state": "good", "hint": ""}, {"d": _device("noise", "baud?")})["hint"] == "d: baud?"


@pytest.mark.parametrize(
    ("session", "storage", "expected"),
    [
        ("recording", "opening", "waiting"),
        ("stopping", "opening", "stopping"),
        ("recording", "error", "storage_error"),
        ("stopping", "error", "storage_error"),
        ("recording", "fallback", "recording"),
    ],
)
def test_the_session_is_recorded_where_the_storage_takes_bytes(session: str, storage: str, expected: str) -> None:
    board = HealthBoard({"state": session}, {"t_ns": 0, "storage": {"state": storage, "hint": ""}})
    assert board.compose(0, [])["session"]["state"] == expected


def test_an_old_report_of_the_recorder_is_not_valid() -> None:
    link = {"state": "good", "hint": "", "rate_hz": 100.0, "frames": 7}
    report = {"t_ns": 0, "storage": {"state": "ok", "hint": ""}, "links": {"eth": link}}
    board = HealthBoard({"state": "recording"}, report)
    assert board.compose(LATE_NS, [])["session"]["state"] == "recording"
    assert board.compose(LATE_NS, [])["links"] == {"eth": {**link, "port_state": "good"}}
    late = board.compose(LATE_NS + 1, [])
    assert late["session"]["state"] == "storage_error"
    assert "no report from" in late["storage"]["hint"]
    eth = late["links"]["eth"]
    assert (eth["state"], eth["rate_hz"], eth["frames"]) == ("silent", 0.0, 7)
    assert "no report from" in eth["hint"]


def test_an_old_report_of_navigation_is_not_valid() -> None:
    link, device = {"state": "good", "hint": ""}, _device("noise")
    delay = {"p50_ms": 8.0, "p99_ms": 15.0, "max_ms": 21.0}
    report = {"navigation": {"lag_ms": 20.0, "output_delay": delay}, "devices": {"d": device}}
    board = HealthBoard({"state": "recording"}, {"links": {"a": link}}, report)
    now = board.compose(0, [])
    assert (now["navigation"]["lag_ms"], now["devices"]["d"]["state"], now["links"]["a"]["state"]) == (
        20,
        "noise",
        "noise",
    )
    late = board.compose(LATE_NS + 10**9, [])
    assert now["navigation"]["output_delay"] == delay
    assert late["navigation"]["lag_ms"] == 20 + LATE_NS / 1e6 + 1000
    assert late["navigation"]["output_delay"] is None
    assert late["devices"]["d"]["state"] == "silent"
    assert "no report from" in late["devices"]["d"]["hint"]
    assert board.compose(2 * LATE_NS, [])["devices"]["d"]["hint"] == late["devices"]["d"]["hint"]  # it does not change
    assert late["links"]["a"]["state"] == "good"  # its bytes still come
    board.navigation = dict(report)
    assert board.compose(LATE_NS + 2 * 10**9, [])["navigation"]["lag_ms"] == 20


def test_an_old_report_of_the_publish_process_is_not_valid() -> None:
    sink = {"state": "connected", "hint": "", "peers": 2, "sent": 7}
    board = HealthBoard({"state": "recording"})
    assert "sinks" not in board.compose(0, [])
    board.sinks = {"mqtt": sink}
    assert board.compose(0, [])["sinks"] == board.compose(LATE_NS, [])["sinks"] == {"mqtt": sink}
    late = board.compose(LATE_NS + 1, [])["sinks"]["mqtt"]
    assert (late["state"], late["peers"], late["sent"]) == ("silent", None, 7)
    assert late["hint"] == "no report from publish for more than 3 s"
    board.sinks = {"mqtt": dict(sink)}
    assert board.compose(LATE_NS + 2, [])["sinks"] == {"mqtt": sink}
