"""The study of trajectories: ten minutes close as the hour does, its judges can say no; the whole with --scale full."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.geodesy.gravity import normal_gravity
from fti.hil.flight.random_routes import random_flight
from fti.hil.sensors import inertial
from fti.study import trajectory
from fti.study.trajectory import drawings, experiment
from fti.study.trajectory.experiment import Closure, close, fit_flight, s_turn_errors
from fti.study.trajectory.judge import judge_closures, judge_fits

TEN_MINUTES = 600.0


@pytest.fixture(scope="module")
def ten_minutes() -> Closure:
    return close(random_flight(np.random.default_rng(4), TEN_MINUTES), 0.01, TEN_MINUTES)


def test_ten_minutes_close_within_micrometres(ten_minutes: Closure) -> None:
    assert ten_minutes.horizontal < 1e-6
    assert ten_minutes.vertical < 1e-6
    assert ten_minutes.velocity < 1e-8
    assert np.rad2deg(ten_minutes.angle.max()) < 1e-9
    assert [result.holds for result in judge_closures([ten_minutes])] == [True] * 4


@pytest.mark.parametrize("wrong", [1.0 + 1e-9, 1.0 - 1e-9])
def test_data_that_are_wrong_by_a_billionth_do_not_close(wrong: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A gravity difference between simulation and integration that causes half a millimetre at once."""
    monkeypatch.setattr(inertial, "normal_gravity", lambda lat, alt: wrong * normal_gravity(lat, alt))
    closure = close(random_flight(np.random.default_rng(4), TEN_MINUTES), 0.01, TEN_MINUTES)
    assert closure.vertical > 1e-3


def test_who_flies_the_other_way_round_the_earth_does_not_close(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inertial, "transport_rate", lambda lat, alt, vel_n: np.zeros_like(vel_n))
    closure = close(random_flight(np.random.default_rng(4), 100.0), 0.01, 100.0)
    assert not any(result.holds for result in judge_closures([closure]) if result.id != "T12.vertical")


def test_the_error_after_s_turns_falls_with_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiment, "TURNS_S", 200.0)
    errors = s_turn_errors(5, 0)
    assert (errors[:-1] / errors[1:]).min() > 3.5
    assert errors[0] > 1e-6  # it is not rounding that is compared


def test_all_flights_count_for_fits() -> None:
    flight_fit = fit_flight(5, 0)
    results = {result.id: result for result in judge_fits([flight_fit])}
    assert all(result.holds for result in results.values())
    assert results["fit.spline_most"].value == flight_fit.spline_m.max()
    worse = dataclasses.replace(flight_fit, spline_m=10.0 * flight_fit.spline_m, filter_m=10.0 * flight_fit.filter_m)
    refused = {result.id for result in judge_fits([worse]) if not result.holds}
    assert refused == {"fit.spline", "fit.filter"}


def test_the_worst_counts_for_closures(ten_minutes: Closure) -> None:
    worst = dataclasses.replace(ten_minutes, pos_n=ten_minutes.pos_n + np.array([0.0, 2e-3, 0.0]))
    refused = {result.id for result in judge_closures([ten_minutes, worst]) if not result.holds}
    assert refused == {"T12.horizontal"}


def test_pictures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ten_minutes: Closure) -> None:
    from fti.plot_style import write_figure

    monkeypatch.setattr(trajectory, "close_hour", lambda seed, run: ten_minutes)
    for name, draw in drawings(5).items():
        write_figure(draw, tmp_path / f"{name}.png")
    assert {file.name for file in tmp_path.iterdir()} == {"fit.png", "fit-errors.png", "closure.png"}
    assert all(file.stat().st_size > 20_000 for file in tmp_path.iterdir())


def test_the_flights_are_all_over_the_world_and_repeat_themselves() -> None:
    places = [random_flight(np.random.default_rng([9, k]), 60.0).state([0.0]) for k in range(8)]
    assert np.ptp([float(place.lat[0]) for place in places]) > 1.0
    again = random_flight(np.random.default_rng([9, 0]), 60.0).state([0.0])
    assert again.lat[0] == places[0].lat[0]


@pytest.mark.timeout(900)
def test_the_whole_study_holds(scale: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the parts are judged above
        assert set(drawings(trajectory.SEED)) == {"fit", "fit-errors", "closure"}
        return
    assert main(["study", "trajectory", "--plots", str(tmp_path)]) == 0
    assert "T12.horizontal" in capsys.readouterr().out
