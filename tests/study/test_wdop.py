"""The study of weighted dilution of precision: fewer epochs hold as all do, and its judge can say no."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.geodesy.local import LocalFrame
from fti.nav.radio.altitude_accuracy import UNIFORM, altimeter_sd
from fti.study import wdop
from fti.study.wdop import experiment as flight
from fti.study.wdop import plots
from fti.study.wdop.experiment import Geometry, Heights, ground, measure
from fti.study.wdop.judge import judge_all


@pytest.fixture(scope="module")
def some() -> list[Heights]:
    """Every twentieth epoch."""
    epochs = Geometry().epochs()[::20]
    return [measure(epoch, wdop.RUNS, np.random.default_rng([wdop.SEED, k])) for k, epoch in enumerate(epochs)]


def test_some_epochs_hold(some: list[Heights]) -> None:
    results = judge_all(some)
    assert [result for result in results if not result.holds] == []
    assert len({result.id for result in results}) == len(results)
    found = {result.id: result.value for result in results}
    assert 0.2 < found["T28.few"] < 0.5
    assert found["C.mean"] < found["T28.table.fused.mean"]  # all of it in one is better than the better one
    assert found["C.honest"] < 0.1


def test_satellites_alone_are_not_the_altimeter(some: list[Heights]) -> None:
    """The choice is needed: at some epochs either source is the better one, and it is taken."""
    ranges, altimeter = flight.rms(some, "ranges"), flight.rms(some, "altimeter")
    share = np.array([heights.from_altimeter.mean() for heights in some])
    assert (share[ranges > 1.5 * altimeter] > 0.99).all()
    assert (share[altimeter > 1.5 * ranges] < 0.01).all()
    assert (ranges > 1.5 * altimeter).any() and (altimeter > 1.5 * ranges).any()


def test_a_forgotten_geoid_is_found_out() -> None:
    """25 m: heights of the elevation model count from the sea."""
    epochs = Geometry().epochs()[::60]
    heights = [measure(epoch, 500, np.random.default_rng(k), undulation=0.0) for k, epoch in enumerate(epochs)]
    refused = {result.id for result in judge_all(heights) if not result.holds}
    assert {"T28.altimeter.least", "T28.fused"} <= refused


def test_an_elevation_model_that_is_thought_exact_is_found_out(some: list[Heights]) -> None:
    vain = [
        dataclasses.replace(h, altimeter_sd=np.sqrt(h.altimeter_sd**2 - 0.9 * flight.DEM_SD**2), fused_sd=h.fused_sd)
        for h in some
    ]
    assert "T28.altimeter.least" in {result.id for result in judge_all(vain) if not result.holds}


def test_maximum_errors_taken_as_sigma_are_found_out(some: list[Heights]) -> None:
    loose = [dataclasses.replace(h, altimeter_sd=h.altimeter_sd / UNIFORM) for h in some]
    assert "T28.altimeter.most" in {result.id for result in judge_all(loose) if not result.holds}


def test_the_ground_rises_as_it_says() -> None:
    frame = LocalFrame(flight.LAT, flight.LON, 0.0)
    here = np.array([4000.0, -7000.0, 0.0])
    points = here + np.array([[0.0, 0.0, 0.0], [0.0, 10.0, 0.0], [10.0, 0.0, 0.0]])
    lat, lon, _ = frame.to_geodetic(points)
    high, north, east = ground(lat, lon)
    assert high[1] - high[0] == pytest.approx(10.0 * north[0], rel=0.01)
    assert high[2] - high[0] == pytest.approx(10.0 * east[0], rel=0.01)


def test_the_geometry_is_the_stated_one() -> None:
    epochs = Geometry().epochs()
    assert len(epochs) == 361
    assert {len(epoch.satellites_e) for epoch in epochs} == {3, 4, 5}
    agl = [epoch.agl for epoch in epochs]
    assert (min(agl), max(agl)) == pytest.approx((15.0, 2975.0))
    assert float(altimeter_sd(15.0)) == pytest.approx(0.61 / math.sqrt(3.0), rel=0.01)
    elevation = [math.degrees(math.asin(_up(epoch))) for epoch in epochs]
    assert min(elevation) > 15.0


def _up(epoch: flight.RadioEpoch) -> float:
    """Sine of the elevation of the lowest satellite, above the plane through the flight and square to its radius."""
    line = epoch.satellites_e - epoch.pos_e
    return float(np.min(line @ epoch.pos_e / np.linalg.norm(line, axis=1)) / np.linalg.norm(epoch.pos_e))


def test_pictures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fti.plot_style import write_figure

    monkeypatch.setattr(plots, "RUNS", 5)
    monkeypatch.setattr(flight, "EPOCH_S", 20 * flight.EPOCH_S)
    monkeypatch.setattr(plots, "MINUTES", plots.MINUTES[::20])
    for name, draw in wdop.drawings(5).items():
        write_figure(draw, tmp_path / f"{name}.png")
    assert {file.name for file in tmp_path.iterdir()} == {"satellites.png", "predicted.png", "choice.png"}
    assert all(file.stat().st_size > 20_000 for file in tmp_path.iterdir())


@pytest.mark.timeout(900)
def test_the_whole_study_holds(scale: int, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the parts are judged above
        assert wdop.RUNS == 1000
        return
    assert main(["study", "wdop"]) == 0
    assert "T28.fused" in capsys.readouterr().out
