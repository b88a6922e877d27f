"""The attitude of navigation beside its protection levels, in a flight whose only attitude source is wrong by 3 deg.

It states no sigma and nothing is there to compare it with, so its level is 4.80 deg.  The same recording with a level
of 1 deg is wrong as soon as the attitudes are compared.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from fti.logger.reading.mcap_file import McapMessage
from fti.post.score.comparison import Score
from fti.post.score.outcome import FlightOutcome
from fti.post.score.outputs.row import OutputCheck
from fti.post.score.rows import Result
from tests.post.score.edited_sessions import DERIVED, copy_session, file_of, rewrite, with_content
from tests.post.score.short_flight import score_of, session_of, short_scenario
from tests.post.score.test_compared_outputs import SECOND_NS, WITH_ATTITUDE

FROM_S, TO_S = 12.0, 26.0
OFFSET: dict[str, Any] = {"kind": "attitude_offset", "devices": ("ahrs",), "roll_deg": 3.0, "heading_deg": 6.0}


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """The scenario and its session."""
    scenario = short_scenario(({"from_s": FROM_S, "to_s": TO_S, **OFFSET},))
    return scenario, session_of(scenario, tmp_path_factory.mktemp("flown"), WITH_ATTITUDE)


def results(score: Score, check: OutputCheck) -> dict[str, Result]:
    """Of the angles of the solution."""
    rows = [row for row in score.outputs if row.topic == "/nav/nav_solution" and row.check is check]
    return {row.what: row.result for row in rows if row.what in {"roll", "pitch", "heading"}}


HOLDS = dict.fromkeys(("roll", "pitch", "heading"), Result.HOLDS)


def test_a_wrong_attitude_within_its_level_holds(flight: tuple[Any, Path]) -> None:
    score = score_of(*flight)
    assert score.outcome is FlightOutcome.HOLDS
    assert results(score, OutputCheck.PROTECTED) == HOLDS
    assert results(score, OutputCheck.FAULT_ERROR) == HOLDS


@pytest.mark.parametrize(
    ("field", "until_s", "wrong"),
    [("tilt_pl", TO_S, "roll"), ("heading_pl", TO_S, "heading"), ("tilt_pl", FROM_S + 0.8, None)],
)
def test_one_beyond_its_level_fails_from_a_second_of_the_fault_on(
    flight: tuple[Any, Path], tmp_path: Path, field: str, until_s: float, wrong: str | None
) -> None:
    scenario, recorded = flight
    begin_ns = score_of(scenario, recorded).flight_truth.begin_ns

    def narrowed(item: McapMessage) -> McapMessage:
        t = (item.log_time - begin_ns) / SECOND_NS
        if item.topic.name != "/nav/nav_solution" or not FROM_S <= t < until_s:
            return item
        return with_content(item, **{field: math.radians(1.0)})

    session = copy_session(recorded, tmp_path)
    rewrite(file_of(session, DERIVED), narrowed)
    rows = results(score_of(scenario, session), OutputCheck.PROTECTED)
    assert [what for what, result in rows.items() if result is not Result.HOLDS] == ([wrong] if wrong else [])
