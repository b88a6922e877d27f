"""The study of the robust vertical channel: what is exact, few runs of the rest, and judges that can say no."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.nav.vertical.error_model import HEIGHT
from fti.nav.vertical.kalman_filter import GATE
from fti.study import robust_altimeter as study
from fti.study.robust_altimeter import experiment, flights, judge, plots
from fti.study.robust_altimeter.channel import (
    FAULT_STEPS,
    INSTANTS,
    ITERATIONS,
    PHYSICAL,
    PRINTED,
    ChannelVariant,
    estimate,
    expected_error,
    simulate,
)
from fti.study.robust_altimeter.flights import VerticalCase

RUNS = 250


def test_table_1_follows_from_kilometres_and_from_nothing_else() -> None:
    """Erratum H1: either half of the mistake alone does not give the printed 212.5 m."""
    assert expected_error(PRINTED, ITERATIONS) == pytest.approx((188.5, 19.4), abs=0.1)
    assert expected_error(PHYSICAL, ITERATIONS)[0] == pytest.approx(24.5, abs=0.1)
    for other in (
        PHYSICAL,
        ChannelVariant("metres", PHYSICAL.radius, PRINTED.noise),
        ChannelVariant("", PRINTED.radius, PHYSICAL.noise),
    ):
        mean, sd = expected_error(other, ITERATIONS)
        assert abs(judge.TABLE_1[-1] - mean) > 5.0 * sd


def test_the_drawn_error_is_the_expected_one() -> None:
    truth = simulate(PRINTED, 2000, np.random.default_rng(1), drawn=False, faulted=False)
    for k in INSTANTS:
        mean, sd = expected_error(PRINTED, k)
        assert truth.x[k, :, HEIGHT].mean() == pytest.approx(mean, abs=4.0 * sd / math.sqrt(2000))
        assert truth.x[k, :, HEIGHT].std() == pytest.approx(sd, rel=0.1)


@pytest.mark.parametrize("variant", [PRINTED, PHYSICAL], ids=lambda v: v.name)
def test_faults_are_kept_out(variant: ChannelVariant) -> None:
    results = judge.judge_faults(variant.name, experiment.fault_jumps(variant, RUNS, study.SEED), study.SEED)
    assert [result for result in results if not result.holds] == []


def test_a_filter_that_refuses_nothing_is_found_out() -> None:
    truth = simulate(PHYSICAL, RUNS, np.random.default_rng(2), drawn=False, faulted=True)
    plain = estimate(PHYSICAL, truth.z, math.inf)
    jumps = experiment.jumps(plain)
    results = judge.judge_faults("x", experiment.FaultJumps(jumps, jumps, plain.accepted), 1)
    assert [result.id for result in results if not result.holds] == ["T26.x.ratio", "T26.x.median", "T26.x.most"]
    assert results[-1].value == 100.0


def test_both_filters_know_how_wrong_they_are() -> None:
    found = experiment.consistency_scores(PHYSICAL, RUNS, study.SEED)
    results = [result for name, scores in found.items() for result in judge.judge_consistency(name, scores, study.SEED)]
    assert len(results) == 10
    assert [result for result in results if not result.holds] == []


def test_a_filter_that_thinks_too_well_of_itself_is_found_out() -> None:
    truth = simulate(PHYSICAL, RUNS, np.random.default_rng(3), drawn=True, faulted=False)
    channel_estimate = estimate(PHYSICAL, truth.z, GATE)
    vain = dataclasses.replace(
        channel_estimate,
        sd=channel_estimate.sd / 1.5,
        P=channel_estimate.P / 1.5**2,
        innovation=1.5 * channel_estimate.innovation,
    )
    results = judge.judge_consistency("x", experiment.scores(truth, vain), 1)
    assert {"x.least", "x.most", "x.nees", "x.nees_instants", "x.nis"} == {
        result.id for result in results if not result.holds
    }


def test_refusal_for_ever_never_comes_back() -> None:
    recovered = (experiment.recovered_runs(100, study.SEED, bound_s) for bound_s in (experiment.LOCKOUT_S, math.inf))
    bounded, ever = judge.judge_lockout(100, *recovered)
    assert bounded.holds
    assert ever.value == 0


def test_a_flight_is_held_by_the_altimeter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flights, "SECONDS", 240)
    monkeypatch.setattr(flights, "INSTANTS_S", (180, 240))
    aided = flights.fly(VerticalCase(1, 0))
    assert np.abs((aided.found - aided.alt)[aided.t > 10.0]).max() < 5.0 * aided.sd[aided.t > 10.0].max()
    assert aided.valid[aided.t > 1.0].mean() > 0.99
    alone = flights.fly(VerticalCase(1, 0, altimeter=False))
    assert alone.sd[-1] > 3.0 * aided.sd[-1]
    assert abs(alone.found[-1] - alone.alt[-1]) < 4.0 * alone.sd[-1]


def test_faults_stand_where_the_source_has_them() -> None:
    calm, faulted = (
        simulate(PHYSICAL, 200, np.random.default_rng(4), drawn=False, faulted=faulted) for faulted in (False, True)
    )
    differs = np.any(calm.z != faulted.z, axis=1)
    assert tuple(np.flatnonzero(differs).tolist()) == FAULT_STEPS


def test_pictures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fti.plot_style import write_figure

    monkeypatch.setattr(flights, "SECONDS", 20)
    monkeypatch.setattr(plots, "PLOT_RUNS", 20)
    drawings = study.drawings(5)
    for name in ("robust", "jumps", "flight"):
        write_figure(drawings[name], tmp_path / f"{name}.png")
    assert all(file.stat().st_size > 20_000 for file in tmp_path.iterdir())
    assert len(drawings) == 6


@pytest.mark.timeout(1800)
def test_the_whole_study_holds(scale: int, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the parts are judged above
        assert (study.RUNS, study.FLIGHTS) == (1000, 2)
        return
    assert main(["study", "robust-altimeter"]) == 0
    assert "T26.physical.most" in capsys.readouterr().out
