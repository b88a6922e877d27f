"""The study of the multi-beam altimeter: a short run, and judges that can say no."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fti.study import StudyResult
from fti.study.multibeam import aided, experiment, judge
from fti.study.multibeam.aided import AIDS, CASES, AidedErrors, PositionFilter, gnss_sd, motion
from fti.study.multibeam.experiment import CHOICES, BeamResult, GroundResult
from fti.study.multibeam.flights import ANGLES_DEG, BEAM_SETS, COLUMNS

UNCERTAIN = {1: [(2.0, 2.0)], 9: [(0.5, 0.5)]}
CHOSEN = dict(zip(CHOICES, ([9.0], [8.0], [1.0], [1.0]), strict=True))


def good_run() -> GroundResult:
    beams = {n: BeamResult((9.0 / n,), (1.0,), (1.0,), (9.0 / n,)) for n in BEAM_SETS}
    errors = AidedErrors(dict(zip(AIDS, (9.0, 3.0, 1.0), strict=True)), dict.fromkeys(AIDS, 1.0))
    return GroundResult(beams, beams, UNCERTAIN, CHOSEN, CHOSEN, dict.fromkeys(CASES, errors))


def failed(run: GroundResult) -> set[str]:
    return {result.id for result in judge.judge_runs([run] * 20) if not result.holds}


def test_a_short_run_orders_beams_choices_and_aids(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiment, "FLIGHTS_PER_GROUND", 2)
    monkeypatch.setattr(aided, "DURATION_S", 45)
    monkeypatch.setattr(aided, "PHASES", ((30, 45, 4.0),))
    runs = [experiment.run(seed) for seed in (46, 47)]
    results = {result.id: result for result in judge.judge_runs(runs)}
    assert len(results) == len(judge.judge_runs(runs))
    tests = [r for name, r in results.items() if name.endswith(".order") or name == "A.outage.one"]
    assert len(tests) == judge.TESTS  # so few runs are never significant

    def value(name: str) -> float:
        return results[name].value

    for name in ("synthetic", "real"):
        assert value(f"M.{name}.9") < value(f"M.{name}.3") < value(f"M.{name}.1")
        assert value(f"M.{name}.9.bound") < value(f"M.{name}.5.bound") < value(f"M.{name}.1.bound")
    assert value("E.9") < value("E.1")
    assert value("S.tracked.switched") < value("S.tracked.in_turn")


def test_the_sets_of_beams_are_columns_of_all_angles() -> None:
    assert len(ANGLES_DEG) == 11
    assert [ANGLES_DEG[column] for column in COLUMNS[5]] == [-30.0, -15.0, 0.0, 15.0, 30.0]


def test_satellites_follow_the_tables_of_the_source() -> None:
    """Tables 7.4 and 7.5."""
    seconds = (0, 29, 30, 39, 40, 80, 99, 100, 170, 199, 200)
    degraded = [gnss_sd("degraded", s) for s in seconds]
    assert degraded == [2.0, 2.0, 4.0, 4.0, 2.0, 5.0, 5.0, 2.0, 6.0, 6.0, 2.0]
    assert [gnss_sd("outage", s) is None for s in seconds] == [sd != 2.0 for sd in degraded]


def test_the_filter_states_its_error() -> None:
    """Measurements of now, and of 1.5 s ago: error^2 over variance is 1 on average."""
    rng, ratios = np.random.default_rng(1), []
    step, process = (np.kron(matrix, np.eye(2)) for matrix in motion(1.5))
    root = np.linalg.cholesky(process)
    for _ in range(40):
        kalman = PositionFilter()
        truth = rng.multivariate_normal(np.zeros(4), kalman.cov[:4, :4])
        for _ in range(20):
            kalman.keep()
            kept, truth = truth[:2], step @ truth + root @ rng.standard_normal(4)
            kalman.predict(1.5)
            kalman.update(kept + 0.3 * rng.standard_normal(2), 0.09 * np.eye(2), of_kept=True)
            kalman.update(truth[:2] + 3.0 * rng.standard_normal(2), 9.0 * np.eye(2))
        off = truth - kalman.state[:4]
        ratios.append(off @ np.linalg.solve(kalman.cov[:4, :4], off) / 4.0)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.35)


def test_good_runs_hold_and_each_target_can_fail() -> None:
    run = good_run()
    assert failed(run) == set()
    beams = run.synthetic
    wide = {**beams, 5: replace(beams[5], over_bound=(1.7,), nees=(1.7,))}
    assert failed(replace(run, synthetic=wide)) == {"B.synthetic.5.limit", "N.synthetic.5"}
    assert failed(replace(run, real={**beams, 9: beams[1]})) == {"M.real.order"}
    assert failed(replace(run, uncertain={1: UNCERTAIN[1], 9: [(40.0, 1.0)]})) == {"E.9.within", "E.order"}
    assert failed(replace(run, uncertain={1: [], 9: UNCERTAIN[9]})) == {"E.1.within"}
    assert failed(replace(run, chosen={**CHOSEN, "switched": [9.5]})) == {"S.order"}
    assert failed(replace(run, tracked={**CHOSEN, "switched": [8.5]})) == {"S.tracked.order"}
    nothing = AidedErrors(dict.fromkeys(AIDS, 9.0), dict.fromkeys(AIDS, 0.1))
    assert failed(replace(run, aided=dict.fromkeys(CASES, nothing))) == {
        "A.degraded.nees",
        "A.outage.nees",
        "A.outage.one",
        "A.outage.order",
        "A.degraded.order",
    }


def test_a_study_result_names_its_number_of_runs() -> None:
    results: list[StudyResult] = judge.judge_runs([good_run()] * 20)
    assert any("20 runs" in result.quantity for result in results)
