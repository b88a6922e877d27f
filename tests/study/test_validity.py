"""T20: the mix matches its description, validity sorts it, its judges can say no; the whole with --scale full."""

from __future__ import annotations

import dataclasses
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from fti.messages.reasons import Reason
from fti.plot_style import write_figure
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.study import REPORTED, validity
from fti.study.compensation import low_level
from fti.study.compensation.low_level import (
    Knowledge,
    Mix,
    add_cloud,
    fly,
    instruments,
    known_scene,
    make_country,
    models,
    orbit,
    predict,
    rolls,
)
from fti.study.statistics import mean_interval
from fti.study.validity.experiment import ValidityScore, reasons_by_variant, score_variant
from fti.study.validity.judge import judge_variant
from fti.terrain.landscape import Cover

SEED, POSES = 7, 40


@pytest.fixture(scope="module")
def mix() -> Mix:
    return fly(SEED, POSES)


def test_the_country_is_gentle_wooded_and_built_up() -> None:
    country = make_country(SEED)
    assert np.ptp(country.ground.finest.heights) == pytest.approx(10.0)
    assert np.mean(country.cover == Cover.FOREST) == pytest.approx(0.45, abs=0.02)
    assert 0.005 < np.mean(country.cover == Cover.BUILDING) < 0.05
    trees = country.canopy[country.cover == Cover.FOREST]
    assert (trees.min(), trees.max()) == (pytest.approx(10.0), pytest.approx(25.0, abs=0.1))


def test_the_mix_has_its_shares(mix: Mix) -> None:
    roll = np.degrees(np.abs(rolls(1000, np.random.default_rng(1))))
    assert np.count_nonzero(roll >= 10.0) == 300
    assert roll.max() < 50.0
    assert np.count_nonzero(np.abs(mix.roll) >= np.radians(10.0)) == 12
    assert mix.nadir.min() >= 40.0
    assert mix.nadir.max() <= 350.0
    down = mix.mats_nb[:, 2, 2]
    np.testing.assert_allclose(down, np.cos(mix.roll) * np.cos(mix.pitch), atol=1e-12)


def test_the_instruments_are_not_their_models(mix: Mix) -> None:
    radar, model = instruments(np.random.default_rng(1))["radar"], models()["radar"]
    assert isinstance(radar, RadarAltimeter)
    assert isinstance(model, RadarAltimeter)
    assert (radar.order, model.order) == (40, 20)
    assert radar.turn is not None
    predictions = predict(mix, Knowledge.ALL, SEED)
    assert np.std(mix.measured["laser"] - predictions["laser"].slant_range) == pytest.approx(0.1, rel=0.4)
    assert 0.3 < np.median(np.abs(mix.measured["radar"] - predictions["radar"].slant_range)) < 3.0


def test_what_is_known_has_the_errors_that_it_says(mix: Mix) -> None:
    moved = known_scene(mix, Knowledge.PLACE_ERROR, SEED).points_l - mix.points_l
    np.testing.assert_allclose(np.std(moved, axis=0), [10.0, 10.0, 2.0], rtol=0.35)
    mistaken = known_scene(mix, Knowledge.DEM_ERROR, SEED).surface.finest
    true = mix.country.surface.finest
    assert np.hypot(mistaken.east0 - true.east0, mistaken.north0 - true.north0) == pytest.approx(10.0)
    assert np.std(mistaken.heights - true.heights) == pytest.approx(1.5, rel=0.1)
    exact = known_scene(mix, Knowledge.ALL, SEED)
    assert exact.surface is mix.country.surface
    assert exact.points_l is mix.points_l


def test_the_same_seed_is_the_same_mix(mix: Mix) -> None:
    again = fly(SEED, POSES)
    for name in mix.measured:
        np.testing.assert_array_equal(again.measured[name], mix.measured[name])
    assert not np.array_equal(fly(SEED + 1, 4).points_l, mix.points_l[:4])


def test_validity_sorts_the_mix(mix: Mix) -> None:
    """Laser: roll alone refuses 30 %, and the residual is small.  A sensor with a 30 m error is always refused."""
    reasons = reasons_by_variant(mix, Knowledge.ALL, SEED)
    for name in mix.measured:
        scores = score_variant(mix.measured[name] - mix.nadir, mix.measured[name] - mix.nadir, reasons[name])
        assert scores.residual < 0.5 * scores.raw
        assert scores.excluded < 0.5
    assert score_variant(mix.nadir, mix.nadir, reasons["laser"]).share(Reason.ROLL) == pytest.approx(0.3)
    off = dataclasses.replace(mix, measured={name: ranges + 30.0 for name, ranges in mix.measured.items()})
    for name, refused in reasons_by_variant(off, Knowledge.ALL, SEED).items():
        assert all({Reason.DEVIATION, Reason.ROLL} & set(why) for why in refused), name


def test_the_plain_gate_lets_more_through_where_the_place_is_not_known(mix: Mix) -> None:
    reasons = reasons_by_variant(mix, Knowledge.PLACE_ERROR, SEED)
    narrowed, plain = (
        score_variant(mix.nadir, mix.nadir, reasons[name]).excluded for name in ("radar", "radar_plain_gate")
    )
    assert plain < narrowed


def test_a_cloud_is_not_taken_for_the_ground(mix: Mix) -> None:
    clouded = add_cloud(mix, SEED)
    error = clouded.measured["laser_in_cloud"] - mix.nadir
    reasons = reasons_by_variant(clouded, Knowledge.ALL, SEED)["laser_in_cloud"]
    answered = error < -20.0  # no tree is so high above its neighbours here
    silent = np.isnan(error)
    assert min(np.count_nonzero(answered), np.count_nonzero(silent)) > 0
    assert all(Reason.DEVIATION in reasons[k] for k in np.flatnonzero(answered))
    assert all(reasons[k][0] == Reason.NO_RETURN for k in np.flatnonzero(silent))
    scores = score_variant(error, error, reasons)
    assert scores.raw > 50.0**2
    assert scores.residual < 0.2**2 * scores.raw


def test_held_against_the_simulation_alone_the_radar_keeps_its_error(mix: Mix) -> None:
    """Table 7.20 as printed: sensor and simulation have the same error."""
    reasons = reasons_by_variant(mix, Knowledge.ALL, SEED)["radar_as_printed"]
    scores = score_variant(mix.measured["radar"] - mix.nadir, mix.measured["radar"] - mix.nadir, reasons)
    assert scores.residual > 0.8 * scores.raw


def _assessed(raw: float, residual: float, excluded: float) -> list[ValidityScore]:
    return [ValidityScore(raw, residual, excluded, Counter({Reason.ROLL: 10}), 100)] * 5


@pytest.mark.parametrize(("name", "limit"), [("laser", 0.35), ("radar", 0.55)])
def test_the_judges_can_say_no(name: str, limit: float) -> None:
    good = judge_variant(_assessed(100.0, 100.0 * (limit - 0.01) ** 2, 0.39), Knowledge.PLACE_ERROR, name, 1)
    assert [result.holds for result in good] == [True, True]
    bad = judge_variant(_assessed(100.0, 100.0 * (limit + 0.01) ** 2, 0.41), Knowledge.PLACE_ERROR, name, 1)
    assert [result.holds for result in bad] == [False, False]
    assert {result.id for result in bad} == {f"T20.{name}.place_error", f"T20.{name}.place_error.excluded"}
    results = judge_variant(_assessed(100.0, 100.0, 0.9), Knowledge.DEM_ERROR, name, 1)
    assert {result.target for result in results} == {REPORTED}


def test_nothing_left_is_not_good() -> None:
    errors = np.array([1.0, 2.0])
    nothing = score_variant(errors, errors, [(Reason.ROLL,), (Reason.ROLL, Reason.DEVIATION)])
    assert (nothing.raw, nothing.excluded, nothing.reasons[Reason.ROLL]) == (2.5, 1.0, 2)
    assert not any(result.holds for result in judge_variant([nothing] * 3, Knowledge.ALL, "radar", 1))


def test_the_interval_of_a_mean_holds_it_as_often_as_it_says(scale: int) -> None:
    rng, inside, n = np.random.default_rng(4), 0, 60 * scale
    for _ in range(n):
        low, high = mean_interval(rng.normal(3.0, 1.0, 40), rng)
        inside += low <= 3.0 <= high
    assert inside / n > 0.85  # 0.95 less 2.5 sigma of 60 and what percentiles of 40 lose


def test_the_flight_to_look_at_stays_over_the_country() -> None:
    flight = orbit(SEED)
    assert np.abs(flight.points_l[:, :2]).max() < low_level.REACH_M
    assert np.isfinite(flight.measured["radar"]).all()
    assert np.degrees(np.abs(flight.roll)).max() == pytest.approx(50.0, abs=0.5)


def test_the_whole_study_holds(scale: int, tmp_path: Path) -> None:
    figures = validity.drawings(validity.SEED)
    if scale == 1:
        assert set(figures) == {"laser", "radar", "reasons"}
        return
    results = validity.study(validity.RUNS, validity.SEED, lambda share: None)
    assert [result for result in results if not result.holds] == []
    for name, draw in figures.items():
        write_figure(draw, tmp_path / f"{name}.png")
