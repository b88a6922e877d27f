"""Scenarios of wrong sources: each can be flown, and the score says of its outputs what is true.

The verdict must agree with the errors that this file computes from the recorded messages and the truth, on a sphere and
in degrees.  Of the shipped scenarios the receiver must be refused, and the score must hold; of those in
configs/scenarios/source_faults the daemon does not detect each one.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from fti.hil import offline_run
from fti.hil import scenario as scenarios
from fti.hil.oracle.scenario_check import check_scenario
from fti.hil.oracle.truth_checked_faults import SourceFault
from fti.hil.tables.fault_base import DeviceFault
from fti.logger.reading.recording import Recording
from fti.post.score.outcome import FlightOutcome
from fti.post.score.outputs.row import OutputCheck
from fti.post.score.rows import Verdict
from fti.post.score.session_score import judge_session
from tests.helpers import ROOT

pytestmark = pytest.mark.timeout(900)
FOLDER = ROOT / "configs" / "scenarios" / "source_faults"
NAMES = sorted(file.stem for file in FOLDER.glob("*.toml"))
#: Shipped, and held.
DETECTED = (
    "attitude_offset", "clock_step", "gnss_frozen", "gnss_ramp", "gnss_spoofed", "gnss_step", "swapped_coordinates",
    "undulation",
)  # fmt: skip
#: Flown in quick tests: each 15 s of its fault; at full scale all of them.
QUICK = ("gnss_ramp_without_velocity", "inertial_bias")
SOLUTION = "/nav/nav_solution"
END_S, EARTH_M, SECOND_NS = 40.0, 6.371e6, 1_000_000_000
#: [limits] as they are by default: horizontal [m], roll, pitch and heading [deg]; or the protection level, ten sigmas.
LIMITS = {"horizontal": 20.0, "roll": 2.0, "pitch": 2.0, "heading": 4.0}
STATED = {"roll": "tilt_sd", "pitch": "tilt_sd", "heading": "heading_sd"}
#: Attitudes are compared five times a second.
COMPARED_S = 0.5
#: So close to the limit the two computations may differ.
CLOSE = 0.02


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "flown" in metafunc.fixturenames:
        is_quick = metafunc.config.getoption("--scale") == "quick"
        metafunc.parametrize("flown", QUICK if is_quick else NAMES)


def test_every_fault_of_a_source_has_a_scenario() -> None:
    paths = [*(FOLDER / f"{name}.toml" for name in NAMES), *map(scenarios.find, DETECTED)]
    assert {fault.kind for path in paths for fault in scenarios.load(path).fault} - {"gnss_outage"} == {
        "attitude_offset", "clock_jump", "gnss_offset", "gnss_ramp", "inertial_bias", "latency", "lever_arm", "scale",
        "stuck", "swapped_coordinates", "terrain_shift", "undulation",
    }  # fmt: skip
    assert set(DETECTED) <= set(scenarios.shipped_names())


@pytest.mark.parametrize("name", NAMES)
def test_each_can_be_flown(name: str) -> None:
    scenario = scenarios.load(FOLDER / f"{name}.toml")
    assert check_scenario(scenario, scenarios.load_config(scenario)).warnings == ()
    assert isinstance(scenario.fault[0], SourceFault)


@pytest.mark.parametrize("name", DETECTED)
def test_a_lying_source_is_refused_and_announced_and_no_valid_output_is_wrong(name: str, tmp_path: Path) -> None:
    scenario = scenarios.load(scenarios.find(name))
    session = offline_run.fly(scenarios.load_config(scenario), scenario, tmp_path)
    recording = Recording.open(session)
    (score,) = judge_session(recording, scenario, recording.truth_files, None)
    assert score.outcome is FlightOutcome.HOLDS, [row for row in score.rows if row.verdict is not Verdict.FOUND]
    fault = scenario.fault[0]
    assert isinstance(fault, DeviceFault)
    (device,) = fault.devices
    refusals = [row for row in score.rows if row.flag.startswith(SOLUTION) and row.flag.endswith(f"not from {device}")]
    (refused,) = refusals
    assert refused.verdict is Verdict.FOUND
    assert refused.within_s is not None
    event_texts = [f"{row['name']}: {row['message']}" for row in events(recording)]
    assert any("refused" in text and text.removeprefix("nav: ").startswith(f"{device}:") for text in event_texts)
    # A wrong attitude is valid until its refusal is due; a position never is beyond its protection level.
    shares = worst_shares(recording, fault.from_s + refused.within_s)
    assert shares
    assert max(shares.values()) <= 1.0 + CLOSE
    assert levels_hold(recording, fault.from_s)
    assert tilt_levels_hold(recording, fault.from_s + COMPARED_S)


def events(recording: Recording) -> list[dict[str, Any]]:
    """What the event log says."""
    return [json.loads(data) for *_, data in recording.messages("/fti/event", kind="derived")]


def levels_hold(recording: Recording, from_s: float) -> bool:
    """Whether each valid solution is within its protection level of the true position."""
    truth, valid = true_and_valid(recording, from_s)
    return all(_error("horizontal", row, _true_place(truth, row)) <= row["hpl"] for row in valid)


def tilt_levels_hold(recording: Recording, from_s: float) -> bool:
    """Whether roll and pitch together are within their protection level, and 2 deg, in each valid solution."""
    truth, valid = true_and_valid(recording, from_s)
    for row in valid:
        true = _true_place(truth, row)
        tilt = math.hypot(_error("roll", row, true), _error("pitch", row, true))
        if tilt > min(math.degrees(row["tilt_pl"]), LIMITS["roll"]):
            return False
    return bool(valid)


def test_the_score_reports_what_is_true_of_the_outputs(flown: str, tmp_path: Path) -> None:
    scenario = scenarios.load(FOLDER / f"{flown}.toml")
    session = offline_run.fly(scenarios.load_config(scenario), scenario, tmp_path, until_s=END_S)
    recording = Recording.open(session)
    (score,) = judge_session(recording, scenario, recording.truth_files, None)
    assert stated_faults(recording)[0] == json.loads(scenario.flight_key)["fault"][0]
    assert {row.verdict for row in score.rows if row.fault == 0} <= {Verdict.COMPARED, Verdict.FOUND}
    rows = {
        row.what: row.verdict for row in score.outputs if (row.topic, row.check) == (SOLUTION, OutputCheck.FAULT_ERROR)
    }
    from_s = getattr(scenario.fault[0], "from_s", math.inf)
    for quantity, share in worst_shares(recording, from_s).items():
        if abs(share - 1.0) > CLOSE:
            assert rows[quantity] is (Verdict.FAILS if share > 1.0 else Verdict.HOLDS), quantity


def stated_faults(recording: Recording) -> list[dict[str, Any]]:
    """The faults that the truth file states."""
    (truth_file,) = recording.truth_files
    with truth_file.open("rb") as stream:
        (flown,) = (one for one in make_reader(stream).iter_attachments() if one.name == "scenario.json")
    return list(json.loads(flown.data)["fault"])


def true_and_valid(recording: Recording, from_s: float) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The rows of the truth, and the valid solutions from a time of the flight [s] on."""
    (truth_file,) = recording.truth_files
    truth = [json.loads(data) for *_, data in Recording.open(truth_file).messages("/truth/state", kind="truth")]
    begin_ns = truth[0]["t_ns"]
    found = [json.loads(data) for *_, data in recording.messages(SOLUTION)]
    return truth, [row for row in found if row["valid"] and row["t_ns"] >= begin_ns + from_s * SECOND_NS]


def worst_shares(recording: Recording, from_s: float) -> dict[str, float]:
    """The largest error against what is allowed, of the valid solutions from a time of the flight [s] on."""
    truth, valid = true_and_valid(recording, from_s)
    worst = dict.fromkeys(LIMITS, 0.0) if valid else {}
    for row in valid:
        true = _true_place(truth, row)
        true["heading"] = min(truth, key=lambda one: abs(one["t_ns"] - row["t_valid_ns"]))["heading"]
        for quantity, limit in LIMITS.items():
            sd = math.degrees(row.get(STATED.get(quantity, "")) or 0.0)
            allowed = max(limit, row["hpl"] if quantity == "horizontal" else 10.0 * sd)
            worst[quantity] = max(worst[quantity], _error(quantity, row, true) / allowed)
    return worst


def _true_place(truth: list[dict[str, Any]], row: dict[str, Any]) -> dict[str, float]:
    return {name: _interpolated(truth, name, row["t_valid_ns"]) for name in ("lat", "lon", "roll", "pitch")}


def _interpolated(truth: list[dict[str, Any]], name: str, t_ns: int) -> float:
    first = truth[0]["t_ns"]
    return float(np.interp((t_ns - first) / 1e9, [(r["t_ns"] - first) / 1e9 for r in truth], [r[name] for r in truth]))


def _error(quantity: str, row: dict[str, Any], true: dict[str, float]) -> float:
    """[m] along a great circle's chord for small ones, or [deg]."""
    if quantity == "horizontal":
        north = (row["lat"] - true["lat"]) * EARTH_M
        return math.hypot(north, (row["lon"] - true["lon"]) * EARTH_M * math.cos(true["lat"]))
    return abs((math.degrees(row[quantity] - true[quantity]) + 180.0) % 360.0 - 180.0)
