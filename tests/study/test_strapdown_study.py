"""The study of the strapdowns: minutes close as the hour does, its judges can say no; the whole with --scale full."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.hil.flight.random_routes import calm_flight
from fti.hil.sensors.inertial import specific_force_b
from fti.nav.inertial.strapdown_fast import integrate_fast
from fti.plot_style import write_figure
from fti.study import strapdown
from fti.study.strapdown import plots
from fti.study.strapdown.experiment import s_turn_errors
from fti.study.strapdown.judge import judge_live, judge_turns
from fti.study.trajectory import experiment
from fti.study.trajectory.experiment import Closure, close


@pytest.fixture(scope="module")
def minutes() -> Closure:
    return close(calm_flight(np.random.default_rng(4), 300.0), 0.01, 300.0, integrate_fast)


def test_five_calm_minutes_close_within_a_tenth_of_a_millimetre(minutes: Closure) -> None:
    assert minutes.horizontal < 1e-4
    assert minutes.vertical < 1e-4
    assert all(result.holds for result in judge_live([minutes], [minutes]))


def test_half_a_step_of_coriolis_would_be_seen(minutes: Closure, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was wrong once: 4e-9 m/s^2 are 0.2 mm in five minutes, and 0.3 m in an hour."""
    monkeypatch.setattr(experiment, "specific_force_b", lambda state: specific_force_b(state) + 4e-9)
    closure = close(calm_flight(np.random.default_rng(4), 300.0), 0.01, 300.0, integrate_fast)
    assert closure.horizontal + closure.vertical > minutes.horizontal + minutes.vertical + 1e-4


def test_the_judge_says_no(minutes: Closure) -> None:
    worse = dataclasses.replace(minutes, pos_n=minutes.pos_n + np.array([0.2, 0.0, 2.0]))
    refused = {result.id for result in judge_live([minutes, worse], [minutes]) if not result.holds}
    assert refused == {"T12.calm_horizontal", "T12.calm_vertical"}
    errors = {"high order": np.array([16.0, 1.0]), "live": np.array([3.4, 1.0])}
    assert [result.holds for result in judge_turns([errors])] == [True, False]


def test_the_error_after_s_turns_falls_with_the_step(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(experiment, "TURNS_S", 200.0)
    errors = s_turn_errors(5, 0)
    assert all(result.holds for result in judge_turns([errors]))
    write_figure(lambda: plots.steps(errors), tmp_path / "steps.png")
    assert (tmp_path / "steps.png").stat().st_size > 20_000


def test_the_hour_is_drawn(minutes: Closure, tmp_path: Path) -> None:
    write_figure(lambda: plots.hour(minutes), tmp_path / "hour.png")
    assert (tmp_path / "hour.png").stat().st_size > 20_000


@pytest.mark.timeout(900)
def test_the_whole_study_holds(scale: int, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the parts are judged above
        assert set(strapdown.drawings(strapdown.SEED)) == {"steps", "live"}
        return
    assert main(["study", "strapdown"]) == 0
    assert "T12.calm_horizontal" in capsys.readouterr().out
