"""The study of the filter: some flights are consistent, and its judges can say no; the whole with --scale full."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.plot_style import write_figure
from fti.study import StudyResult
from fti.study import filter as study
from fti.study.filter import judge, plots
from fti.study.filter.experiment import FilterRun, run
from fti.study.filter.flights import CASES, OUTAGES_S, draw_flight
from fti.study.filter.terrain import HeightErrors, HeightPair, fly_pairs, spell_rms

FLIGHTS = 2
OUTAGES, RICH = 3, 4


@pytest.fixture(scope="module")
def runs() -> list[FilterRun]:
    return [run((1, OUTAGES, number)) for number in range(FLIGHTS)]


@pytest.fixture(scope="module")
def over() -> dict[str, HeightPair]:
    return fly_pairs((1, 0, 0))


def by_id(results: list[StudyResult]) -> dict[str, StudyResult]:
    return {result.id: result for result in results}


def test_some_flights_are_consistent_as_far_as_some_can_tell(runs: list[FilterRun]) -> None:
    """Twenty values of NEES / n with 22 states each: their mean is 1 within 0.15 sqrt(10) at the most."""
    assert np.mean([r.nees for r in runs]) == pytest.approx(1.0, abs=0.3)
    assert np.mean([r.nis for r in runs]) == pytest.approx(1.0, abs=0.1)
    assert np.abs(np.concatenate([r.ratios for r in runs])).max() < 5.0


def test_the_judge_says_no_to_a_filter_that_is_too_sure_or_too_modest(runs: list[FilterRun]) -> None:
    rng = np.random.default_rng(2)
    honest = [
        dataclasses.replace(r, ratios=rng.standard_normal((10, 22)), nees=rng.chisquare(22, 10) / 22)
        for r in runs * 100
    ]
    assert all(r.holds for r in judge.judge_case(OUTAGES, honest, rng))
    sure = [dataclasses.replace(r, ratios=1.3 * r.ratios, nees=1.69 * r.nees, nis=1.3) for r in honest]
    refused = {r.id for r in judge.judge_case(OUTAGES, sure, rng) if not r.holds}
    assert refused == {"outages.ratio", "outages.nees_high", "outages.nees_instants", "outages.nis_high"}
    modest = [dataclasses.replace(r, ratios=0.7 * r.ratios, nees=0.5 * r.nees, nis=0.7) for r in honest]
    refused = {r.id for r in judge.judge_case(OUTAGES, modest, rng) if not r.holds}
    assert refused == {"outages.ratio_low", "outages.nees_low", "outages.nees_instants", "outages.nis_low"}


def test_the_worst_state_decides_for_rich_truth(runs: list[FilterRun]) -> None:
    ratios = np.ones((10, 22))
    ratios[4, 2] = 1.6
    results = by_id(
        judge.judge_case(RICH, [dataclasses.replace(r, ratios=ratios) for r in runs], np.random.default_rng(0))
    )
    assert not results["rich.ratio"].holds
    assert results["rich.ratio"].quantity.endswith("position down")


def test_states_that_are_not_observed_are_named(runs: list[FilterRun]) -> None:
    spread = np.full(22, 0.5)
    spread[14] = 0.95
    results = judge.judge_case(OUTAGES, [dataclasses.replace(r, spread=spread) for r in runs], np.random.default_rng(0))
    assert by_id(results)["outages.unobserved"].quantity.endswith("gyro bias z")


def test_there_are_no_satellites_in_an_outage_and_every_case_is_flown() -> None:
    for which, case in enumerate(CASES):
        flight = draw_flight(case, np.random.default_rng([3, which]))
        fixes = np.array([t for t, aiding in flight.aids if aiding.name == "gnss.position"])
        hidden = sum(np.count_nonzero((fixes >= a) & (fixes < b)) for a, b in OUTAGES_S)
        assert bool(hidden == 0) is case.outages
        assert len({aiding.name for _, aiding in flight.aids}) == (4 if case.aided else 2)


def test_over_terrain_the_altimeter_holds_the_height(over: dict[str, HeightPair]) -> None:
    for pair in over.values():
        aided, unaided = (spell_rms([h], (170.0, 200.0))[0] for h in (pair.aided, pair.unaided))
        assert aided < max(2.0, unaided)
        assert np.mean(np.abs(pair.aided.error) < 3.0 * pair.aided.sd) > 0.9
        assert pair.aided.sd[190] < 0.6 * pair.unaided.sd[190]


def test_the_flight_is_the_unit_over_terrain() -> None:
    rng = np.random.default_rng(4)

    def height(sd: float) -> HeightErrors:
        return HeightErrors(sd * rng.standard_normal(251), np.full(251, sd))

    good = [HeightPair(height(3.0), height(1.0)) for _ in range(40)]
    assert all(r.holds for r in judge.judge_terrain("outage", good, rng))
    same = [HeightPair(height(1.0), height(1.0)) for _ in range(40)]
    refused = {r.id for r in judge.judge_terrain("outage", same, rng) if not r.holds}
    assert {"T16.outage.80.p", "T16.outage.170.p"} <= refused
    late = [HeightPair(p.unaided, HeightErrors(4.0 * p.aided.error, p.aided.sd)) for p in good]
    assert {"T16.outage.inside", "T16.outage.ratio", "T16.outage.30"} <= {
        r.id for r in judge.judge_terrain("outage", late, rng) if not r.holds
    }


def test_pictures_are_drawn(tmp_path: Path, runs: list[FilterRun], over: dict[str, HeightPair]) -> None:
    write_figure(lambda: plots.heights(over), tmp_path / "heights.png")
    write_figure(lambda: plots.one_flight(runs[0]), tmp_path / "outages.png")
    write_figure(lambda: plots.consistency([runs] * len(CASES)), tmp_path / "honesty.png")
    assert all(file.stat().st_size > 20_000 for file in tmp_path.iterdir())


@pytest.mark.timeout(7200)
def test_the_whole_study_holds(scale: int, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the parts are judged above
        assert set(study.drawings(study.SEED)) == {"heights", "outages", "honesty"}
        return
    assert main(["study", "filter"]) == 0
    assert "T16.outage.170.p" in capsys.readouterr().out
