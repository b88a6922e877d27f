"""Errors beside limits and sigmas."""

from __future__ import annotations

import numpy as np
import pytest

from fti.hil.tables.limits import ScoreLimits
from fti.post.score.outputs.accuracy import DURING_FAULT, accuracy, explained_error_row
from fti.post.score.outputs.errors import QuantityError
from fti.post.score.outputs.row import OutputCheck
from fti.post.score.rows import Result

COUNT = 1000
T = np.linspace(0.0, 40.0, COUNT)
EVERY = np.ones(COUNT, dtype=bool)
LIMITS = ScoreLimits()


def quantity(error: np.ndarray, sd: float | np.ndarray = np.nan) -> QuantityError:
    return QuantityError("altitude", "m", error, np.broadcast_to(sd, error.shape).astype(float), 15.0)


def results(one: QuantityError) -> dict[OutputCheck, Result]:
    return {row.check: row.result for row in accuracy("/nav/x", one, EVERY, T, LIMITS, lost=~EVERY)}


def normal(sd: float) -> np.ndarray:
    return np.random.default_rng(5).normal(0.0, sd, COUNT)


def test_errors_of_their_sigma_hold() -> None:
    assert results(quantity(normal(2.0), 2.0)) == {OutputCheck.ERROR: Result.HOLDS, OutputCheck.SIGMA: Result.HOLDS}


@pytest.mark.parametrize("stated", [0.2, 0.0, -2.0, 200.0])
def test_another_sigma_fails(stated: float) -> None:
    """Ten times too small, zero, negative, a hundred times too large."""
    assert results(quantity(normal(2.0), stated))[OutputCheck.SIGMA] is Result.FAILS


def test_a_large_sigma_does_not_hide_a_large_error() -> None:
    assert results(quantity(normal(300.0), 300.0))[OutputCheck.SIGMA] is Result.FAILS


def test_without_a_device_a_sigma_may_be_large_and_must_fit() -> None:
    late = T > 20.0
    large = np.where(late, 200.0, 2.0)
    for error, result in ((normal(1.0) * large, Result.HOLDS), (normal(5.0) * large, Result.FAILS)):
        rows = {r.check: r for r in accuracy("/nav/x", quantity(error, large), EVERY, T, LIMITS, lost=late)}
        assert rows[OutputCheck.SIGMA].result is result
        assert results(quantity(error, large))[OutputCheck.SIGMA] is Result.FAILS  # nothing was lost


def test_one_wild_error_fails_with_its_time() -> None:
    error = normal(2.0)
    error[500] = 50.0
    rows = {row.check: row for row in accuracy("/nav/x", quantity(error, 2.0), EVERY, T, LIMITS, lost=~EVERY)}
    assert rows[OutputCheck.ERROR].result is Result.FAILS
    assert rows[OutputCheck.ERROR].at_s == T[500]


def test_without_a_sigma_the_limit_counts() -> None:
    assert results(quantity(np.full(COUNT, 14.9))) == {OutputCheck.ERROR: Result.HOLDS}
    assert results(quantity(np.full(COUNT, -15.1))) == {OutputCheck.ERROR: Result.FAILS}


def test_what_is_not_known_is_not_scored() -> None:
    assert not results(quantity(np.full(COUNT, np.nan), 2.0))


def test_a_wrong_value_during_a_fault_is_reported_and_not_scored() -> None:
    (row,) = explained_error_row("/nav/x", quantity(np.full(COUNT, 40.0)), EVERY, T, LIMITS)
    assert row.result is Result.NOT_COMPARED
    assert row.found.endswith(DURING_FAULT)
    assert not list(explained_error_row("/nav/x", quantity(np.full(COUNT, 4.0)), EVERY, T, LIMITS))


def test_a_large_sigma_may_cover_a_large_error_only_briefly() -> None:
    """In two fifths of the flight 500 m are wrong, with a sigma of 1000 m."""
    wrong = T > 24.0
    error, sd = np.where(wrong, 500.0, normal(2.0)), np.where(wrong, 1000.0, 2.0)
    assert results(quantity(error, sd))[OutputCheck.SIGMA] is Result.FAILS
