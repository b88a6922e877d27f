"""The study of the closest point of an interferometric altimeter: its judge can say no; the whole with --scale full."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.nav.interferometric import closest_point
from fti.nav.interferometric.closest_point import PointMethod
from fti.plot_style import write_figure
from fti.study import StudyResult, ira_closest_point
from fti.study.ira_closest_point import experiment, plots
from fti.study.ira_closest_point.experiment import MIN_DIFFERENCES_M, CrabRun, FixErrors
from fti.study.ira_closest_point.flight import CRABS_DEG, SAMPLES
from fti.study.ira_closest_point.geometry import conventional_shift, largest_error
from fti.study.ira_closest_point.judge import judge

CONVENTIONAL, PROPOSED = PointMethod.CONVENTIONAL, PointMethod.PROPOSED


def run(rng: np.random.Generator, conventional: float, proposed: float = 1.0) -> CrabRun:
    """RMS at the largest crab over that at none; linear in between, with a scatter of 5 %."""
    last = {PointMethod.SIMPLE: 1.0, CONVENTIONAL: conventional, PROPOSED: proposed}
    errors = {
        (crab, method, least): FixErrors(
            6.0 * (1.0 + (last[method] - 1.0) * crab / CRABS_DEG[-1] + 0.05 * rng.standard_normal()) ** 2, 1.0, 6
        )
        for crab in CRABS_DEG
        for method in PointMethod
        for least in MIN_DIFFERENCES_M
    }
    return CrabRun(errors, {crab: np.full(SAMPLES, 0.5 * crab) for crab in CRABS_DEG}, np.zeros(SAMPLES))


def not_held(conventional: float, proposed: float) -> set[str]:
    rng = np.random.default_rng(3)
    results = judge([run(rng, conventional, proposed) for _ in range(100)])
    assert len({result.id for result in results}) == len(results)
    return {result.id for result in results if not result.holds}


def test_a_judge_that_can_say_no() -> None:
    assert not_held(1.6, 1.0) == set()
    assert not_held(1.6, 1.15) == {"T24.proposed.high"}
    assert not_held(1.6, 0.85) == {"T24.proposed.low"}
    assert not_held(1.15, 1.0) == {"T24.conventional"}
    assert not_held(1.0, 1.0) == {"T24.conventional", "T24.trend"}


def test_geometry_closes_and_the_shift_is_that_of_the_formula() -> None:
    assert largest_error(10_000, 1) < 1e-9
    crab, look = np.radians(10.0), np.radians(15.0)
    expected = 5600.0 * (np.tan(np.arcsin(np.sin(look) / np.cos(crab))) - np.tan(look))
    assert conventional_shift(5600.0, look, crab) == pytest.approx(expected, abs=1e-9)


def test_a_domain_that_is_too_small_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closest_point, "MAX_OFF_BELLY", np.radians(70.0))
    assert largest_error(10_000, 1) == np.inf


def test_one_run() -> None:
    """The same samples and random numbers at every crab angle: without crab both forms agree to decimetres."""
    found = experiment.fly(ira_closest_point.SEED)
    first = {method: found.errors[0.0, method, 0.0] for method in PointMethod}
    assert {errors.fixes for (_, _, least), errors in found.errors.items() if least == 0.0} == {6}
    assert first[CONVENTIONAL].matched == pytest.approx(first[PROPOSED].matched, rel=0.3)
    assert np.sqrt(first[PROPOSED].matched / 6) < 15.0
    assert np.sqrt(first[PointMethod.SIMPLE].matched / 6) > 150.0  # 280 m along the track, at the edge of the search
    medians = [float(np.median(found.differences[crab])) for crab in CRABS_DEG]
    assert medians == sorted(medians)
    assert medians[0] < 0.5 < medians[-1]  # none is unknown
    assert np.degrees(np.abs(found.looks)).max() < 25.0


def test_results_name_the_look_angles() -> None:
    rng = np.random.default_rng(4)
    results: dict[str, StudyResult] = {result.id: result for result in judge([run(rng, 1.5) for _ in range(5)])}
    assert "deg; the last" in results["T23.look"].quantity
    assert results["T23.share"].value == 1.0
    assert {type(result.holds) for result in results.values()} == {bool}
    assert {type(result.value) for result in results.values()} == {float}


def test_pictures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "FLIGHTS", 1)
    for name, draw in ira_closest_point.drawings(ira_closest_point.SEED).items():
        write_figure(draw, tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000


@pytest.mark.timeout(3600)
def test_the_whole_study_holds(scale: int, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the parts are judged above
        return
    assert main(["study", "ira-closest-point"]) == 0, capsys.readouterr().out
