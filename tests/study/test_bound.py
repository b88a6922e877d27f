"""The study of sequential terrain filters: a judge that can say no, and few flights; the whole with --scale full."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fti.cli.main import main
from fti.plot_style import write_figure
from fti.study import StudyResult, bound
from fti.study.bound import plots
from fti.study.bound.experiment import CASES, FilterRun
from fti.study.bound.judge import judge

GOOD = FilterRun(inertial=1e4, error=16.0, bound=16.0, distance_2=2.0, end=(4.0, 2.0))


def not_held(runs: list[FilterRun]) -> set[str]:
    results = judge([dict.fromkeys(CASES, run) for run in runs])
    return {result.id.split(".")[0] for result in results if not result.holds}


def test_a_filter_that_is_off_the_bound_lost_or_too_sure_does_not_hold() -> None:
    assert not_held([GOOD] * 200) == set()
    assert not_held([replace(GOOD, error=1.3**2 * 16.0)] * 200) == {"B"}
    assert not_held([replace(GOOD, distance_2=2.6)] * 200) == {"N"}
    lost = replace(GOOD, error=5.1**2 * 16.0)
    assert not_held([GOOD] * 197 + [lost] * 3) == set()
    assert not_held([GOOD] * 195 + [lost] * 5) == {"L"}
    assert not_held([lost] * 200) == {"L"}


def test_wrong_positions_are_counted() -> None:
    runs = [replace(GOOD, end=end) for end in ((31.0, 14.0), (29.0, 99.0), (99.0, 13.0))]
    results = judge([dict.fromkeys(CASES, run) for run in runs])
    assert {result.value for result in results if result.id.startswith("W.")} == {1}


def test_few_flights_are_near_the_bound() -> None:
    results: dict[str, StudyResult] = {result.id: result for result in bound.study(2, bound.SEED, lambda share: None)}
    for name in CASES:
        assert results[f"L.{name}"].value == 0.0
        assert 0.3 < results[f"B.{name}"].value < 2.0
        assert "INS / filter / bound: " in results[f"B.{name}"].quantity


def test_the_picture_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "FLIGHTS", 1)
    write_figure(bound.drawings(bound.SEED)["errors"], tmp_path / "errors.png")
    assert (tmp_path / "errors.png").stat().st_size > 20_000


@pytest.mark.timeout(3600)
def test_the_whole_study_holds(scale: int, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the parts are judged above
        return
    assert main(["study", "bound"]) == 0, capsys.readouterr().out
