"""The scenarios of configs/scenarios/source_faults: each can be flown, and the score says of its outputs what is true.

What the daemon makes of a fault is not asked here: its outputs are right or not valid where it refuses the source, and
wrong where it does not.  The verdict must agree with the errors that this file computes from the recorded messages and
the truth, on a sphere and in degrees.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from fti.hil import accelerated
from fti.hil import scenario as scenarios
from fti.hil.expected.compared import OfSource, is_compared
from fti.hil.expected.scenario_check import check_scenario
from fti.hil.expected.source_flags import SOURCE_FLAGS
from fti.hil.tables.kinds import FaultKind
from fti.logger.reading.recording import Recording
from fti.post.score.outputs.row import Check
from fti.post.score.rows import Verdict
from fti.post.score.session_score import judge_session
from tests.helpers import ROOT

pytestmark = pytest.mark.timeout(900)
FOLDER = ROOT / "configs" / "scenarios" / "source_faults"
NAMES = sorted(file.stem for file in FOLDER.glob("*.toml"))
#: Flown in quick tests: each 15 s of its fault; at full scale all of them.
QUICK = ("attitude_offset", "swapped_coordinates")
SOLUTION = "/nav/nav_solution"
END_S, EARTH_M, SECOND_NS = 40.0, 6.371e6, 1_000_000_000
#: [limits] as they are by default: horizontal [m], roll, pitch and heading [deg]; or ten stated sigmas.
LIMITS = {"horizontal": 20.0, "roll": 2.0, "pitch": 2.0, "heading": 4.0}
STATED = {"horizontal": "horizontal_sd", "roll": "tilt_sd", "pitch": "tilt_sd", "heading": "heading_sd"}
#: So close to the limit the two computations may differ.
CLOSE = 0.02


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "flown" in metafunc.fixturenames:
        is_quick = metafunc.config.getoption("--scale") == "quick"
        metafunc.parametrize("flown", QUICK if is_quick else NAMES)


def test_every_new_fault_of_a_source_has_a_scenario() -> None:
    there = {fault.kind for name in NAMES for fault in scenarios.load(FOLDER / f"{name}.toml").fault}
    assert there - {"gnss_outage"} == {
        "attitude_offset", "gnss_ramp", "inertial_bias", "latency", "lever_arm", "scale",
        "swapped_coordinates", "terrain_shift", "undulation",
    }  # fmt: skip
    assert not set(NAMES) & set(scenarios.shipped())


@pytest.mark.parametrize("name", NAMES)
def test_each_can_be_flown_and_states_the_flags_of_the_table(name: str) -> None:
    scenario = scenarios.load(FOLDER / f"{name}.toml")
    checked = check_scenario(scenario, scenarios.load_config(scenario))
    assert checked.warnings == ()
    assert isinstance(scenario.fault[0], OfSource)
    assert is_compared(scenario.fault[0])
    row = SOURCE_FLAGS.get(FaultKind(scenario.fault[0].kind))
    due = [duty for one in checked.of_fault(0) for duty in one.duties if duty.place == SOLUTION]
    assert bool(due) is (row is not None and row.is_due)


def test_the_score_says_what_is_true_of_the_outputs(flown: str, tmp_path: Path) -> None:
    scenario = scenarios.load(FOLDER / f"{flown}.toml")
    session = accelerated.fly(scenarios.load_config(scenario), scenario, tmp_path, until_s=END_S)
    recording = Recording.open(session)
    (score,) = judge_session(recording, scenario, recording.truth_files, None)
    assert stated_faults(recording)[0] == json.loads(scenario.flown)["fault"][0]
    assert {row.verdict for row in score.rows if row.fault == 0} <= {Verdict.COMPARED, Verdict.FOUND}
    rows = {row.what: row.verdict for row in score.outputs if (row.topic, row.check) == (SOLUTION, Check.FAULT_ERROR)}
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


def worst_shares(recording: Recording, from_s: float) -> dict[str, float]:
    """The largest error against what is allowed, of the valid solutions from a time of the flight [s] on."""
    (truth_file,) = recording.truth_files
    truth = [json.loads(data) for *_, data in Recording.open(truth_file).messages("/truth/state", kind="truth")]
    begin_ns = truth[0]["t_ns"]
    found = [json.loads(data) for *_, data in recording.messages(SOLUTION)]
    valid = [row for row in found if row["valid"] and row["t_ns"] >= begin_ns + from_s * SECOND_NS]
    worst = dict.fromkeys(LIMITS, 0.0) if valid else {}
    for row in valid:
        true = {name: _interpolated(truth, name, row["t_valid_ns"]) for name in ("lat", "lon", "roll", "pitch")}
        true["heading"] = min(truth, key=lambda one: abs(one["t_ns"] - row["t_valid_ns"]))["heading"]
        for quantity, limit in LIMITS.items():
            sd = row.get(STATED[quantity]) or 0.0
            allowed = max(limit, 10.0 * (sd if quantity == "horizontal" else math.degrees(sd)))
            worst[quantity] = max(worst[quantity], _error(quantity, row, true) / allowed)
    return worst


def _interpolated(truth: list[dict[str, Any]], name: str, t_ns: int) -> float:
    first = truth[0]["t_ns"]
    return float(np.interp((t_ns - first) / 1e9, [(r["t_ns"] - first) / 1e9 for r in truth], [r[name] for r in truth]))


def _error(quantity: str, row: dict[str, Any], true: dict[str, float]) -> float:
    """[m] along a great circle's chord for small ones, or [deg]."""
    if quantity == "horizontal":
        north = (row["lat"] - true["lat"]) * EARTH_M
        return math.hypot(north, (row["lon"] - true["lon"]) * EARTH_M * math.cos(true["lat"]))
    return abs((math.degrees(row[quantity] - true[quantity]) + 180.0) % 360.0 - 180.0)
