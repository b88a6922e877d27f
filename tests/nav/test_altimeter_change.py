"""The memory of one altimeter: closed forms over ground that is known, unknown, level, and as steep as the climb."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import pytest

from fti.nav.altimetry.change import ChangeCheck
from fti.nav.altimetry.observation import Observation, Resolution
from fti.types import Reason

S = 1_000_000_000
HZ = 25
Profile = Callable[[float], float]
INS = ("ins", "ins")


def level(value: float) -> Profile:
    return lambda t: value


def samples(
    seconds: float, value: Profile, *, predicted: Profile | None, alt: Profile = lambda t: 500.0, sd: float = 0.5
) -> Iterable[Observation]:
    """Of an altimeter, 25 a second; the climb rate is that of the altitude."""
    for k in range(round(seconds * HZ)):
        t = k / HZ
        climb = (alt(t + 0.01) - alt(t - 0.01)) / 0.02
        known = predicted(t) if predicted else None
        yield Observation(S + round(t * S), value(t), known, sd, alt(t), climb, INS)


def reasons(seen: Iterable[Observation]) -> list[tuple[float, tuple[Reason, ...]]]:
    """Time [s] and reasons of every sample."""
    check = ChangeCheck()
    return [((o.t_ns - S) / S, check.update(o)) for o in seen]


def refused(seen: Iterable[Observation], reason: Reason) -> tuple[float, float] | None:
    """First and last time with a reason [s]."""
    at = [t for t, found in reasons(seen) if reason in found]
    return (at[0], at[-1]) if at else None


def hills(t: float) -> float:
    return 100.0 + 20.0 * math.sin(2 * math.pi * t / 20.0)


def stepped(profile: Profile, step: float) -> Profile:
    return lambda t: step * round(profile(t) / step)


def held(profile: Profile, from_s: float, to_s: float) -> Profile:
    return lambda t: profile(from_s) if from_s <= t < to_s else profile(t)


def test_an_altimeter_that_follows_hills_in_steps_is_believed() -> None:
    assert {found for _, found in reasons(samples(60.0, stepped(hills, 1.524), predicted=hills))} == {()}


def test_a_stuck_one_is_refused_within_3_s_and_believed_2_s_after_it_moves() -> None:
    found = refused(samples(60.0, held(stepped(hills, 1.524), 21.0, 35.0), predicted=hills), Reason.STUCK)
    assert found is not None
    assert 22.9 <= found[0] <= 24.0
    assert 36.9 <= found[1] <= 37.1


def test_over_level_ground_in_level_flight_nothing_is_known() -> None:
    for predicted in (level(100.0), None):
        assert refused(samples(60.0, level(100.0), predicted=predicted), Reason.STUCK) is None


def test_over_unknown_ground_the_climb_tells() -> None:
    """5 m/s from 100 m: one value for 2 s, and four of the largest steps that it may have, 5 % and 0.3 m."""
    climb: Profile = lambda t: 500.0 + 5.0 * max(0.0, t - 20.0)  # noqa: E731
    found = refused(samples(40.0, level(100.0), predicted=None, alt=climb), Reason.STUCK)
    assert found is not None
    assert found[0] == pytest.approx(20.0 + 4 * 5.3 / 5.0, abs=0.3)


def test_hills_under_a_level_flight_without_a_terrain_are_no_reason() -> None:
    assert {found for _, found in reasons(samples(60.0, stepped(hills, 1.524), predicted=None))} == {()}


def test_a_jump_of_the_altitude_alone_is_not_a_climb() -> None:
    """A satellite height that jumps by 40 m and back, over and over; the velocity says level flight."""
    seen = [
        Observation(S + k * S // HZ, 100.0, None, 0.5, 500.0 + 40.0 * (k // 25 % 2), 0.0, INS) for k in range(60 * HZ)
    ]
    assert refused(seen, Reason.STUCK) is None


@pytest.mark.parametrize("rate", [2.0, -2.0])
def test_a_drift_is_refused_as_soon_as_it_is_5_sigma(rate: float) -> None:
    """Sigma of a difference 0.7 m: 2 m/s is 5 sigma in 2 s; three blocks against three of before, and 0.5 s each."""
    wrong: Profile = lambda t: hills(t) + rate * max(0.0, t - 20.0)  # noqa: E731
    found = refused(samples(40.0, wrong, predicted=hills), Reason.CHANGE_MISMATCH)
    assert found is not None
    assert 22.0 <= found[0] <= 26.0
    assert found[1] == pytest.approx(40.0, abs=0.1), "as long as it drifts"


def test_a_scale_is_refused_where_the_range_changes() -> None:
    found = refused(samples(60.0, lambda t: 1.2 * hills(t), predicted=hills), Reason.CHANGE_MISMATCH)
    assert found is not None
    assert found[0] < 15.0
    level_flight = samples(60.0, level(120.0), predicted=level(100.0))
    assert refused(level_flight, Reason.CHANGE_MISMATCH) is None


def test_a_constant_error_is_no_change() -> None:
    assert {found for _, found in reasons(samples(60.0, lambda t: hills(t) + 8.0, predicted=hills))} == {()}


def test_an_obstacle_of_a_second_is_not_a_drift() -> None:
    over: Profile = lambda t: hills(t) - (60.0 if 30.0 <= t < 31.0 else 0.0)  # noqa: E731
    assert {found for _, found in reasons(samples(60.0, over, predicted=hills))} == {()}


def test_a_mismatch_ends_when_the_altimeter_is_right_again_for_2_s() -> None:
    ramp: Profile = lambda t: hills(t) + (4.0 * (t - 20.0) if 20.0 <= t < 30.0 else 0.0)  # noqa: E731
    found = refused(samples(60.0, ramp, predicted=hills), Reason.CHANGE_MISMATCH)
    assert found is not None
    assert found[0] < 26.0
    assert 31.5 <= found[1] <= 33.5


def test_another_source_of_the_position_begins_anew() -> None:
    """At 30 s the position is another one, over other hills."""
    predicted: Profile = lambda t: hills(t) + (20.0 if t >= 30.0 else 0.0)  # noqa: E731
    seen = list(samples(60.0, hills, predicted=predicted))
    changed = [o if o.t_ns < 31 * S else replace(o, source=("gnss", "gnss")) for o in seen]
    assert refused(seen, Reason.CHANGE_MISMATCH) is not None
    assert {found for _, found in reasons(changed)} == {()}


def test_a_jump_of_the_altitude_that_the_velocity_does_not_confirm_is_no_drift() -> None:
    seen = samples(60.0, hills, predicted=hills)
    jumped = [o if o.t_ns < 31 * S else replace(o, alt=520.0, predicted=hills((o.t_ns - S) / S) + 20.0) for o in seen]
    assert {found for _, found in reasons(jumped)} == {()}


@pytest.mark.parametrize("step", [0.3048, 1.524, 6.096])
def test_the_resolution_is_the_step_between_repeated_values(step: float) -> None:
    found, profile = Resolution(), stepped(lambda t: 200.0 + 2.0 * t, step)
    for k in range(1000):
        found.update(profile(k / HZ))
    assert found.step == pytest.approx(step)


def test_values_that_never_repeat_have_no_known_resolution() -> None:
    found = Resolution()
    for k in range(100):
        found.update(100.0 + 0.37 * k)
    assert found.step is None
