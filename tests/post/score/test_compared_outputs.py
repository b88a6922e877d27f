"""Drifts, bit errors, messages out of order and a ramp of the position: outputs are compared with the truth meanwhile.

A flight that they do not reach holds.  The same recording with a position that is moved while they act, and that calls
itself valid, does not.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fti.logger.reading.mcap_file import McapMessage
from fti.post.score.comparison import Score
from fti.post.score.outcome import FlightOutcome
from fti.post.score.outputs.row import OutputCheck
from fti.post.score.rows import Result
from tests.post.score.edited_sessions import DERIVED, copy_session, file_of, rewrite, with_content
from tests.post.score.short_flight import CONFIG, score_of, session_of, short_scenario

FROM_S, TO_S = 12.0, 26.0
SECOND_NS = 1_000_000_000
ON_GNSS: tuple[dict[str, Any], ...] = (
    {"kind": "clock_drift", "ppm": 200.0},
    {"kind": "bit_errors", "rate": 1e-4},
    {"kind": "reordered", "share": 0.3},
    {"kind": "lever_arm", "right_m": 3.0},
    {"kind": "gnss_ramp", "north_mps": 0.1},
)
#: The short flight with an attitude, without which navigation has no valid solution.
WITH_ATTITUDE = CONFIG.replace(
    "[nav]",
    """
[[link]]
name = "ahrs_line"
kind = "serial"
port = "/dev/unused"

[[device]]
name = "ahrs"
link = "ahrs_line"
driver = "arinc429"
rate_hz = 25
max_age_ms = 500
options = { set = "ahrs" }

[nav]
attitude = ["ahrs"]""",
)
WRONG_RAD = 40.0 / 6.371e6  # 40 m


@pytest.fixture(scope="module", params=ON_GNSS, ids=lambda table: str(table["kind"]))
def flight(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """A scenario with one fault, and its session."""
    scenario = short_scenario(({"devices": ("gnss",), "from_s": FROM_S, "to_s": TO_S, **request.param},))
    return scenario, session_of(scenario, tmp_path_factory.mktemp("flown"), WITH_ATTITUDE)


def of_position(score: Score, check: OutputCheck) -> list[Result]:
    rows = [row for row in score.outputs if row.topic == "/nav/nav_solution" and row.what == "horizontal"]
    return [row.result for row in rows if row.check is check]


def test_a_flight_that_the_fault_does_not_reach_holds(flight: tuple[Any, Path]) -> None:
    score = score_of(*flight)
    assert score.outcome is FlightOutcome.HOLDS
    assert Result.UNKNOWN not in {row.result for row in score.rows}
    assert of_position(score, OutputCheck.ERROR) == [Result.HOLDS]
    assert of_position(score, OutputCheck.FAULT_ERROR) == [Result.HOLDS]


def test_a_wrong_position_that_calls_itself_valid_meanwhile_fails(flight: tuple[Any, Path], tmp_path: Path) -> None:
    scenario, recorded = flight
    begin_ns = score_of(scenario, recorded).flight_truth.begin_ns

    def moved(item: McapMessage) -> McapMessage:
        t = (item.log_time - begin_ns) / SECOND_NS
        if item.topic.name != "/nav/nav_solution" or not FROM_S + 3.0 <= t < TO_S:
            return item
        return with_content(item, lat=json.loads(item.data)["lat"] + WRONG_RAD)

    session = copy_session(recorded, tmp_path)
    rewrite(file_of(session, DERIVED), moved)
    score = score_of(scenario, session)
    assert score.outcome is FlightOutcome.FAILED
    assert of_position(score, OutputCheck.ERROR) == [Result.HOLDS]
    assert of_position(score, OutputCheck.FAULT_ERROR) == [Result.FAILS]
