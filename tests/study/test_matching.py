"""The study of matching: few flights, and judges that can say no; the whole with --scale full."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fti.arrays import Array
from fti.cli.main import main
from fti.plot_style import write_figure
from fti.study import StudyResult, matching
from fti.study.matching import judge
from fti.study.matching.experiment import HOSTILE, Confirmed, Flight, GroundResult

GOOD = GroundResult(
    error_m=1.0,
    error_over_bound=(1.0, 1.6),
    nees=1.0,
    found_cell=True,
    tracked=(4.0, 9.0, 9.0),
    lost=(9.0, 16.0, 9.0),
)


def by_id(results: list[StudyResult]) -> dict[str, StudyResult]:
    return {result.id: result for result in results}


def test_few_flights_hold_what_does_not_need_many() -> None:
    shares: list[float] = []
    results = by_id(matching.study(8, 41, shares.append))
    assert shares[-1] == 1.0
    few = [result for name, result in results.items() if not name.endswith((".order", ".limit"))]
    assert len(few) > 20 and all(result.holds for result in few), [result for result in few if not result.holds]
    assert results["H.good_ground.available"].value >= 0.9
    assert max(results[f"B.{name}.rms"].value for name in ("synthetic", "real")) < 5.0


def test_the_judges_of_the_flights_can_say_no() -> None:
    flights = [Flight(GOOD, GOOD, (2.0, 1.0), (1.0, 9.0), (1.0, 9.0), 1.0)] * 40
    assert all(result.holds for result in judge.judge_flights(flights))
    worse = replace(GOOD, error_over_bound=(1.7, 1.6), nees=1.7, tracked=(9.0, 9.0, 4.0))
    failed = {
        r.id
        for r in judge.judge_flights([Flight(worse, GOOD, (40.0, 1.0), (9.0, 1.0), (9.0, 1.0), 0.1)] * 40)
        if not r.holds
    }
    assert failed == {
        "B.synthetic.limit",
        "B.synthetic.order",
        "N.synthetic",
        "I.synthetic.order",
        "E.within",
        "C.order",
        "D.order",
        "D.nees",
    }
    refused = replace(GOOD, nees=None)
    failed = {
        r.id
        for r in judge.judge_flights([Flight(GOOD, refused, None, (1.0, 9.0), (1.0, 9.0), 1.0)] * 40)
        if not r.holds
    }
    assert failed == {"N.real", "E.within"}


@pytest.mark.parametrize(("wrong", "holds"), [(3, True), (4, False)])
def test_a_fourth_confident_wrong_position_does_not_hold(wrong: int, holds: bool) -> None:
    right: dict[str, Confirmed | None] = dict.fromkeys(HOSTILE, Confirmed(5.0, 3.0))
    misled: dict[str, Confirmed | None] = {**right, "flat ground": Confirmed(31.0, 14.0)}
    near: dict[str, Confirmed | None] = {**right, "flat ground": Confirmed(29.0, 400.0)}
    results = by_id(judge.judge_hostile([misled] * wrong + [near] * 5 + [right] * 5))
    assert results["H.flat_ground"].value == wrong and results["H.flat_ground"].holds == holds
    nothing = by_id(judge.judge_hostile([dict.fromkeys(HOSTILE)] * 5))
    assert not nothing["H.good_ground.available"].holds


def test_a_covariance_or_a_search_that_is_off_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    assert all(result.holds for result in judge.judge_closed_forms())

    def too_large(metric: Array, east: Array, north: Array) -> tuple[Array, Array]:
        return np.zeros(2), 1.02 * np.diag([625.0, 225.0])

    monkeypatch.setattr(judge, "matching_covariance", too_large)
    monkeypatch.setattr(judge, "five_point_search", lambda metric, size, resolution: (np.zeros(2), 20))
    assert [result.holds for result in judge.judge_closed_forms()] == [False] * 5


def test_a_map_that_is_off_counts_only_where_it_can_be_detected() -> None:
    run: dict[str, Confirmed | None] = dict.fromkeys(HOSTILE, Confirmed(100.0, 400.0))
    failed = {result.id for result in judge.judge_hostile([run] * 4) if not result.holds}
    assert "H.map_100_m_off" in failed and "H.wrong_start" in failed
    assert not any("axes" in name for name in failed)


def test_pictures_are_drawn(tmp_path: Path) -> None:
    """The study of section 4.2 to 4.5 has a picture of each; two that cost little are written."""
    drawings = matching.drawings(41)
    assert set(drawings) == {"stairs", "obstacles", "gradients", "selection", "matrix", "drift", "banked"}
    for name in ("obstacles", "gradients"):
        write_figure(drawings[name], tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000


@pytest.mark.timeout(3600)
def test_the_whole_study_holds(scale: int, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the parts are judged above
        return
    assert main(["study", "matching"]) == 0, capsys.readouterr().out
