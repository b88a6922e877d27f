"""The study of flights without satellites and without a map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest

from fti.study.dead_reckoning import experiment, flight
from fti.study.dead_reckoning.experiment import INSTANTS_S, Track, Tracks
from fti.study.dead_reckoning.judge import judge
from fti.study.dead_reckoning.printed_forms import FORMS


def track(error_m: float, sigmas: float, rng: np.random.Generator) -> Track:
    """A track of 500 s with this RMS error along and across at its end, and this RMS of error over sigma."""
    t = np.arange(0.0, 501.0)
    noise = rng.standard_normal((len(t), 2))
    pairs: Counter[str] = Counter({"3": 90, "2": 8, "0": 2})
    return Track(t, error_m * noise, sigmas * rng.standard_normal((len(t), 2)), pairs, 5e-4, 0.03)


def flights(looks_m: float, sigmas: float) -> list[Tracks]:
    rng = np.random.default_rng(1)
    return [
        {
            ("straight", "tactical", "none"): track(1000.0, 1.0, rng),
            ("straight", "tactical", "exact"): track(40.0, 1.0, rng),
            ("straight", "tactical", "looks"): track(looks_m, sigmas, rng),
        }
        for _ in range(200)
    ]


@pytest.mark.parametrize(
    ("looks_m", "sigmas", "missed"),
    [
        (60.0, 1.0, set()),
        (150.0, 1.0, {f"D.ratio.tactical.straight{part}" for part in ("", ".along", ".across")}),
        (60.0, 1.6, {"D.sigma.tactical.straight.max"}),
        (60.0, 0.5, {"D.sigma.tactical.straight.min"}),
    ],
)
def test_the_judge(looks_m: float, sigmas: float, missed: set[str]) -> None:
    results = judge(flights(looks_m, sigmas))
    assert {result.id for result in results if not result.holds} == missed
    values = {result.id: result.value for result in results}
    assert values["D.pairs.tactical.straight"] == pytest.approx(0.9)
    assert values["D.along.tactical.straight.alone"] == pytest.approx(1000.0, rel=0.15)
    assert values["D.exact.tactical.straight.across"] == pytest.approx(0.04, rel=0.3)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Flights of sixty seconds, the last twenty without satellites."""
    for module in (flight, experiment):
        monkeypatch.setattr(module, "SECONDS", 60.0)
        monkeypatch.setattr(module, "OUTAGE_S", 40.0)
    experiment.draw_flight.cache_clear()
    yield
    experiment.draw_flight.cache_clear()


@pytest.mark.usefixtures("short")
def test_a_short_flight_keeps_its_velocity() -> None:
    """Round the square, over real looks of the ray caster."""
    found = experiment.fly("turning", "tactical", "looks", 7, 1)
    assert found.pairs["3"] > 0.7 * sum(found.pairs[str(k)] for k in range(4))
    assert found.t[-1] == pytest.approx(20.0)
    assert np.abs(found.end).max() < 8.0
    assert np.abs(found.ratio).max() < 4.5
    assert 0.005 < found.pair_sd < 0.2
    assert 0.0 < found.heading_sd < 0.02


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("form", FORMS)
def test_a_printed_form_is_too_certain(form: str) -> None:
    """Attitude and mounting are no states of it: its errors leave its sigma within seconds."""
    found = experiment.fly("turning", "tactical", form, 7, 1)
    looks = experiment.fly("turning", "tactical", "looks", 7, 1)
    assert np.abs(found.ratio).max() > 1.5 * np.abs(looks.ratio).max()


def test_instants_are_within_the_time_without_satellites() -> None:
    assert len(INSTANTS_S) == 10
    assert INSTANTS_S[0] > 0.0
    assert INSTANTS_S[-1] <= flight.SECONDS - flight.OUTAGE_S
