"""``fti watch``: one JSON object for scripts, tables for a person."""

import io
import json
import math
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from fti.alarms.alarm_list import AlarmList
from fti.alarms.condition import Condition, ConditionReport, Severity
from fti.bus.frame import SOCKET_NAME
from fti.cli._watch_view import render
from fti.cli.main import main
from fti.web.live_state import LiveState
from tests.alarm_cases import CASES, Case, daemon_with
from tests.run_dirs import running_daemon
from tests.web.fake_daemon import SESSION, FakeDaemon, make_clock, make_health, make_laboratory, make_sinks


@pytest.fixture
def daemon() -> Iterator[FakeDaemon]:
    with tempfile.TemporaryDirectory(prefix="fti-") as runtime:  # short, for a socket
        path = Path(runtime) / "fti" / "demo"
        path.mkdir(parents=True, mode=0o700)
        fake = FakeDaemon(60.0, path / SOCKET_NAME)
        fake.start()
        yield fake
        fake.close()


@pytest.fixture
def run_dir(daemon: FakeDaemon) -> Iterator[Path]:
    with running_daemon(daemon.hub.path.parent, SESSION) as directory:
        yield directory.path


def test_once_json_is_one_object(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["watch", "--run-dir", str(run_dir), "--once", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["health"]["session"]["name"] == SESSION
    assert content["outputs"]["/nav/height_above_ground/radar_altimeter"]["valid"] is True
    assert {"/nav/clearance_integrity", "/nav/glide_slope", "/nav/nav_solution"} < set(content["outputs"])
    assert content["alarms"] == []


def test_a_name_finds_it_too(
    run_dir: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(run_dir.parent.parent))
    assert main(["watch", "--name", run_dir.name, "--once"]) == 0
    assert "radar_altimeter" in capsys.readouterr().out


def test_a_stopped_navigation_is_in_the_json(
    daemon: FakeDaemon, run_dir: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    daemon.change_health = lambda health: health["processes"]["navigation"].update(state="restarting")
    main(["watch", "--run-dir", str(run_dir), "--once", "--json"])
    content = json.loads(capsys.readouterr().out)
    assert [alarm["id"] for alarm in content["alarms"]] == ["navigation"]
    assert all(output["late"] and not output["valid"] for output in content["outputs"].values())


def test_without_a_daemon_or_a_bus_it_reports_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["watch", "--run-dir", str(tmp_path), "--once"]) == 2
    assert "no daemon is running there" in capsys.readouterr().err
    with running_daemon(tmp_path):
        assert main(["watch", "--run-dir", str(tmp_path), "--once"]) == 2
    assert "no bus of this user found" in capsys.readouterr().err


def test_json_goes_on_until_interrupted(run_dir: Path) -> None:
    command = [sys.executable, "-m", "fti.cli.main", "watch", "--run-dir", str(run_dir), "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        times = [json.loads(process.stdout.readline())["health"]["t_ns"] for _ in range(2)]
        process.send_signal(signal.SIGINT)
    assert times[0] < times[1]
    assert process.returncode == 130


# ------------------------------------------------------------------------------------------------------ the tables


def rendered(live: LiveState, now_ns: int) -> str:
    console = Console(width=140, force_terminal=True, color_system="standard", file=io.StringIO(), record=True)
    console.print(render(live.state(now_ns)))
    return console.export_text(styles=True)


def plain(live: LiveState) -> str:
    console = Console(width=200, file=io.StringIO(), record=True)
    console.print(render(live.state(0)))
    return console.export_text()


def make_live_state(**height: Any) -> LiveState:
    live = LiveState(0)
    fields: dict[str, Any] = {"t_ns": 0, "raw": 123.0, "height_agl": 120.04, "sd": 0.5, "valid": True, "reasons": []}
    live.update("/nav/height_above_ground/ra", fields | height, 0)
    live.update("/health", make_health(10.0, 0, 0), 0)
    return live


def test_a_provisional_filter_is_shown_struck_out_until_it_is_late() -> None:
    live = make_live_state()
    fields = {"distance": 103.8, "height_difference": -1.2, "horizontal_sd": 1.8, "hpl": 154.4, "quantities": []}
    status = {"t_ns": 0, "valid": False, "reasons": ["unconfirmed"], "readmission": "", "max_age_ms": 500.0}
    live.update("/nav/provisional_solution/gnss", fields | status, 0)
    text = rendered(live, 0)
    for words in ("gnss, provisional", "\x1b[9;90m104 m off, height -1 m", "HPL 154 m", "not confirmed after a fault"):
        assert words in text
    assert "provisional" not in rendered(live, 600_000_000)


def test_the_drift_over_the_ground_is_shown_with_its_refused_pairs() -> None:
    live = make_live_state()
    fields = {"north": 0.3, "east": -0.4, "north_sd": 0.04, "east_sd": 0.06, "overlap": 0.48, "pairs": 41, "refused": 8}
    status = {"t_ns": 0, "valid": True, "reasons": [], "max_age_ms": 500.0}
    live.update("/nav/ground_drift", fields | status, 0)
    text = rendered(live, 0)
    for words in ("drift over the ground", "0.50 m", "± 0.06 m", "overlap 48 %, 8 of 41 pairs refused"):
        assert words in text
    missing = dict.fromkeys(fields) | {"valid": False, "reasons": ["not_calibrated"]}
    live.update("/nav/ground_drift", fields | status | missing, 0)
    assert "not calibrated with satellites yet" in rendered(live, 0)


def test_values_links_and_origin_are_shown() -> None:
    text = rendered(make_live_state(), 0)
    for words in ("HIL", "recording", "120.0 m", "± 0.50 m", "raw 123.0 m", "gnss_line", "/dev/ttyUSB3 does not exist"):
        assert words in text
    assert "outputs p50 9, p99 17 ms" in text
    assert STRUCK_OUT not in text


def test_sinks_are_shown_with_their_failures_and_losses() -> None:
    live, health = make_live_state(), make_health(10.0, 0, 0)
    assert "outputs to" not in rendered(live, 0)
    live.update("/health", {**health, "sinks": make_sinks()}, 0)
    lines = {line.split()[0]: line.split() for line in plain(live).splitlines() if line.strip()}
    assert lines["mqtt"][1:5] == ["retrying", "41,234", "12,034", "17"]
    assert " ".join(lines["mqtt"][5:]).startswith("publish.mqtt: ground.example.org:8883")
    assert lines["foxglove"][1:] == ["connected", "2", "41,234", "0", "0"]


def test_what_a_controller_has_counted_is_shown_beside_the_hint() -> None:
    live, health = make_live_state(), make_health(10.0, 0, 0)
    health["links"]["airdata_can"]["ledger"] = {"errors": {"slcan_data_overrun": 2, "slcan_bus_error": 0}}
    health["links"]["gnss_line"]["ledger"] = {"errors": {"uart_overrun": 3}}
    live.update("/health", health, 0)
    text = plain(live)
    assert "slcan_data_overrun 2" in text
    assert "slcan_bus_error" not in text
    assert "/dev/ttyUSB3 does not exist; there are ttyUSB0, ttyUSB1  uart_overrun 3" in text


def test_what_the_terrain_reports_of_a_height_is_shown_or_why_it_is_unknown() -> None:
    known = {"predicted": 122.4, "nearest": 118.26, "nearest_sd": 0.8, "compensation": "beam", "unchecked": []}
    text = rendered(make_live_state(**known), 0)
    for words in ("nearest return", "118.3 m", "± 0.80 m", "predicts 122.4 m", "beam"):
        assert words in text
    assert "beam, too uncertain to compare" in rendered(make_live_state(**{**known, "unchecked": ["uncertain"]}), 0)
    unknown = {**dict.fromkeys(known), "unchecked": ["terrain_edge"]}
    text = rendered(make_live_state(**unknown), 0)
    assert "beyond the terrain" in text
    assert "predicts" not in text


def test_what_takes_the_place_of_devices_is_shown_with_its_mode() -> None:
    live = make_live_state()
    fields = {"t_ns": 0, "valid": True, "reasons": ["coasting"], "mode": "coasting", "alt": 431.2, "vertical_sd": 2.5}
    live.update("/nav/filter_solution", fields, 0)
    text = rendered(live, 0)
    for words in ("filter", "431.2 m", "± 2.50 m", "coasting", "inertial alone"):
        assert words in text


def test_the_sources_of_navigation_are_shown_with_their_sigmas_and_nothing_known_is_struck_out() -> None:
    live = make_live_state()
    sources = {"position_source": "radio", "altitude_source": "radio", "attitude_source": "ahrs"}
    numbers = {"alt": 431.2, "horizontal_sd": 222.0, "vertical_sd": 2.5, "hpl": 1066.0, "vpl": 11.05}
    numbers |= {"tilt_pl": math.radians(0.42), "heading_pl": math.radians(6.4)}
    fields = {"t_ns": 0, "valid": False, "reasons": ["no_velocity"], **sources, **numbers}
    live.update("/nav/nav_solution", fields, 0)
    text = rendered(live, 0)
    for words in ("position", "from radio", "from ahrs", "431.2 m", "± 222.00 m", "no velocity"):
        assert words in text
    assert "HPL 1066 m" in text
    assert "VPL 11 m" in text
    assert "from ahrs, tilt PL 0.4°, heading PL 6.4°" in text
    assert "\x1b[9;90m431.2 m" not in text


STRUCK_OUT = "\x1b[9;90m120.0 m"


def test_stale_and_invalid_values_are_struck_out_with_the_reason() -> None:
    stale = rendered(make_live_state(), 1_500_000_000)
    assert STRUCK_OUT in stale
    assert "STALE 1.5 s" in stale
    invalid = rendered(make_live_state(valid=False, reasons=["roll"]), 0)
    assert STRUCK_OUT in invalid
    assert "roll limit" in invalid


def test_alarms_are_shown_with_their_times_and_whether_somebody_has_seen_them() -> None:
    alarms, live = AlarmList(), make_live_state()
    link = Condition("link:a", Severity.CAUTION, "LINK A SILENT", "is the device on?")
    alert = Condition("integrity_alert", Severity.WARNING, "GROUND CLEARANCE ALERT", "obstacle")
    for t_s, condition in ((1, link), (2, alert)):
        alarms.report(ConditionReport(t_s * 10**9, condition.id, condition))
    alarms.report(ConditionReport(4 * 10**9, alert.id, None))
    alarms.report(
        ConditionReport(5 * 10**9, "device", Condition("device:a", Severity.CAUTION, "A", explained_by=("link:a",)))
    )
    live.update("/alarms", {"t_ns": 0, "alarms": alarms.rows()}, 0)
    text = rendered(live, 0)
    assert "GROUND CLEARANCE ALERT – obstacle – 00:00:02, ended after 2.0 s" in text
    assert "LINK A SILENT (+1) – is the device on? – since 00:00:01" in text
    assert "fti acknowledge" in text
    alarms.acknowledge("anna", 6 * 10**9)
    live.update("/alarms", {"t_ns": 0, "alarms": alarms.rows()}, 0)
    text = rendered(live, 0)
    assert "since 00:00:01, acknowledged by anna" in text
    assert "GROUND" not in text
    assert "fti acknowledge" not in text


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.title.lower().replace(" ", "-"))
def test_every_alarm_is_shown_until_it_has_ended_and_was_acknowledged(case: Case) -> None:
    daemon, live = daemon_with(case), make_live_state()

    def shown() -> str:
        live.update("/alarms", {"t_ns": 0, "alarms": daemon.rows}, 0)
        return rendered(live, 0)

    assert case.title in shown()
    assert ("since" in shown()) is not case.is_moment
    if case.ends:
        case.ends(daemon)
    assert (case.title in shown()) is case.is_latched
    assert ("ended after" in shown()) is case.is_latched
    daemon.board.acknowledge("anna", None)
    assert case.title not in shown()


def test_a_snapshot_session_is_reported() -> None:
    live, health = make_live_state(), make_health(10.0, 0, 0)
    health["session"]["mode"] = "snapshot"
    live.update("/health", health, 0)
    text = rendered(live, 0)
    assert "SNAPSHOT: only data around a trigger are recorded" in text
    assert "SNAPSHOT" not in rendered(make_live_state(), 0)


def test_the_clocks_of_devices_are_shown_as_far_as_they_are_known() -> None:
    live, health = make_live_state(), make_health(10.0, 0, 0)
    on_ms = 1_775_986_267_125.0  # 2026-04-12 09:31:07.125 UTC
    health["devices"]["air_data"]["clocks"] = [make_clock("utc", 1.5, used=False), make_clock("boot", -on_ms)]
    health["devices"]["gnss"]["clocks"] = [make_clock("utc", 1.0, state="away")]
    live.update("/health", health, 0)
    text = " ".join(rendered(live, 0).split())
    for words in ("-213.46 ± 0.04 ms", "+1.10 ± 0.02 ppm", "1.2 %", "not used", "on at 09:31:07.125", "does not fit"):
        assert words in text
    for device in health["devices"].values():
        device.pop("clocks", None)
    live.update("/health", health, 0)
    assert "clock of" not in rendered(live, 0)


def test_before_the_first_health_there_is_a_picture() -> None:
    assert "–" in rendered(LiveState(0), 0)


def test_what_plays_the_sensors_is_reported_and_struck_out_when_it_is_silent() -> None:
    live = make_live_state()
    assert "LABORATORY" not in rendered(live, 0)
    laboratory = make_laboratory(75.0, gnss="tripped", arinc="brown_out") | {"age_ms": 0.0, "max_age_ms": 1500.0}
    live.update("/hil", laboratory | {"holds": False, "not_held": ["ins: late"]}, 0)
    text = rendered(live, 0)
    for words in (
        "Fog over the threshold, 75 s of 240 s",
        "late p50 0.1, p99 0.9 ms",
        "rates of 1 devices not held",
        "arinc BROWN OUT; gnss TRIPPED; laser_altimeter: fog, 75 m until 96 s",
    ):
        assert words in text
    assert "\x1b[9;90m   arinc" not in text
    silent = rendered(live, 4_000_000_000)
    assert "SILENT for 4 s" in silent
    assert "\x1b[9;90m   arinc" in silent
