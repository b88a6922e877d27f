"""The approach study in small: the pattern clears its hills, the ratio and its judge; the whole with --scale full."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest

from fti.plot_style import write_figure
from fti.study import approach
from fti.study.approach import experiment, heights, judge, pattern, plots
from fti.study.approach.pattern import THRESHOLD_M, make_pattern
from fti.study.statistics import ratio_bound, ratio_interval

COARSE_S = 2.5


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """The wide antenna, and a measurement in 2.5 s."""
    monkeypatch.setattr(experiment, "ANTENNAS", {"wide": experiment.ANTENNAS["wide"]})
    monkeypatch.setattr(experiment, "make_pattern", functools.partial(make_pattern, every_s=COARSE_S))
    monkeypatch.setattr(pattern, "CELL_M", 20.0)
    monkeypatch.setattr(heights, "MODEL_ORDER", 8)
    monkeypatch.setattr(plots, "FINE_S", COARSE_S)
    monkeypatch.setattr(plots, "STEP_M", 50.0)


@pytest.mark.usefixtures("small")
def test_one_pattern_holds_and_repeats_itself() -> None:
    shares: list[float] = []
    results = approach.study(1, 13, shares.append)
    assert [result for result in results if not result.holds] == []
    assert shares == [1.0]
    by_id = {result.id: result.value for result in results}
    assert by_id["T13.same"] < by_id["T13.independent"] < by_id["T13.dem"]
    assert by_id["T13.filter.radar_compensated"] < 1.0 < by_id["T13.filter.radar_raw"]
    assert [result.value for result in approach.study(1, 13, shares.append)] == [r.value for r in results]


def test_the_pattern_matches_its_description(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pattern, "CELL_M", 50.0)
    for seed in range(approach.SEED, approach.SEED + 6):
        flown = make_pattern(seed, 1.0)
        flight, before = flown.flight, flown.flight.t < flown.flight.t[-1] - 25.0
        assert flight.origins_l[-1] == pytest.approx([0.0, 0.0, THRESHOLD_M], abs=40.0)
        assert np.cos(flight.heading[[0, -1]]) == pytest.approx([-1.0, 1.0], abs=1e-6)
        assert np.degrees(np.abs(flight.roll)).max() < 24.0
        assert flown.nadir[before].min() > 20.0
        assert flown.nadir.max() < 600.0  # within the altimeter's range


def test_the_judge_can_say_no() -> None:
    good, bad = [(1.0, 100.0)] * 20, [(1.0, 100.0)] * 15 + [(30.0, 100.0)] * 5
    assert judge._judge_ratio(good, "wide", "independent", 1).holds
    result = judge._judge_ratio(bad, "wide", "independent", 1)
    assert result.value < 0.30  # the ratio itself would pass
    assert not result.holds
    assert judge._judge_ratio(bad, "narrow", "independent", 1).holds  # reported, not judged


def test_the_bound_is_one_sided() -> None:
    above, below = np.random.default_rng(1).uniform(0.5, 1.5, (2, 20))
    bound = ratio_bound(above, below, np.random.default_rng(2))
    low, high = ratio_interval(above, below, np.random.default_rng(2))
    assert low < bound < high


@pytest.mark.timeout(1800)
def test_the_whole_study_holds(scale: int, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    if scale == 1:  # pictures that cost little
        request.getfixturevalue("small")
    else:
        results = approach.study(approach.RUNS, approach.SEED, lambda share: None)
        assert [result for result in results if not result.holds] == []
    for name, draw in approach.drawings(13).items():
        write_figure(draw, tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000
