"""Scenarios of wrong sources: each can be flown, and the score says of its outputs what is true.

The result must agree with the errors that this file computes from the recorded messages and the truth, on a sphere and
in degrees.  Of the shipped scenarios the receiver must be refused, and the score must hold; of those in
configs/scenarios/source_faults the daemon does not detect each one.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray

from fti.hil import scenario as scenarios
from fti.hil.oracle.scenario_check import check_scenario
from fti.hil.oracle.truth_checked_faults import SourceFault
from fti.hil.tables.fault_base import DeviceFault
from fti.logger.reading.recording import Recording
from fti.post import offline_run
from fti.post.score.outcome import FlightOutcome
from fti.post.score.outputs.row import OutputCheck
from fti.post.score.rows import Result
from fti.post.score.session_score import score_session
from tests.helpers import ROOT

Row = dict[str, Any]

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
#: In quick tests a flight ends so long after its fault begins [s], after slow ones later; at full scale at its end.
AFTER_S, AFTER_SLOW_S = 16.0, 40.0
SLOW = ("attitude_offset", "gnss_ramp", "gnss_spoofed")
#: So close to the limit the two computations may differ.
CLOSE = 0.02


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "flown" in metafunc.fixturenames:
        is_quick = metafunc.config.getoption("--scale") == "quick"
        metafunc.parametrize("flown", QUICK if is_quick else NAMES)


@dataclass(frozen=True, eq=False)
class FlightRows:
    """Rows of the truth as columns over time [ns], and the solutions that are flagged valid."""

    t_ns: NDArray[np.int64]
    columns: dict[str, NDArray[np.float64]]
    valid: list[Row]

    @classmethod
    def read(cls, recording: Recording) -> FlightRows:
        (truth_file,) = recording.truth_files
        truth = [json.loads(data) for *_, data in Recording.open(truth_file).messages("/truth/state", kind="truth")]
        solutions = [json.loads(data) for *_, data in recording.messages(SOLUTION)]
        names = ("lat", "lon", "roll", "pitch", "heading")
        columns = {name: np.array([row[name] for row in truth]) for name in names}
        return cls(np.array([row["t_ns"] for row in truth]), columns, [row for row in solutions if row["valid"]])

    def valid_from(self, from_s: float) -> list[Row]:
        """The valid solutions from a time of the flight [s] on."""
        return [row for row in self.valid if row["t_ns"] >= self.t_ns[0] + from_s * SECOND_NS]

    def true_at(self, t_ns: int) -> dict[str, float]:
        """Interpolated; the heading, which jumps at north, of the nearest row."""
        first = self.t_ns[0]
        since_s = (self.t_ns - first) / 1e9
        true = {name: float(np.interp((t_ns - first) / 1e9, since_s, column)) for name, column in self.columns.items()}
        return true | {"heading": float(self.columns["heading"][np.argmin(np.abs(self.t_ns - t_ns))])}


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
def test_a_lying_source_is_refused_and_announced_and_no_valid_output_is_wrong(
    name: str, tmp_path: Path, scale: int
) -> None:
    scenario = scenarios.load(scenarios.find(name))
    fault = scenario.fault[0]
    assert isinstance(fault, DeviceFault)
    until_s = fault.from_s + (AFTER_SLOW_S if name in SLOW else AFTER_S) if scale == 1 else None
    session = offline_run.fly(scenarios.load_config(scenario), scenario, tmp_path, until_s=until_s)
    recording = Recording.open(session)
    (score,) = score_session(recording, scenario, recording.truth_files, None)
    assert score.outcome is FlightOutcome.HOLDS, [row for row in score.rows if row.result is not Result.FOUND]
    (device,) = fault.devices
    refusals = [row for row in score.rows if row.flag.startswith(SOLUTION) and row.flag.endswith(f"not from {device}")]
    (refused,) = refusals
    assert refused.result is Result.FOUND
    assert refused.within_s is not None
    event_texts = [f"{row['name']}: {row['message']}" for row in events(recording)]
    assert any("refused" in text and text.removeprefix("nav: ").startswith(f"{device}:") for text in event_texts)
    # A wrong attitude is valid until its refusal is due; a position never is beyond its protection level.
    rows = FlightRows.read(recording)
    shares = worst_shares(rows, fault.from_s + refused.within_s)
    assert shares
    assert max(shares.values()) <= 1.0 + CLOSE
    assert levels_hold(rows, fault.from_s)
    assert tilt_levels_hold(rows, fault.from_s + COMPARED_S)


def events(recording: Recording) -> list[dict[str, Any]]:
    """What the event log says."""
    return [json.loads(data) for *_, data in recording.messages("/fti/event", kind="derived")]


def levels_hold(rows: FlightRows, from_s: float) -> bool:
    """Whether each valid solution is within its protection level of the true position."""
    valid = rows.valid_from(from_s)
    return all(_error("horizontal", row, rows.true_at(row["t_valid_ns"])) <= row["hpl"] for row in valid)


def tilt_levels_hold(rows: FlightRows, from_s: float) -> bool:
    """Whether roll and pitch together are within their protection level, and 2 deg, in each valid solution."""
    valid = rows.valid_from(from_s)
    for row in valid:
        true = rows.true_at(row["t_valid_ns"])
        tilt = math.hypot(_error("roll", row, true), _error("pitch", row, true))
        if tilt > min(math.degrees(row["tilt_pl"]), LIMITS["roll"]):
            return False
    return bool(valid)


def test_the_score_reports_what_is_true_of_the_outputs(flown: str, tmp_path: Path) -> None:
    scenario = scenarios.load(FOLDER / f"{flown}.toml")
    session = offline_run.fly(scenarios.load_config(scenario), scenario, tmp_path, until_s=END_S)
    recording = Recording.open(session)
    (score,) = score_session(recording, scenario, recording.truth_files, None)
    assert stated_faults(recording)[0] == json.loads(scenario.flight_key)["fault"][0]
    assert {row.result for row in score.rows if row.fault == 0} <= {Result.COMPARED, Result.FOUND}
    rows = {
        row.what: row.result for row in score.outputs if (row.topic, row.check) == (SOLUTION, OutputCheck.FAULT_ERROR)
    }
    from_s = getattr(scenario.fault[0], "from_s", math.inf)
    for quantity, share in worst_shares(FlightRows.read(recording), from_s).items():
        if abs(share - 1.0) > CLOSE:
            assert rows[quantity] is (Result.FAILS if share > 1.0 else Result.HOLDS), quantity


def stated_faults(recording: Recording) -> list[dict[str, Any]]:
    """The faults that the truth file states."""
    (truth_file,) = recording.truth_files
    with truth_file.open("rb") as stream:
        (flown,) = (one for one in make_reader(stream).iter_attachments() if one.name == "scenario.json")
    return list(json.loads(flown.data)["fault"])


def worst_shares(rows: FlightRows, from_s: float) -> dict[str, float]:
    """The largest error against what is allowed, of the valid solutions from a time of the flight [s] on."""
    valid = rows.valid_from(from_s)
    worst = dict.fromkeys(LIMITS, 0.0) if valid else {}
    for row in valid:
        true = rows.true_at(row["t_valid_ns"])
        for quantity, limit in LIMITS.items():
            sd = math.degrees(row.get(STATED.get(quantity, "")) or 0.0)
            allowed = max(limit, row["hpl"] if quantity == "horizontal" else 10.0 * sd)
            worst[quantity] = max(worst[quantity], _error(quantity, row, true) / allowed)
    return worst


def _error(quantity: str, row: Row, true: dict[str, float]) -> float:
    """[m] along a great circle's chord for small ones, or [deg]."""
    if quantity == "horizontal":
        north = (row["lat"] - true["lat"]) * EARTH_M
        return math.hypot(north, (row["lon"] - true["lon"]) * EARTH_M * math.cos(true["lat"]))
    return abs((math.degrees(row[quantity] - true[quantity]) + 180.0) % 360.0 - 180.0)
