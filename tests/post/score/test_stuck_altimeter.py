"""A stuck radar altimeter, through bytes: flown by the emulator past the daemon's chain, and compared by the score."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fti.hil import scenario as scenarios
from fti.hil.memory_backend import BEGIN_NS
from fti.hil.tables.fault_types import Stuck
from fti.logger.reading.recording import Recording
from fti.post import offline_run
from fti.post.score.rows import Result
from fti.post.score.session_score import score_session

pytestmark = pytest.mark.timeout(900)
HEIGHT = "/nav/height_above_ground/altimeter"
FROM_S, TO_S, END_S = 20.0, 48.0, 54.0
SECOND_NS = 1_000_000_000


def test_it_is_refused_with_an_event_and_accepted_again(tmp_path: Path) -> None:
    loaded = scenarios.load(scenarios.find("nominal"))
    stuck = Stuck(kind="stuck", devices=("altimeter",), from_s=FROM_S, to_s=TO_S)
    flight = loaded.model_copy(update={"fault": (stuck,)})
    session = offline_run.fly(scenarios.load_config(flight), flight, tmp_path, until_s=END_S)
    recording = Recording.open(session)
    rows = [row for row in read(recording, HEIGHT) if row["t_s"] >= FROM_S]
    refused = [row["t_s"] for row in rows if "stuck" in row["reasons"]]
    assert refused[0] <= FROM_S + 8.0, "four steps of 6 m above 152 m, at 3 m/s over slight relief"
    assert all(not row["valid"] for row in rows if refused[0] <= row["t_s"] < TO_S)
    assert all(row["valid"] for row in rows if row["t_s"] > TO_S + 3.0)
    events = [row["message"] for row in read(recording, "/fti/event") if row["name"] == "altimeter"]
    assert len([text for text in events if "its value is stuck at" in text]) == 1
    assert len([text for text in events if "its value changes again" in text]) == 1
    (score,) = score_session(recording, flight, recording.truth_files, None)
    assert {row.result for row in score.rows if row.subject == "altimeter" and "stuck" in row.flag} == {Result.FOUND}
    assert score.unexpected == ()


def read(recording: Recording, topic: str) -> list[dict[str, Any]]:
    """Messages of a topic with their times in the flight [s]."""
    found = list[dict[str, Any]]()
    for name, t_ns, _, _, data in recording.messages(topic, kind="derived"):
        if name == topic:
            found.append({**json.loads(data), "t_s": (t_ns - BEGIN_NS) / SECOND_NS})
    return found
