"""Rates, gaps, order and times of a topic."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fti.hil.oracle.required_outputs import RequiredOutput
from fti.post.score.outputs.presence import presence
from fti.post.score.outputs.row import OutputCheck
from fti.post.score.rows import Result
from fti.post.score.series import TopicSeries
from tests.post.score.outputs.synthetic_messages import messages

TOPIC = "/nav/nav_solution"
FLIGHT = (0.0, 40.0)
#: Ten messages a second.
OUTPUT = RequiredOutput(TOPIC, ("ins",), (9.0, 11.0), 0.25, 0.1, always_gap_s=0.6)
T = np.arange(0.0, 40.0, 0.1)


def results(
    series: TopicSeries,
    exempt: list[tuple[float, float]] | None = None,
    output: RequiredOutput = OUTPUT,
    *,
    copies: float = 0.0,
) -> dict[OutputCheck, Result]:
    t = (series.log_ns - messages(TOPIC, [0.0]).log_ns[0]) / 1e9
    rows = presence(output, series, t, FLIGHT, exempt or [], copies=copies)
    return {row.check: row.result for row in rows}


def of(t: np.ndarray) -> TopicSeries:
    return messages(TOPIC, t.tolist())


def test_a_topic_at_its_rate_holds() -> None:
    assert set(results(of(T)).values()) == {Result.HOLDS}


def test_a_topic_that_is_not_there_fails() -> None:
    assert results(of(T[:0])) == {OutputCheck.RATE: Result.FAILS}


@pytest.mark.parametrize(
    ("t", "check"),
    [
        (T[::2], OutputCheck.RATE),  # half the rate
        (np.sort(np.concatenate((T, T + 0.05))), OutputCheck.RATE),  # twice
        (T[T < 36.0], OutputCheck.GAP),  # ends early
        (T[T > 4.0], OutputCheck.GAP),  # begins late
        (T[(T < 20.0) | (T > 21.0)], OutputCheck.GAP),  # a hole of a second
    ],
)
def test_another_rate_or_a_hole_fails(t: np.ndarray, check: OutputCheck) -> None:
    assert results(of(t))[check] is Result.FAILS


def test_a_fault_explains_a_lower_rate_and_no_silence() -> None:
    """While its devices are lost an output is repeated twice a second."""
    seldom = T[(T < 10.0) | (T > 20.0) | (np.round(T * 10) % 5 == 0)]
    silent = T[(T < 10.0) | (T > 20.0)]
    lost = [(9.9, 20.1)]
    assert set(results(of(seldom), lost).values()) == {Result.HOLDS}
    assert results(of(seldom))[OutputCheck.GAP] is Result.FAILS
    assert results(of(silent), lost)[OutputCheck.GAP] is Result.FAILS
    measurement = replace(OUTPUT, always_gap_s=None)
    assert set(results(of(silent), lost, measurement).values()) == {Result.HOLDS}


def test_a_rate_is_not_estimated_from_faults_alone() -> None:
    assert results(of(T), [(0.0, 39.0)])[OutputCheck.RATE] is Result.NOT_COMPARED


def test_reordered_and_repeated_messages_fail() -> None:
    back = T.copy()
    back[[100, 101]] = back[[101, 100]]
    assert results(of(back))[OutputCheck.TIMES] is Result.FAILS
    twice = messages(TOPIC, T.tolist(), repeated=3)
    assert results(twice)[OutputCheck.TIMES] is Result.FAILS
    assert results(twice, copies=0.02)[OutputCheck.TIMES] is Result.HOLDS


@pytest.mark.parametrize("shift_s", [-1.0, 1.0, math.nan])
def test_a_message_of_another_time_fails(shift_s: float) -> None:
    """Content that states another time than the log, and validity long before, or after, it."""
    series = of(T)
    times = (series.log_ns + round(1e9 * (0.0 if math.isnan(shift_s) else shift_s))).tolist()
    shifted = messages(TOPIC, T.tolist(), **{"t_valid_ns" if math.isfinite(shift_s) else "unused": times})
    expected = Result.HOLDS if math.isnan(shift_s) else Result.FAILS
    assert results(shifted)[OutputCheck.TIMES] is expected
    if math.isfinite(shift_s):
        assert results(messages(TOPIC, T.tolist(), t_ns=times))[OutputCheck.TIMES] is Result.FAILS
