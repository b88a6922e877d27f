"""Studies of the position from the ground: their judges, on results that are made here, and parts of them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.plot_style import write_figure
from fti.study import StudyResult, ground_watch, ppsan_aiding
from fti.study.ground_flights import GroundCase, Satellites, fly
from fti.study.ground_watch.experiment import GROUNDS, RAMPS, Alert, MapResult, WatchRun
from fti.study.ground_watch.judge import judge as judge_watch
from fti.study.ppsan_aiding.experiment import OLD_MAP_SD_M, SCHEDULES, SURVEY_SD_M, Pair, Pairs, Track
from fti.study.ppsan_aiding.judge import judge as judge_aiding

T = np.arange(2.0, 250.0)
SATELLITE_SD = 2.0


def track(error_m: float, sd: float) -> Track:
    return Track(T, np.full((len(T), 2), error_m / math.sqrt(2.0) / sd), np.full(len(T), error_m))


def not_held(results: list[StudyResult]) -> set[str]:
    return {result.id for result in results if not result.holds}


def pairs(pair: Pair) -> Pairs:
    return {(name, sd): pair for name in SCHEDULES for sd in (SURVEY_SD_M, OLD_MAP_SD_M)}


def test_aiding_that_helps_holds_and_the_same_error_without_it_does_not() -> None:
    helps = pairs(Pair(track(1.0, 1.0), track(2.0, 1.0)))
    assert not_held(judge_aiding([helps] * 10)) == set()
    same = pairs(Pair(track(2.0, 2.0), track(2.0, 2.0)))
    assert not_held(judge_aiding([same] * 10)) == {f"T16.{name}.{part}" for name in SCHEDULES for part in (80, 170)}
    worse = pairs(Pair(track(3.0, 3.0), track(2.0, 2.0)))
    assert {f"T16.{name}.30" for name in SCHEDULES} <= not_held(judge_aiding([worse] * 10))


def test_a_sigma_that_is_too_small_does_not_hold() -> None:
    small = pairs(Pair(track(2.0, 0.3), track(4.0, 0.3)))
    expected = {f"T16.{kind}.{name}" for kind in ("inside", "ratio") for name in SCHEDULES}
    assert not_held(judge_aiding([small] * 10)) == expected


def test_a_sound_source_that_is_refused_does_not_hold() -> None:
    refused = pairs(Pair(replace(track(1.0, 1.0), refusals=1), track(2.0, 1.0)))
    good = pairs(Pair(track(1.0, 1.0), track(2.0, 1.0)))
    assert not_held(judge_aiding([good] * 9 + [refused])) == {f"T16.refused.{name}" for name in SCHEDULES}


def watch() -> WatchRun:
    """All cases as they should be."""
    soon = Alert(20.0, 10.0, 0, 3.0)
    ramps = {(ground, speed): soon for ground in GROUNDS for speed in RAMPS}
    return WatchRun(MapResult(soon, 0, 0), MapResult(soon, 0, 0), ramps, Alert(math.inf, 1.0, 0, 3.0))


def test_a_watch_that_is_late_silent_or_misled_does_not_hold() -> None:
    good = watch()
    assert not_held(judge_watch([good] * 20)) == set()
    late = replace(good, map_off=MapResult(Alert(61.0, 1.0, 0, 3.0), 0, 0))
    assert not_held(judge_watch([good] * 19 + [late])) == {"W.map"}
    misled = replace(good, alone=MapResult(good.nominal, 1, 0))
    assert not_held(judge_watch([misled])) == {"W.alone"}
    silent = replace(good, ramps={**good.ramps, ("fine", 0.3): Alert(math.inf, 54.0, 0, 3.0)})
    assert not_held(judge_watch([good] * 39 + [silent])) == set()  # one of forty is beyond the quantile
    assert not_held(judge_watch([good] * 9 + [silent] * 2)) == {"W.fine.0.3"}
    nervous = replace(good, nominal=Alert(30.0, 1.0, 1, 3.0))
    assert not_held(judge_watch([nervous])) == {"W.nominal", "W.nominal.beyond"}


def test_a_flight_has_the_satellites_of_its_schedule() -> None:
    """Errors of the stated size; none in an outage."""
    case = GroundCase(seconds=30.0, window_s=None, satellites=(Satellites(20.0, 30.0, None),))
    flown = fly(case, 1, 2)
    sd = np.sqrt([np.trace(cov) / 2.0 for cov in flown.cov])
    assert flown.distance[np.array(flown.t) < 20.0].max() < 5.0 * SATELLITE_SD
    assert sd[-1] > 1.2 * sd[np.array(flown.t) < 20.0][-1]


@pytest.mark.parametrize(("study", "figure"), [(ppsan_aiding, "outages"), (ground_watch, "ramp")])
@pytest.mark.timeout(600)
def test_the_figures_are_drawn(study: object, figure: str, tmp_path: Path, scale: int) -> None:
    drawings = study.drawings(16)  # type: ignore[attr-defined]
    assert figure in drawings
    if scale > 1:  # flights of minutes
        write_figure(drawings[figure], tmp_path / f"{figure}.png")
        assert (tmp_path / f"{figure}.png").stat().st_size > 20_000


@pytest.mark.timeout(7200)
@pytest.mark.parametrize("name", ["ppsan-aiding", "ground-watch"])
def test_the_whole_study_holds(name: str, scale: int, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the live filter over known ground: tests/nav/test_terrain_positioning.py
        return
    assert main(["study", name]) == 0, capsys.readouterr().out
