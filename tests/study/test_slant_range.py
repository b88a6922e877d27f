"""The slant-range study: flights fly as planned, its judges can say no; the whole with --scale full."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from fti.constants import FOOT, STANDARD_GRAVITY
from fti.hil.flight.leg_flight import MAX_LOAD, STEP_S, TRIM_AOA, FlightLeg, track, turn
from fti.plot_style import write_figure
from fti.study import slant_range
from fti.study.slant_range import judge, scenarios
from fti.study.slant_range.experiment import GROUNDS, AltimeterFlight, Run, fly
from fti.study.slant_range.judge import ORDERINGS
from fti.study.statistics import min_positive, ratio_interval, sign_test
from fti.terrain.terrain import Terrain


def test_a_turn_is_coordinated_and_ends_on_its_heading() -> None:
    legs = [
        FlightLeg(10.0, 60.0),
        turn(np.radians(-90.0), np.radians(30.0), 60.0),
        FlightLeg(10.0, 60.0, path=np.radians(3.0)),
    ]
    commanded = track(legs, np.radians(20.0), 4.0, end=(100.0, 200.0))
    flight = commanded.flight_at(500.0 + commanded.height_gain, STEP_S)
    assert commanded.heading[-1] == pytest.approx(np.radians(-70.0), abs=1e-9)
    assert flight.origins_l[-1, :2] == pytest.approx([100.0, 200.0])
    assert flight.roll.min() == pytest.approx(np.radians(-30.0), abs=1e-9)
    rate = np.gradient(commanded.heading, STEP_S)
    np.testing.assert_allclose(np.tan(flight.roll), rate * 60.0 / STANDARD_GRAVITY, atol=1e-3)
    np.testing.assert_allclose(np.gradient(flight.origins_l, STEP_S, axis=0)[1:-1], flight.vels_l[1:-1], atol=0.02)
    assert flight.pitch[-1] == pytest.approx(np.radians(6.0), abs=1e-3)  # path and angle of attack
    forward = flight.mats_lb[:, :, 0]
    level = np.hypot(forward[:, 0], forward[:, 1])
    np.testing.assert_allclose(forward[:, 0] / level, np.sin(flight.heading), atol=1e-12)


def test_the_nose_is_up_in_a_bank_and_down_past_the_vertical() -> None:
    for roll, load in ((60.0, 2.0), (95.0, MAX_LOAD)):
        commanded = track([FlightLeg(5.0, 200.0, extra=np.radians(roll))], 0.0, 1.0)
        flight = commanded.flight_at(np.full_like(commanded.t, 100.0), 1.0)
        assert flight.roll == pytest.approx(np.radians(roll))
        assert flight.pitch == pytest.approx(TRIM_AOA * load * np.cos(np.radians(roll)))


def level_ground(name: str, seed: int, *, extent_m: float, cell_m: float) -> Terrain:
    return Terrain.from_array(np.zeros((3, 3)), extent_m, east0=-extent_m, north0=-extent_m)


def test_the_approach_comes_down_from_8000_ft_in_three_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenarios, "synthetic_terrain", level_ground)
    for seed in range(5):
        flight = scenarios.approach(seed, 0.5).flight
        assert flight.origins_l[-1] == pytest.approx([0.0, 0.0, 15.0], abs=40.0)
        assert np.abs(np.sin(flight.heading[-1])) < 1e-6
        assert 7500.0 < (flight.origins_l[0, 2] + 500.0) / FOOT < 8500.0  # the valley lies at 500 m
        rolled = np.abs(flight.roll) > np.radians(5.0)
        assert np.count_nonzero(np.diff(rolled.astype(int)) == 1) == 3
        assert np.degrees(np.abs(flight.roll).max()) < 35.0


def test_the_same_seed_flies_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenarios, "synthetic_terrain", level_ground)
    first, again, other = (scenarios.low_level(seed, 1.0).flight.origins_l for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


def test_sign_tests_count_as_the_binomial_does() -> None:
    assert sign_test(10, 10) == pytest.approx(2.0**-10)
    assert sign_test(9, 10) == pytest.approx(11 * 2.0**-10)
    assert min_positive(15, 0.01 / 12) == 14
    assert min_positive(3, 0.01) == 3  # so few can never show it: all of them
    assert len(ORDERINGS) == 12


def test_the_interval_holds_the_ratio_as_often_as_it_says(scale: int) -> None:
    rng, inside, n = np.random.default_rng(4), 0, 60 * scale
    for _ in range(n):
        above, below = rng.exponential(1.0, 40), rng.exponential(4.0, 40)
        low, high = ratio_interval(above, below, rng)
        inside += low <= 0.5 <= high
    assert inside / n > 0.85  # 0.95 less 2.5 sigma of 60 and what percentiles of 40 lose


def swapped(run: Run) -> Run:
    """Exchanged beams must fail."""
    return {
        key: dataclasses.replace(
            record, measured={**record.measured, "narrow": record.measured["wide"], "wide": record.measured["narrow"]}
        )
        for key, record in run.items()
    }


def test_low_over_hills_the_orderings_hold_and_can_fail() -> None:
    scenario = scenarios.low_level(slant_range.SEED, 0.8)
    run: Run = {("low_level", ground): fly(scenario.flight, scenario.ground(ground)) for ground in GROUNDS}
    orderings = {
        o.id: o for o in ORDERINGS if o.id in {"flat.large", "rough.large", "rough.level"} or "low_level" in o.id
    }
    assert len(orderings) == 6
    assert [name for name, ordering in orderings.items() if not ordering.holds(run)] == []
    wrong = swapped(run)
    assert [name for name in ("flat.large", "rough.large", "rough.level") if orderings[name].holds(wrong)] == []
    assert judge._pencil_error(run["low_level", "flat"]) < judge.EXACT
    assert judge._pencil_error(_longer(run["low_level", "flat"], 1e-6)) > judge.EXACT


def _longer(record: AltimeterFlight, metres: float) -> AltimeterFlight:
    return dataclasses.replace(record, measured={name: ranges + metres for name, ranges in record.measured.items()})


@pytest.mark.timeout(900)
def test_the_whole_study_holds(scale: int, tmp_path: Path) -> None:
    figures = slant_range.drawings(slant_range.SEED)
    if scale == 1:
        assert len(figures) == 6
        return
    results = slant_range.study(slant_range.RUNS, slant_range.SEED, lambda share: None)
    assert [result for result in results if not result.holds] == []
    for name, draw in figures.items():
        write_figure(draw, tmp_path / f"{name}.png")
