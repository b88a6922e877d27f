"""The compensation study in small: its orderings, its judges, its pictures; the whole with --scale full."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fti.plot_style import write_figure
from fti.study import compensation
from fti.study.compensation import experiment, judge, low_level
from fti.study.compensation.experiment import WAYS, CompensationRun
from fti.study.compensation.judge import NEVER_DEG, min_helpful_bank
from fti.study.compensation.low_level import Knowledge

FEW = 40


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """40 poses, two beams, three banks."""
    monkeypatch.setattr(low_level.fly, "__defaults__", (FEW,))
    monkeypatch.setattr(experiment, "BANK_POSES", 20)
    for module in (experiment, judge):
        monkeypatch.setattr(module, "WIDTHS_DEG", (10, 60))
        monkeypatch.setattr(module, "BANKS_DEG", (0, 30, 60))


@pytest.mark.usefixtures("small")
def test_one_country_holds_and_repeats_itself() -> None:
    shares: list[float] = []
    results = compensation.study(1, 21, shares.append)
    assert [r for r in results if not (r.holds or r.id.startswith("sigma."))] == []  # shares of a few poses
    assert shares[-1] == 1.0
    assert len({result.id for result in results}) == len(results)
    by_id = {result.id: result.value for result in results}
    assert by_id["laser.all.range"] < 0.2  # the ray itself over the surface itself: the noise is left
    assert by_id["laser.all.range"] < by_id["laser.dem_error.range"] < by_id["laser.all.attitude"]
    assert by_id["radar.all.beam"] < by_id["radar.place_error.beam"] < by_id["radar.all.attitude"]
    assert (by_id["bank.10"], by_id["bank.60"]) == (30, NEVER_DEG)
    assert by_id["T2"] < 0.7
    for sensor in ("laser", "radar"):  # the ground around knows the edges of the forest
        assert 0.5 < by_id[f"sigma.{sensor}.around"] < 2.5
        assert by_id[f"sigma.{sensor}.around"] < by_id[f"sigma.{sensor}.plane"]
    assert by_id["sigma.laser.range_around"] < by_id["sigma.laser.range_plane"]
    assert [result.value for result in compensation.study(1, 21, shares.append)] == [r.value for r in results]


def test_all_ways_have_the_same_poses() -> None:
    mix = low_level.fly(21, FEW)
    mix.measured["radar"][3] = np.nan
    heights = experiment.compensate(mix, low_level.predict(mix, Knowledge.ALL, 21))
    assert set(heights) == {(sensor, way) for sensor in ("laser", "radar") for way in WAYS}
    assert all(np.isnan(heights["radar", way][3]) for way in WAYS)
    assert np.isfinite(heights["laser", "raw"][3])


def found(beam: float, raw: float) -> CompensationRun:
    mix = {(known, sensor, way): 4.0 for known in Knowledge for sensor in ("laser", "radar") for way in WAYS}
    mix[Knowledge.ALL, "radar", "beam"], mix[Knowledge.ALL, "radar", "raw"] = beam, raw
    return CompensationRun(mix, {}, np.ones((6, 7, 3)), (4.0, 1.0))


def test_the_judge_can_say_no() -> None:
    better, worse = [found(1.0, 2.0)] * 20, [found(2.0, 1.0)] * 6 + [found(1.0, 2.0)] * 14
    assert judge._judge_ordering(better, "radar", "beam", "raw").holds
    result = judge._judge_ordering(worse, "radar", "beam", "raw")
    assert (result.value, result.target, result.holds) == (14, ">= 17", False)
    assert not judge._judge_ordering([found(1.0, 1.0)] * 20, "radar", "beam", "raw").holds


def test_where_it_helps_is_where_it_helps_from_there_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judge, "BANKS_DEG", (0, 10, 20, 30))
    raw, by = np.array([[5.0, 5.0, 5.0, 5.0]] * 3), np.array([[4.0, 6.0, 4.0, 4.0], [6.0] * 4, [4.0, 4.0, 4.0, 5.0]])
    assert min_helpful_bank(np.stack((raw, by), axis=-1), 1) == [20, NEVER_DEG, NEVER_DEG]


@pytest.mark.timeout(1800)
def test_the_whole_study_holds(scale: int, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    if scale == 1:  # a picture that costs little
        request.getfixturevalue("small")
    else:
        results = compensation.study(compensation.RUNS, compensation.SEED, lambda share: None)
        assert [result for result in results if not result.holds] == []
    drawings = compensation.drawings(21)
    write_figure(drawings["radar"], tmp_path / "radar.png")
    assert (tmp_path / "radar.png").stat().st_size > 20_000
