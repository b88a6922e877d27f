"""The study of an interferometric altimeter in a particle filter: its judge can say no; the whole with --scale full."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.plot_style import write_figure
from fti.study import ira_particle_filter
from fti.study.ira_particle_filter import fine_map, plots
from fti.study.ira_particle_filter.experiment import (
    CORRIDOR_M,
    ELEVATION_SD_M,
    HEIGHT_M,
    KINDS,
    MODELS,
    SAMPLES,
    STARTS_M,
    FilterErrors,
    fly,
    make_ground,
    measure,
)
from fti.study.ira_particle_filter.judge import judge

GOOD = {"radar": 80.0, "nadir": 30.0, "typical": 30.0, "proposed": 25.0}


def not_held(**levels: float) -> set[str]:
    """Of 100 runs with these RMS [m], and a scatter of 10 % of the squares."""
    rng, rms = np.random.default_rng(2), {**GOOD, **levels}

    def run() -> dict[tuple[float, str], FilterErrors]:
        return {
            (start, name): FilterErrors(
                np.full(SAMPLES, rms.get(name, 25.0) ** 2 * (1.0 + 0.1 * rng.standard_normal())),
                np.full(SAMPLES, 400.0),
            )
            for start in STARTS_M
            for name in MODELS
        }

    fine = {
        (increment, name): FilterErrors(np.full(SAMPLES, rms.get(name, 25.0) ** 2), np.full(SAMPLES, 4.0))
        for increment in fine_map.INCREMENTS_M
        for name in fine_map.MODELS
    }
    results = judge({kind: [run() for _ in range(100)] for kind in KINDS}, [fine] * 25)
    assert len({result.id for result in results}) == len(results)
    assert {type(result.holds) for result in results} == {bool}
    assert {type(result.value) for result in results} == {float}
    return {result.id for result in results if not result.holds}


def test_a_judge_that_can_say_no() -> None:
    assert not_held() == set()
    radar, far = {"T27.smooth.p", "T27.rough.p"}, {"T27.smooth.far.p", "T27.rough.far.p"}
    assert not_held(proposed=30.0) == radar | far
    assert not_held(nadir=24.0) == radar
    assert not_held(typical=25.0) == far | {"T27.rough.typical"}


def test_predicted_ranges_cover_the_corridor() -> None:
    surfaces = make_ground("rough", 1)
    apparent = surfaces.apparent
    assert np.isfinite(apparent.heights).all()
    assert abs(apparent.east0) >= CORRIDOR_M
    below = surfaces.terrain.up(0.0, 0.0)
    column, row = apparent.places(np.zeros(1), np.zeros(1))
    seen = apparent.heights[round(row[0]), round(column[0])]
    assert below - 5.0 < seen < surfaces.posts.heights.max()  # the nearest point is not farther than the one below
    assert seen < HEIGHT_M


def test_a_run_of_each_kind() -> None:
    for kind in KINDS:
        found = fly((kind, 40))
        for start in STARTS_M:
            errors = {name: np.sqrt(found[start, name].error[50:].mean()) for name in MODELS}
            assert errors["proposed"] < 150.0
            assert errors["proposed.matched"] < 150.0
            bound = found[start, "proposed"].bound
            assert 3.0 < np.sqrt(bound[-1]) < np.sqrt(bound[0])
        assert found[100.0, "proposed"].error.shape == (SAMPLES,)


def test_a_run_over_the_fine_map() -> None:
    """Slower drift, smaller error and bound; the bound knows the sigma of the range."""
    found = fine_map.fly(40)
    bounds = [np.sqrt(found[increment, "proposed"].bound[50:].mean()) for increment in fine_map.INCREMENTS_M]
    assert bounds == sorted(bounds, reverse=True)
    assert np.sqrt(found[0.1, "proposed"].error[50:].mean()) < 20.0
    assert make_ground("fine", 10).posts.cell_m == 12.0


def test_heights_have_the_errors_of_the_source() -> None:
    """15 m of the height below contain 10 m, 3 m and the elevation, which the measured point has, too."""
    ground = make_ground("smooth", 3)
    flights = [measure(ground.terrain, np.random.default_rng(number), ELEVATION_SD_M) for number in range(40)]
    below = [found.below - ground.terrain.up(*found.true.T) for found in flights]
    places = [(found.true + found.point).T for found in flights]
    at_point = [found.at_point - ground.terrain.up(*place) for found, place in zip(flights, places, strict=True)]
    elevation = [found.in_map - found.apparent for found in flights]
    assert np.std(below) == pytest.approx(15.0, rel=0.05)
    assert np.std(elevation) == pytest.approx(math.sqrt(15.0**2 - 10.0**2 - 3.0**2), rel=0.05)
    assert np.std(at_point) == pytest.approx(math.sqrt(4.54**2 + 3.0**2 + 116.0), rel=0.05)


def test_the_picture_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plots, "RUNS", 1)
    write_figure(ira_particle_filter.drawings(ira_particle_filter.SEED)["errors"], tmp_path / "errors.png")
    assert (tmp_path / "errors.png").stat().st_size > 20_000


@pytest.mark.timeout(3600)
def test_the_whole_study_holds(scale: int, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the parts are judged above
        return
    assert main(["study", "ira-particle-filter"]) == 0, capsys.readouterr().out
