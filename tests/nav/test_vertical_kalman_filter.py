"""The filter of the vertical channel: its algebra, refusals, and their end."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.nav.vertical.error_model import ALTIMETER, HEIGHT, STATES, VerticalModel
from fti.nav.vertical.kalman_filter import MIN_ACCEPTED_IN_ROW, REFUSED_HISTORY, ErrorFilter

H = np.zeros(STATES)
H[[HEIGHT, ALTIMETER]] = 1.0, -1.0
NOISE = 4.0
DT = 0.1


def make(gate: float = 3.0, lockout_s: float = math.inf, runs: tuple[int, ...] = ()) -> ErrorFilter:
    P = VerticalModel().start(20.0, 0.5)
    return ErrorFilter(np.zeros((*runs, STATES)), np.broadcast_to(P, (*runs, STATES, STATES)), gate, lockout_s)


def go_on(channel: ErrorFilter, z: np.ndarray | float) -> bool:
    phi, Q = VerticalModel().step(DT)
    channel.predict(phi, Q, DT)
    return bool(np.all(channel.update(z, H, NOISE).accepted))


def test_an_update_is_the_textbook_one() -> None:
    """Bayes in information form: P^-1 + h h^T / r, and x by the normal equations."""
    channel = make(math.inf)
    x, P = channel.x.copy(), channel.P.copy()
    innovation = channel.update(7.0, H, NOISE)
    cov = np.linalg.inv(np.linalg.inv(P) + np.outer(H, H) / NOISE)
    assert np.allclose(channel.P, cov, rtol=1e-9, atol=1e-12)
    assert np.allclose(channel.x, cov @ (np.linalg.solve(P, x) + H * 7.0 / NOISE), rtol=1e-9, atol=1e-12)
    assert innovation.sd == pytest.approx(math.sqrt(H @ P @ H + NOISE))


def test_many_runs_at_once_are_each_alone() -> None:
    z = np.random.default_rng(1).normal(0.0, 20.0, (200, 4))
    z[50:55, 1] += 500.0
    z[100:150, 2] += 300.0
    together, alone = make(3.0, 2.0, (4,)), [make(3.0, 2.0) for _ in range(4)]
    for row in z:
        go_on(together, row)
        for channel, value in zip(alone, row, strict=True):
            go_on(channel, float(value))
    for i, channel in enumerate(alone):
        assert np.allclose(together.x[i], channel.x, rtol=1e-9, atol=1e-12)
        assert np.allclose(together.P[i], channel.P, rtol=1e-9, atol=1e-12)
        assert together.is_trusted[i] == channel.is_trusted


def test_what_is_refused_changes_nothing() -> None:
    channel = make()
    edge = 3.0 * math.sqrt(H @ channel.P @ H + NOISE)
    x, P = channel.x.copy(), channel.P.copy()
    assert not channel.update(1.001 * edge, H, NOISE).accepted
    assert np.array_equal(channel.x, x) and np.array_equal(channel.P, P)
    assert channel.update(0.999 * edge, H, NOISE).accepted


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("gate", [3.0, math.inf])
def test_what_is_no_number_never_enters(wrong: float, gate: float) -> None:
    channel = make(gate, lockout_s=0.5)
    for _ in range(100):
        assert not go_on(channel, wrong)
    assert np.isfinite(channel.x).all() and np.isfinite(channel.P).all()
    assert channel.is_trusted  # nothing was refused: there was nothing


def test_refusal_for_ever_locks_out_and_bounded_refusal_does_not() -> None:
    ever, bounded = make(3.0), make(3.0, lockout_s=1.95)
    rng = np.random.default_rng(2)
    for channel in (ever, bounded):
        for _ in range(100):
            go_on(channel, rng.normal(0.0, 2.0))
        accepted = [go_on(channel, 300.0 + rng.normal(0.0, 2.0)) for _ in range(60)]
        first = accepted.index(True) if any(accepted) else None
        assert first == (None if channel is ever else 19)  # 2 s after the last one that was taken
    assert abs(ever.x[HEIGHT]) < 10.0
    assert abs(bounded.x[HEIGHT] - 300.0) < 3.0 * math.sqrt(bounded.P[HEIGHT, HEIGHT])
    assert bounded.is_trusted


def test_trust_comes_back_with_what_agrees_and_not_before() -> None:
    channel = make(3.0, lockout_s=1.95)
    for _ in range(50):
        go_on(channel, 0.0)
    is_trusted = []
    for _ in range(19 + MIN_ACCEPTED_IN_ROW + 1):
        go_on(channel, 300.0)
        is_trusted.append(bool(channel.is_trusted))
    assert is_trusted[:19] == [True] * 19  # it refuses, and still has its own height
    assert is_trusted[19 : 19 + MIN_ACCEPTED_IN_ROW - 1] == [False] * (MIN_ACCEPTED_IN_ROW - 1)
    assert is_trusted[-1]


def test_a_source_that_scatters_is_not_trusted() -> None:
    channel = make(3.0, lockout_s=2.0)
    for _ in range(50):
        go_on(channel, 0.0)
    rng = np.random.default_rng(3)
    wrong = []
    for _ in range(2000):
        go_on(channel, rng.uniform(-3000.0, 3000.0))
        error = abs(channel.x[HEIGHT]) > 5.0 * math.sqrt(channel.P[HEIGHT, HEIGHT])
        wrong.append(bool(channel.is_trusted) and bool(error))
    assert np.mean(wrong) < 0.02


def test_what_scatters_leaves_the_height_as_uncertain_as_it_scatters() -> None:
    channel = make(3.0, lockout_s=1.95)
    for _ in range(50):
        go_on(channel, 0.0)
    for k in range(100):
        if go_on(channel, 3000.0 * (-1.0) ** k * (1.0 + k / 100)):
            break
    assert channel.P[HEIGHT, HEIGHT] > 200.0**2  # by the last one alone it would be 2 m


def test_trust_wants_them_in_a_row() -> None:
    channel = make(3.0, lockout_s=1.95)
    for _ in range(50):
        go_on(channel, 0.0)
    accepted = [go_on(channel, 300.0 if k < 20 or k % 4 else 900.0) for k in range(60)]
    assert sum(accepted) > 2 * MIN_ACCEPTED_IN_ROW
    assert not channel.is_trusted


def test_few_refusals_do_not_open_the_region() -> None:
    channel = make(3.0, lockout_s=0.0)
    for _ in range(20):
        go_on(channel, 0.0)
    assert not any(go_on(channel, 300.0) for _ in range(REFUSED_HISTORY - 1))


def test_the_covariance_stays_one() -> None:
    channel = make(3.0, 5.0)
    rng = np.random.default_rng(4)
    for k in range(1000):
        go_on(channel, rng.normal(0.0, 2.0) + (1e4 if k % 97 == 0 else 0.0))
        assert np.array_equal(channel.P, channel.P.T)
    assert np.linalg.eigvalsh(channel.P).min() > 0.0
