"""The study of integrity with few runs: what it judges, and that it can fail."""

import math

import pytest
from scipy.stats import binom

from fti.study import Result, _clearance, clearance, workers
from fti.study._clearance import Faulty, Nominal
from fti.study._proportions import most_by_chance, wilson


def by_id(results: list[Result]) -> dict[str, Result]:
    return {result.id: result for result in results}


def test_chance_is_that_of_the_specification() -> None:
    """3000 approaches: 39 alarms at 1 %, 6 at 0.1 %."""
    assert (most_by_chance(3000, 0.01), most_by_chance(3000, 0.001)) == (39, 6)
    assert most_by_chance(50, 0.1) == binom.ppf(0.95, 50, 0.1)


def test_wilson_is_the_printed_interval() -> None:
    """Source: Newcombe 1998, table I: 81 of 263 is 0.2553 to 0.3662; 0 of 20 is 0 to 0.1611."""
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_too_many_alarms_do_not_hold() -> None:
    good, bad = Nominal(False, 1.0, 1.0), Nominal(True, 1.0, 1.0)
    assert by_id(clearance._nominal([good] * 99 + [bad]))["nominal.alarms"].holds
    assert not by_id(clearance._nominal([good] * 90 + [bad] * 10))["nominal.alarms"].holds


def test_a_late_alert_does_not_hold() -> None:
    quick = [Faulty(True, 0.5, True)] * 18
    assert by_id(clearance._detected("obstacle_75", [*quick, Faulty(False, math.nan, False)]))[
        "obstacle_75.time_p95"
    ].holds
    late = by_id(clearance._detected("obstacle_75", quick + [Faulty(True, 2.6, True)] * 2))
    assert not late["obstacle_75.time_p95"].holds
    assert by_id(clearance._detected("height_10", quick + [Faulty(True, 2.6, True)] * 2))["height_10.time_p95"].holds


def test_detection_is_told_apart_by_what_is_observable() -> None:
    flown = [Faulty(True, 1.0, True)] * 6 + [Faulty(False, math.nan, False)] * 2
    found = by_id(clearance._detected("along_60", flown))
    assert [found[f"along_60{part}.pd"].value for part in ("", ".observable", ".not_observable")] == [0.75, 1.0, 0.0]


def test_an_approach_that_was_trusted_off_the_track_does_not_hold() -> None:
    assert all(result.holds for result in clearance._joined([(False, 150.0), (False, 400.0)]))
    assert not by_id(clearance._joined([(True, -50.0)]))["T14.before"].holds
    assert not by_id(clearance._joined([(False, math.nan)]))["T14.behind"].holds


def test_few_runs_over_the_demonstration(monkeypatch: pytest.MonkeyPatch) -> None:
    """10 nominal approaches and two with some of the faults; the same seed gives the same."""
    some = ("obstacle_150", "along_60", "wrong_reference")
    monkeypatch.setattr(clearance, "FAULTS", {name: _clearance.FAULTS[name] for name in some})
    monkeypatch.setattr(_clearance, "VEGETATION", (0.85,))
    monkeypatch.setattr(workers, "PATIENCE_S", math.inf)  # each process would make its own map of the ground
    told: list[float] = []
    results = by_id(clearance.study(10, 5, told.append))
    assert results["nominal.alarms"].holds
    assert all(results[f"{name}.pd"].value == 1.0 for name in some)
    assert all(results[f"{name}.time_p95"].holds for name in some)
    assert results["T14.before"].holds
    assert results["T14.behind"].holds
    assert told[-1] == pytest.approx(1.0)
    assert _clearance.nominal((5, 3)) == _clearance.nominal((5, 3))
