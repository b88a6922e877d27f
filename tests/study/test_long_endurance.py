"""The study of 500 s without satellites: short flights, and a judge that can say no; the whole with --scale full."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fti.cli.main import main
from fti.study.ground_flights import fly
from fti.study.long_endurance import experiment, judge
from fti.study.long_endurance.beams import BeamPosition
from fti.study.long_endurance.experiment import AIDS, BASE, OUTAGE_S, SECONDS, UNITS, Track, Tracks
from fti.study.statistics import rms

T = np.arange(1.0, SECONDS)


def track(error: float, sd: float, later: float = 1.0) -> Track:
    """Constant error and sigma [m] for each axis; the error of the second half of the flight is so much larger."""
    factor = np.where(0.5 * sum(OUTAGE_S) > T, 1.0, later)
    distance = error * np.sqrt(2.0) * factor
    return Track(T, distance, np.full(len(T), sd * np.sqrt(2.0)), np.outer(error / sd * factor, (1.0, -1.0)))


def tracks(one: Track, nine: Track) -> Tracks:
    of_aid = {"baro": track(200.0, 200.0), "1": one, "9": nine}
    return {(unit, aid): of_aid[aid] for unit in UNITS for aid in AIDS}


def failed(run: Tracks) -> set[str]:
    return {result.id for result in judge.judge_runs([run] * 25) if not result.holds}


def test_the_judge_can_say_no() -> None:
    assert failed(tracks(track(2.0, 2.0), track(1.0, 1.0))) == set()
    assert failed(tracks(track(2.0, 2.0), track(3.0, 3.0))) == {"T17.order"}
    assert failed(tracks(track(2.0, 1.5), track(1.0, 1.7))) == {"T17.sigma.1", "T17.sigma.9"}
    assert failed(tracks(track(2.0, 2.4, 1.3), track(1.0, 1.0, 0.75))) == {"T17.stable.1.high", "T17.stable.9.low"}


def test_the_flights_over_one_ground_are_one_unit_of_the_interval() -> None:
    """Twenty grounds with five flights each: an interval of 100 equal pairs would be narrower."""
    runs = [tracks(track(2.0, 2.0, 0.5 if number % 20 < 10 else 1.5), track(1.0, 1.0)) for number in range(100)]
    rows = {result.id: result.value for result in judge.judge_runs(runs)}
    assert rows["T17.stable.1"] == pytest.approx(1.0)
    # the mean of 20 values of 0.5 or 1.5 has the sigma 0.5 / sqrt(20) = 0.112; times 1.645: 0.184
    assert rows["T17.stable.1.low"] == pytest.approx(1.0 - 0.184, abs=0.03)
    assert rows["T17.stable.1.high"] == pytest.approx(1.0 + 0.184, abs=0.03)
    assert len(rows) == len(judge.judge_runs(runs))


def test_a_time_without_a_valid_position_has_an_infinite_error() -> None:
    """A MEMS unit with the barometer alone has no valid position after 400 s without satellites."""
    whole = track(2.0, 1.0, 3.0)
    valid = (T < 600.0) | (T > 760.0)
    found = Track(T[valid], whole.distance[valid], whole.sd[valid], whole.ratio[valid])
    assert found.at(350.0) == pytest.approx(2.0 * np.sqrt(2.0))
    assert found.at(750.0) == np.inf


def test_a_short_outage_orders_the_aids(monkeypatch: pytest.MonkeyPatch) -> None:
    """40 s with satellites, 110 s without: the inertial error grows, that of one beam and of nine does not."""
    outage = (40.0, 150.0)
    monkeypatch.setattr(experiment, "SECONDS", 152.0)
    monkeypatch.setattr(experiment, "OUTAGE_S", outage)
    monkeypatch.setattr(experiment, "UNITS", ("tactical",))
    run = experiment.run((17, 1))
    errors = {aid: run["tactical", aid].rms(100.0, 150.0) for aid in AIDS}
    assert max(errors["1"], errors["9"]) < 0.5 * errors["baro"]
    sigmas = {}
    for aid in AIDS:
        found = run["tactical", aid]
        inside = found.inside(*outage)
        assert 0.3 < rms(found.ratio[inside]) < 1.6
        sigmas[aid] = float(np.median(found.sd[inside]))  # the error of one flight need not be ordered
    assert sigmas["9"] < 0.8 * sigmas["1"] < 0.4 * sigmas["baro"]


def test_a_single_beam_of_the_study_is_the_live_position() -> None:
    """The study's fixes with one beam against the live code, with the same ranges."""
    case = replace(BASE, seconds=50.0)
    live = fly(case, 17, 0)
    own = fly(case, 17, 0, lambda *flight: BeamPosition(1, *flight))
    np.testing.assert_allclose(np.array(own.error), np.array(live.error), atol=0.5)


@pytest.mark.timeout(4 * 3600)
def test_the_whole_study_holds(scale: int, capsys: pytest.CaptureFixture[str]) -> None:
    if scale == 1:  # the parts are judged above
        return
    assert main(["study", "long-endurance"]) == 0, capsys.readouterr().out
