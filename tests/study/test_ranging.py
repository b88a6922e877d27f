"""The ranging study: its parts hold, and its judges can say no; the whole with --scale full."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from fti.plot_style import write_figure
from fti.ranging.laser import Laser
from fti.ranging.sensor import Poses
from fti.study import DrawFigure, StudyResult, ranging
from fti.study.ranging import experiment, judge, level_run, sweep
from fti.study.ranging.level_run import LevelRun
from fti.terrain.dem_error import DemError
from fti.terrain.terrain import Terrain


def holds_by_id(results: list[StudyResult]) -> dict[str, bool]:
    return {result.id: result.holds for result in results}


def test_closed_forms_hold() -> None:
    found = {result.id: result for result in [*judge.pulses(), *judge.beam(), *judge.beats()]}
    assert all(result.holds for result in found.values())
    assert found["T3.radar"].value == pytest.approx(14.990, abs=5e-4)
    assert found["T3.laser"].value == pytest.approx(1.499, abs=5e-4)
    assert found["T6.rays"].value == 751
    assert found["T4.range_ssb"].value == pytest.approx(199.86, abs=5e-3)


def test_a_longer_pulse_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judge, "PULSES_S", (101e-9, 10e-9))
    assert holds_by_id(judge.pulses()) == {"T3.radar": False, "T3.laser": True, "T3.rate": True}


def test_ground_that_is_not_level_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiment, "LEVEL_HEIGHT_M", experiment.LEVEL_HEIGHT_M + 1e-6)
    assert holds_by_id(judge.beam())["T5"] is False  # 1 um of 100 m is 1e-8


def test_the_greatest_height_falls_with_the_cosine_of_the_roll() -> None:
    """Eq. 2.84 as printed, d_max = h cos(roll), would let 501 m through: 501 cos 60 deg is only 250 m."""
    roll, level = np.radians(60.0), Terrain.from_array(np.zeros((3, 3)), 2000.0, east0=-2000.0, north0=-2000.0)
    assert sweep.highest(roll, 1000.0) == pytest.approx(500.0)
    heights = [499.0, 501.0]
    origins = [[0.0, 0.0, height] for height in heights]
    mats = np.tile([[0.0, np.cos(roll), np.sin(roll)], [1.0, 0.0, 0.0], [0.0, np.sin(roll), -np.cos(roll)]], (2, 1, 1))
    valid = Laser(max_range=1000.0).measure(level, Poses.stationary(origins, mats)).valid
    assert valid.tolist() == [height <= sweep.highest(roll, 1000.0) for height in heights] == [True, False]
    assert 501.0 * np.cos(roll) < 1000.0


def test_the_beams_differ_as_the_figure_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep, "ORDER", 20)
    monkeypatch.setattr(judge, "HEIGHTS_M", (100.0,))
    for module in (sweep, judge):
        monkeypatch.setattr(module, "ROLLS_DEG", np.arange(0.0, 75.1, 5.0))
    assert set(holds_by_id(judge.attitude()).values()) == {True}
    swapped = {"narrow": sweep.ANTENNAS["wide"], "wide": sweep.ANTENNAS["narrow"]}
    monkeypatch.setattr(sweep, "ANTENNAS", swapped)
    assert set(holds_by_id(judge.attitude()).values()) == {False}


def test_without_errors_the_model_is_the_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(level_run, "DSM_ERROR", DemError())
    monkeypatch.setattr(level_run, "NOISE_M", 0.0)
    monkeypatch.setattr(level_run, "STEP_M", 80.0)
    monkeypatch.setattr(level_run, "random_turn", lambda rng: np.eye(3))
    monkeypatch.setattr(level_run, "TRUTH_ORDER", level_run.MODEL_ORDER)
    world, rng = level_run.make_site(1), np.random.default_rng(1)
    run = level_run.fly(world, level_run.level(world, rng), "wide", rng)
    np.testing.assert_allclose(run.model, run.measured, rtol=0.0, atol=1e-9)
    assert np.sqrt(run.mean_squares()[1]) > 1.0  # trees and houses beside the track


def drawn(model_error: float, terrains: int = 20) -> list[dict[tuple[str, str], LevelRun]]:
    """Level runs whose nadir errs by 1 m and whose model by so much, in RMS."""
    rng, zero = np.random.default_rng(3), np.zeros(100)
    runs = []
    for _ in range(terrains):
        nadir, model = rng.normal(0.0, 1.0, 100), rng.normal(0.0, model_error, 100)
        runs.append({("level", "wide"): LevelRun(zero, zero, nadir, zero, model, zero)})
    return runs


def test_the_bound_of_the_ratio_judges_not_the_ratio() -> None:
    assert holds_by_id(judge.judge_level_runs(drawn(0.40), seed=1)) == {"T1.level": True}
    close = judge.judge_level_runs(drawn(0.495), seed=1)[0]
    assert close.value < 0.5
    assert not close.holds
    lost = dataclasses.replace(drawn(0.1)[0]["level", "wide"], measured=np.full(100, np.nan))
    assert holds_by_id(judge.judge_level_runs([{("level", "wide"): lost}], seed=1)) == {"T1.level": False}


def test_the_ramp_goes_up_and_down_over_open_ground() -> None:
    world, rng = level_run.make_site(2), np.random.default_rng(2)
    _, origins = level_run.ramp(world, rng)
    above = origins[:, 2] - world.truth.up(origins[0, 0], origins[0, 1])
    assert np.ptp(origins[:, :2], axis=0).tolist() == [0.0, 0.0]
    assert above.max() == pytest.approx(98.0)
    assert above[[0, -1]] == pytest.approx([10.0, 10.0])
    assert world.landscape.canopy[tuple(_nearest(world.truth, origins[0]))] < 5.0


def _nearest(terrain: Terrain, place: np.ndarray) -> list[int]:
    layer = terrain.finest
    return [round((place[1] - layer.north0) / layer.cell_m), round((place[0] - layer.east0) / layer.cell_m)]


@pytest.mark.timeout(900)
def test_the_whole_study_holds(scale: int, tmp_path: Path) -> None:
    figures: dict[str, DrawFigure] = ranging.drawings(ranging.SEED)
    if scale == 1:  # a picture that costs nothing
        write_figure(figures["doppler"], tmp_path / "doppler.png")
        return
    shares: list[float] = []
    results = ranging.study(ranging.RUNS, ranging.SEED, shares.append)
    assert [result for result in results if not result.holds] == []
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    for name, draw in figures.items():
        write_figure(draw, tmp_path / f"{name}.png")
