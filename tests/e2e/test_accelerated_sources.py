"""Receivers that lie, through bytes, faster than time: emulated, recorded, navigated."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fti.logger.reading.recording import Recording
from fti.post.reprocess import recorded_setup, reprocess
from tests.e2e.flights import Flight, fly_faster
from tests.helpers import ROOT

pytestmark = pytest.mark.timeout(300)

PROVISIONAL = "/nav/provisional_solution/receiver"
HEAD = f"""
title = "A receiver that lies"
description = "A fault of the satellite receiver, which is the only device of position."
config = "{ROOT / "configs" / "fallbacks.toml"}"
seed = 3

[[fault]]
devices = ["receiver"]
from_s = 20
to_s = 40
"""


def flight(fault: str, folder: Path, duration_s: float) -> Flight:
    scenario = folder / "lying.toml"
    scenario.write_text(HEAD + fault)
    return fly_faster(str(scenario), folder / "session", duration_s)


def max_error_m(run: Flight, since: float, until: float) -> float:
    """Of the horizontal position that navigation calls valid."""
    errors = [0.0]
    for row in itertools.islice(solutions(run, since, until), 0, None, 10):
        true = run.truth_at(float(row["t"]))
        north = (row["lat"] - true["lat"]) * 6.37e6
        east = (row["lon"] - true["lon"]) * 6.38e6 * math.cos(true["lat"])
        errors.append(math.hypot(north, east) if row["valid"] else 0.0)
    return max(errors)


def solutions(run: Flight, since: float, until: float) -> Iterator[dict[str, Any]]:
    return (row for row in run.outputs("/nav/nav_solution") if since <= row["t"] < until)


def test_a_frozen_receiver_is_not_the_source_until_30_s_after_it_moves_again(tmp_path: Path) -> None:
    run = flight('kind = "stuck"\n', tmp_path, 75.0)
    assert {row["position_source"] for row in solutions(run, 5.0, 20.0)} == {"receiver"}
    assert {row["position_source"] for row in solutions(run, 23.0, 69.5)} == {"filter"}
    assert {row["position_source"] for row in solutions(run, 72.0, 75.0)} == {"receiver"}
    assert max_error_m(run, 22.0, 75.0) < 25.0  # one that is frozen for 20 s is 1200 m off
    rows = [row for row in run.outputs("/nav/source_validity/receiver") if 23.0 <= row["t"] < 39.0]
    assert rows
    assert {(row["valid"], tuple(row["reasons"])) for row in rows} == {(False, ("repeated",))}
    assert all(abs(run.seconds(row["onset_ns"]) - 20.0) < 0.5 for row in rows)


def test_a_step_of_100_m_is_refused_at_once_and_its_end_is_a_closure(tmp_path: Path) -> None:
    run = flight('kind = "gnss_offset"\nnorth_m = 100\n', tmp_path, 75.0)
    assert {row["position_source"] for row in solutions(run, 5.0, 20.0)} == {"receiver"}
    assert {row["position_source"] for row in solutions(run, 20.4, 69.5)} == {"filter"}
    assert {row["position_source"] for row in solutions(run, 72.0, 75.0)} == {"receiver"}
    assert max_error_m(run, 20.4, 75.0) < 25.0
    standing = [row for row in run.outputs("/nav/source_validity/receiver") if 25.0 <= row["t"] < 39.0]
    assert {tuple(row["reasons"]) for row in standing} == {("jump", "unconfirmed")}


def test_an_unconfirmed_receiver_has_a_provisional_solution_that_reprocessing_repeats(tmp_path: Path) -> None:
    """A step of 100 m from 25 s on; its tests have passed for 30 s at 55 s."""
    run = fly_faster("gnss_step", tmp_path / "session", 70.0)
    rows = list(run.outputs(PROVISIONAL))
    assert 55.0 <= rows[0]["t"] <= 58.5
    assert rows[-1]["t"] > 69.0
    assert {(row["valid"], tuple(row["reasons"])) for row in rows} == {(False, ("unconfirmed",))}
    for row in rows:
        true = run.truth_at(float(row["t"]))
        north = (row["lat"] - true["lat"]) * 6.37e6
        east = (row["lon"] - true["lon"]) * 6.38e6 * math.cos(true["lat"])
        assert 90.0 < north < 110.0
        assert math.hypot(north, east) < row["hpl"]
    recording = run.recording
    setup = recorded_setup(recording, run.session)
    again = reprocess(recording, setup, tmp_path / "again", as_flown=False, progress=lambda seq: None)
    assert messages(Recording.open(again)) == messages(recording)


def messages(recording: Recording) -> list[tuple[int, bytes]]:
    """Time and bytes of each provisional solution."""
    return [(t_ns, data) for _, t_ns, *_, data in recording.messages(PROVISIONAL)]
