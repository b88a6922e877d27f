"""``fti preflight``: each item is NO-GO for its own reason alone.  The state is that of a demonstration in flight."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fti import config as configuration
from fti.cli._go_items import GoItem, go_items
from fti.config import Config
from tests.helpers import ROOT

STATE = ROOT / "tests" / "cli" / "live_state.json"
MEGABYTE = 1_000_000

State = dict[str, Any]


@pytest.fixture
def config() -> Config:
    return configuration.load(ROOT / "configs" / "demo.toml")


@pytest.fixture
def state(tmp_path: Path) -> State:
    """The session folder holds 7.2 MB, written in the 72 s since the session began."""
    found: State = json.loads(STATE.read_text())
    session = found["health"]["session"]
    session["folder"] = str(tmp_path)
    session["started_ns"] = found["health"]["t_ns"] - 72_000_000_000
    with (tmp_path / "demo_000.mcap").open("wb") as file:
        os.truncate(file.fileno(), round(7.2 * MEGABYTE))
    found["health"]["storage"]["free_mb"] = 500.0 + 5 * 360.0 * MEGABYTE / 2**20  # min_free_mb stay free; in 2^20 B
    return found


def no_go(config: Config, state: State, hours: float = 4.0) -> list[GoItem]:
    return [item for item in go_items(config, state, hours) if not item.is_go]


def test_a_sound_daemon_is_go(config: Config, state: State) -> None:
    names = [item.name for item in go_items(config, state, 4.0)]
    assert no_go(config, state) == []
    assert {"recording", "disk", "terrain", "approach reference", "alarms"} < {*names}
    assert len([name for name in names if name.startswith(("link ", "device "))]) == 14


def test_the_hours_are_those_of_the_disk_at_the_present_rate(config: Config, state: State) -> None:
    """0.1 MB/s are 360 MB/h."""
    assert no_go(config, state, 4.99) == []
    (disk,) = no_go(config, state, 5.01)
    assert disk.text == "5 h left at 100 kB/s; 5.01 h needed"


CHANGES: dict[str, tuple[Callable[[State], object], str, str]] = {
    "storage": (lambda s: s["health"]["session"].update(state="storage_error"), "recording", "storage_error: "),
    "free space": (lambda s: s["health"]["storage"].update(free_mb=None), "disk", "free space is unknown"),
    "noise on a link": (
        lambda s: s["health"]["links"]["ins_eth"].update(state="noise", hint="wrong cable?"),
        "link ins_eth",
        "wrong cable?",
    ),
    "another configuration": (
        lambda s: s["health"]["links"].pop("pdu_line"),
        "link pdu_line",
        "the daemon has no such",
    ),
    "a full disk": (
        lambda s: s["health"]["storage"].update(free_mb=20.0),
        "disk",
        "20 MB free, less than session.min_free_mb = 500",
    ),
    "an altimeter that never sent": (
        lambda s: s["outputs"]["/nav/height_above_ground/altimeter"].update(
            valid=False, reasons=["silent"], reasons_text=["never heard"]
        ),
        "altimeter altimeter",
        "never heard",
    ),
    "a device": (
        lambda s: s["health"]["devices"]["gnss"].update(state="wrong rate", hint="1 Hz"),
        "device gnss",
        "1 Hz",
    ),
    "a used clock": (
        lambda s: s["health"]["devices"]["ahrs"]["clocks"].append(
            {**s["health"]["devices"]["ins"]["clocks"][0], "state": "learning"}
        ),
        "device ahrs",
        "gps clock: learning",
    ),
    "position": (
        lambda s: s["outputs"]["/nav/nav_solution"].update(valid=False, reasons_text=["no position"]),
        "position",
        "no position; none is valid of ins, gnss, autopilot, ahrs",
    ),
    "attitude": (
        lambda s: s["outputs"]["/nav/nav_solution"].update(attitude_valid=False, attitude_reasons_text=["late"]),
        "attitude",
        "late",
    ),
    "an altimeter": (
        lambda s: s["outputs"].pop("/nav/height_above_ground/altimeter"),
        "altimeter altimeter",
        "no heights",
    ),
    "a late altimeter": (
        lambda s: s["outputs"]["/nav/height_above_ground/altimeter"].update(late=True, valid=False, age_ms=3000.0),
        "altimeter altimeter",
        "no valid height: late, the last value is 3.0 s old",
    ),
    "terrain that is loaded": (
        lambda s: s["health"]["navigation"].update(terrain="loading, 40 %", is_terrain_loading=True),
        "terrain",
        "loading, 40 %; wait",
    ),
    "navigation that is compiled": (
        lambda s: s["health"]["processes"]["navigation"].update(state="starting"),
        "navigation",
        "being compiled or loaded; wait",
    ),
    "terrain": (lambda s: s["health"]["navigation"].update(terrain=None), "terrain", "not loaded"),
    "an alarm": (lambda s: s["alarms"][0].update(end_ns=None), "alarms", "NAVIGATION LATE"),
    "an alarm not acknowledged": (lambda s: s["alarms"][0].update(is_acknowledged=False), "alarms", "NAVIGATION LATE"),
}


@pytest.mark.parametrize(("change", "name", "begin"), CHANGES.values(), ids=CHANGES)
def test_each_problem_is_one_item(
    config: Config, state: State, change: Callable[[State], object], name: str, begin: str
) -> None:
    devices = tuple(device.model_copy(update={"use_device_time": True}) for device in config.device)
    change(state)
    (item,) = no_go(config.model_copy(update={"device": devices}), state)
    assert item.name == name
    assert item.text.startswith(begin)


def test_a_link_without_bytes_is_the_reason_of_its_devices(config: Config, state: State) -> None:
    state["health"]["links"]["ins_eth"].update(state="absent", hint="no such port")
    state["health"]["devices"]["ins"].update(state="silent", hint="is the cable in?")
    assert [(item.name, item.text) for item in no_go(config, state)] == [
        ("link ins_eth", "no such port"),
        ("device ins", "link ins_eth is absent"),
    ]


def test_a_reference_for_another_altimeter_is_no_go(config: Config, state: State) -> None:
    altimeters = {d.name: d.altimeter.model_copy(update={"beam_deg": 12.0}) for d in config.device if d.altimeter}
    devices = tuple(d.model_copy(update={"altimeter": altimeters.get(d.name)}) for d in config.device)
    (item,) = no_go(config.model_copy(update={"device": devices}), state)
    assert (item.name, item.text) == ("approach reference", "assumption")


def test_on_the_ground_an_altimeter_below_its_range_is_go(config: Config, state: State) -> None:
    height = state["outputs"]["/nav/height_above_ground/altimeter"]
    height.update(valid=False, reasons_text=["below range"])
    assert no_go(config, state) == []
    height.update(late=True)
    assert [item.name for item in no_go(config, state)] == ["altimeter altimeter"]
