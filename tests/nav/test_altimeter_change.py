"""The memory of one altimeter: closed forms over ground that is known, unknown, level, and as steep as the climb."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np
import pytest
from msgspec.structs import replace

from fti.messages.reasons import Reason
from fti.nav.altimetry.change import ChangeCheck
from fti.nav.altimetry.observation import AltimeterObservation, Resolution
from fti.ranging.radar.quantise import quantise_ft

S = 1_000_000_000
HZ = 25
Profile = Callable[[float], float]
INS = ("ins", "ins")


def level(value: float) -> Profile:
    return lambda t: value


def samples(
    seconds: float, value: Profile, *, predicted: Profile | None, alt: Profile = lambda t: 500.0, sd: float = 0.5
) -> Iterable[AltimeterObservation]:
    """Of an altimeter, 25 a second; the climb rate is that of the altitude."""
    for k in range(round(seconds * HZ)):
        t = k / HZ
        climb = (alt(t + 0.01) - alt(t - 0.01)) / 0.02
        known = predicted(t) if predicted else None
        yield AltimeterObservation(S + round(t * S), value(t), known, sd, alt(t), climb, INS)


def reasons(observations: Iterable[AltimeterObservation]) -> list[tuple[float, tuple[Reason, ...]]]:
    """Time [s] and reasons of every sample."""
    check = ChangeCheck()
    return [((o.t_ns - S) / S, check.update(o)) for o in observations]


def refused(observations: Iterable[AltimeterObservation], reason: Reason) -> tuple[float, float] | None:
    """First and last time with a reason [s]."""
    at = [t for t, found in reasons(observations) if reason in found]
    return (at[0], at[-1]) if at else None


def hills(t: float) -> float:
    return 100.0 + 20.0 * math.sin(2 * math.pi * t / 20.0)


def stepped(profile: Profile, step: float) -> Profile:
    return lambda t: step * round(profile(t) / step)


def held(profile: Profile, from_s: float, to_s: float) -> Profile:
    return lambda t: profile(from_s) if from_s <= t < to_s else profile(t)


def test_an_altimeter_that_follows_hills_in_steps_is_valid() -> None:
    assert {found for _, found in reasons(samples(60.0, stepped(hills, 1.524), predicted=hills))} == {()}


def test_a_stuck_one_is_refused_within_3_s_and_valid_2_s_after_it_moves() -> None:
    found = refused(samples(60.0, held(stepped(hills, 1.524), 21.0, 35.0), predicted=hills), Reason.STUCK)
    assert found is not None
    assert 22.9 <= found[0] <= 24.0
    assert 36.9 <= found[1] <= 37.1


def test_over_level_ground_in_level_flight_nothing_is_known() -> None:
    for predicted in (level(100.0), None):
        assert refused(samples(60.0, level(100.0), predicted=predicted), Reason.STUCK) is None


def test_over_unknown_ground_the_climb_decides() -> None:
    """5 m/s from 100 m: one value for 2 s, and four of the largest steps that it may have, 5 % and 0.3 m."""
    climb: Profile = lambda t: 500.0 + 5.0 * max(0.0, t - 20.0)  # noqa: E731
    found = refused(samples(40.0, level(100.0), predicted=None, alt=climb), Reason.STUCK)
    assert found is not None
    assert found[0] == pytest.approx(20.0 + 4 * 5.3 / 5.0, abs=0.3)


def test_a_stuck_one_is_refused_although_its_sigma_was_large_at_first() -> None:
    """Stuck at 20 s; for a second of it nobody knows the place."""
    flight = samples(45.0, held(stepped(hills, 1.524), 20.0, 40.0), predicted=hills)
    observations = [replace(o, sd=30.0) if 21.0 <= o.t_ns / S < 22.0 else o for o in flight]
    found = refused(observations, Reason.STUCK)
    assert found is not None
    assert 22.0 <= found[0] <= 28.0


def test_known_ground_that_rises_as_the_aircraft_does_makes_no_altimeter_stuck() -> None:
    """The height above it stays the same; now and then a sample has no prediction."""
    climb: Profile = lambda t: 500.0 + 2.0 * t  # noqa: E731
    flight = samples(30.0, level(100.0), predicted=level(100.0), alt=climb)
    observations = [replace(o, predicted=None) if k % 200 == 199 else o for k, o in enumerate(flight)]
    assert {found for _, found in reasons(observations)} == {()}


def test_hills_under_a_level_flight_without_a_terrain_are_no_reason() -> None:
    assert {found for _, found in reasons(samples(60.0, stepped(hills, 1.524), predicted=None))} == {()}


def test_a_jump_of_the_altitude_alone_is_not_a_climb() -> None:
    """A satellite height that jumps by 40 m and back, over and over; the velocity says level flight."""
    observations = [
        AltimeterObservation(S + k * S // HZ, 100.0, None, 0.5, 500.0 + 40.0 * (k // 25 % 2), 0.0, INS)
        for k in range(60 * HZ)
    ]
    assert refused(observations, Reason.STUCK) is None


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
    observations = list(samples(60.0, hills, predicted=predicted))
    changed = [o if o.t_ns < 31 * S else replace(o, source=("gnss", "gnss")) for o in observations]
    assert refused(observations, Reason.CHANGE_MISMATCH) is not None
    assert {found for _, found in reasons(changed)} == {()}


def test_a_jump_of_the_altitude_that_the_velocity_does_not_confirm_is_no_drift() -> None:
    observations = samples(60.0, hills, predicted=hills)
    jumped = [
        o if o.t_ns < 31 * S else replace(o, alt=520.0, predicted=hills((o.t_ns - S) / S) + 20.0) for o in observations
    ]
    assert {found for _, found in reasons(jumped)} == {()}


@pytest.mark.parametrize("step", [0.3048, 1.524, 6.096])
def test_the_resolution_is_the_step_between_repeated_values(step: float) -> None:
    found, profile = Resolution(), stepped(lambda t: 200.0 + 2.0 * t, step)
    for k in range(1000):
        found.update(profile(k / HZ))
    assert found.step == pytest.approx(step)


def test_values_that_never_repeat_have_no_known_resolution() -> None:
    resolution = Resolution()
    for k in range(100):
        resolution.update(100.0 + 0.37 * k)
    assert resolution.step is None


def nowhere(o: AltimeterObservation) -> AltimeterObservation:
    return replace(o, source=(None, None), alt=None, climb=None, predicted=None)


def without_position(
    observations: Iterable[AltimeterObservation], period_s: float, lasts_s: float
) -> list[AltimeterObservation]:
    """The position is missing for a while once in every period; then nobody knows the altitude and the ground."""
    return [nowhere(o) if (o.t_ns - S) / S % period_s >= period_s - lasts_s else o for o in observations]


@pytest.mark.parametrize(("period_s", "lasts_s"), [(3.0, 0.04), (1.0, 0.06), (5.0, 1.0)])
def test_a_drift_is_found_although_the_position_is_missing_for_moments(period_s: float, lasts_s: float) -> None:
    wrong: Profile = lambda t: hills(t) + 2.0 * max(0.0, t - 20.0)  # noqa: E731
    observations = without_position(samples(40.0, wrong, predicted=hills), period_s, lasts_s)
    found = refused(observations, Reason.CHANGE_MISMATCH)
    assert found is not None
    assert 22.0 <= found[0] <= 28.0


@pytest.mark.parametrize("climb", [0.0, 4.0, -4.0])
def test_a_sound_altimeter_is_valid_although_the_position_is_missing_for_moments(climb: float) -> None:
    """The integral of the climb rate goes on while the position is missing."""
    true: Profile = lambda t: hills(t) + climb * t + 400.0  # noqa: E731
    alt: Profile = lambda t: 900.0 + climb * t  # noqa: E731
    observations = without_position(samples(60.0, true, predicted=true, alt=alt), 5.0, 1.5)
    assert {found for _, found in reasons(observations)} == {()}


def test_a_drift_in_a_climb_is_found_although_the_position_is_missing_for_moments() -> None:
    """Without the climb while the position is missing both altitudes would contradict each other by 6 m."""
    true: Profile = lambda t: hills(t) + 4.0 * t  # noqa: E731
    wrong: Profile = lambda t: true(t) - 2.0 * max(0.0, t - 20.0)  # noqa: E731
    observations = samples(40.0, wrong, predicted=true, alt=lambda t: 500.0 + 4.0 * t)
    found = refused(without_position(observations, 5.0, 1.5), Reason.CHANGE_MISMATCH)
    assert found is not None
    assert 22.0 <= found[0] <= 28.0


def test_another_source_after_a_moment_without_position_begins_anew() -> None:
    predicted: Profile = lambda t: hills(t) + (20.0 if t >= 30.0 else 0.0)  # noqa: E731
    observations = list(samples(60.0, hills, predicted=predicted))
    observations = [o if o.t_ns < 31 * S else replace(o, source=("gnss", "gnss")) for o in observations]
    between = [nowhere(o) if 29.8 <= (o.t_ns - S) / S < 30.0 else o for o in observations]
    assert {found for _, found in reasons(between)} == {()}


def without_samples(
    observations: Iterable[AltimeterObservation], from_s: float, to_s: float
) -> list[AltimeterObservation]:
    return [o for o in observations if not from_s <= (o.t_ns - S) / S < to_s]


def of_another_source(
    observations: Iterable[AltimeterObservation], from_s: float, step: float, name: str = "gnss"
) -> list[AltimeterObservation]:
    """Position and altitude of another source from then on, whose altitude is higher by a step [m]."""
    return [
        o
        if (o.t_ns - S) / S < from_s or o.predicted is None or o.alt is None
        else replace(o, source=(name, name), alt=o.alt + step, predicted=o.predicted + step)
        for o in observations
    ]


def over_unknown_ground(
    observations: Iterable[AltimeterObservation], from_s: float, to_s: float
) -> list[AltimeterObservation]:
    return [replace(o, predicted=None) if from_s <= (o.t_ns - S) / S < to_s else o for o in observations]


def noisy(profile: Profile, sd: float = 0.1, step: float = 0.01) -> Profile:
    """Of a laser: noise that its resolution shows."""
    rng = np.random.default_rng(7)
    return lambda t: step * round((profile(t) + rng.normal(0.0, sd)) / step)


@pytest.mark.parametrize("jump_m", [270.0, -150.0, 30.0])
def test_one_that_jumps_and_is_stuck_then_is_refused_within_5_s_of_climb(jump_m: float) -> None:
    """2 m/s over unknown ground: the jump is no resolution of a laser that states centimetres."""
    climb: Profile = lambda t: 230.0 + 2.0 * t  # noqa: E731
    true = noisy(climb)
    wrong: Profile = lambda t: true(t) if t < 30.0 else climb(30.0) + jump_m  # noqa: E731
    found = refused(samples(90.0, wrong, predicted=None, alt=climb, sd=0.1), Reason.STUCK)
    assert found is not None
    assert found[0] <= 35.0
    assert found[1] == pytest.approx(90.0, abs=0.1)


@pytest.mark.parametrize("rate", [0.3, -0.3, 1.0, 3.0, -3.0])
@pytest.mark.parametrize("known", [False, True])
def test_steps_that_grow_with_the_height_make_no_radar_stuck(rate: float, known: bool) -> None:
    """An RA-4500 has steps of 1 ft to 119 ft, 2 to 199, 5 to 499, 20 to 999; here with 0.2 m of noise."""
    seconds = 240.0 / abs(rate) if abs(rate) >= 1.0 else 200.0
    rng = np.random.default_rng(5)
    for begin in (20.0, 140.0) if abs(rate) < 1.0 else (10.0,):
        low: Profile = lambda t, begin=begin: begin + abs(rate) * (t if rate > 0.0 else seconds - t)  # type: ignore[misc]  # noqa: E731
        stated: Profile = lambda t, low=low: 0.3048 * quantise_ft((low(t) + rng.normal(0.0, 0.2)) / 0.3048)  # type: ignore[misc]  # noqa: E731
        observations = samples(seconds, stated, predicted=low if known else None, alt=low, sd=0.4)
        assert {found for _, found in reasons(observations)} == {()}


@pytest.mark.parametrize("gap_s", [3.5, 20.0])
def test_a_gap_does_not_end_the_refusal_of_a_stuck_one(gap_s: float) -> None:
    observations = without_samples(samples(80.0, held(hills, 21.0, 70.0), predicted=hills), 40.0, 40.0 + gap_s)
    rows = reasons(observations)
    stuck = [Reason.STUCK in r for t, r in rows if 25.0 <= t < 70.0]
    assert all(stuck)
    assert not any(Reason.STUCK in r for t, r in rows if t >= 72.5), "2 s after it moves"


def test_after_a_gap_a_stuck_one_that_moves_is_valid_after_2_s_and_not_before() -> None:
    observations = without_samples(samples(60.0, held(hills, 21.0, 41.0), predicted=hills), 38.0, 42.0)
    found = [t for t, r in reasons(observations) if Reason.STUCK in r]
    assert found[-1] == pytest.approx(44.0, abs=0.1)


OFF_AT_20_S: Profile = lambda t: hills(t) + min(2.0 * max(0.0, t - 20.0), 20.0)  # noqa: E731


def test_a_gap_or_another_source_does_not_end_a_mismatch() -> None:
    """A drift to 20 m, refused from 26 s on; level ground then proves nothing."""
    level_then: Profile = lambda t: hills(min(t, 30.0))  # noqa: E731
    off: Profile = lambda t: level_then(t) + min(2.0 * max(0.0, t - 20.0), 20.0)  # noqa: E731
    flight = list(samples(90.0, off, predicted=level_then))
    for observations in (
        without_samples(flight, 40.0, 45.0),
        without_samples(flight, 40.0, 62.0),
        of_another_source(flight, 40.0, 6.0),
        of_another_source(of_another_source(flight, 40.0, -15.0), 43.0, -5.0, "filter"),
        of_another_source(flight, 40.0, 10.0, "ins"),
        without_position(flight, 90.0, 45.0),
    ):
        assert all(Reason.CHANGE_MISMATCH in r for t, r in reasons(observations) if t >= 27.0)


@pytest.mark.parametrize("step", [0.0, 8.0])
def test_after_a_gap_and_another_source_a_mismatch_ends_when_the_altimeter_is_right_again(step: float) -> None:
    off: Profile = lambda t: hills(t) + (min(4.0 * (t - 20.0), 20.0) if 20.0 <= t < 50.0 else 0.0)  # noqa: E731
    observations = list(samples(90.0, off, predicted=hills))
    check, found = ChangeCheck(), []
    observations = (
        without_samples(observations, 27.0, 31.0) if step == 0.0 else of_another_source(observations, 29.0, step)
    )
    found = [((o.t_ns - S) / S, check.update(o)) for o in observations]
    assert all(Reason.CHANGE_MISMATCH in r for t, r in found if 26.0 <= t < 36.0)
    assert not any(r for t, r in found if t >= 55.0)
    assert check.unexplained_sd == 0.0


@pytest.mark.parametrize("unknown_s", [15.0, 55.0])
def test_a_mismatch_outlives_unknown_ground(unknown_s: float) -> None:
    drift: Profile = lambda t: hills(t) + 1.5 * max(0.0, t - 20.0)  # noqa: E731
    observations = over_unknown_ground(samples(110.0, drift, predicted=hills), 40.0, 40.0 + unknown_s)
    assert all(Reason.CHANGE_MISMATCH in r for t, r in reasons(observations) if t >= 28.0)


def test_after_60_s_of_unknown_ground_a_mismatch_ends_and_its_last_offset_is_a_sigma() -> None:
    check = ChangeCheck()
    observations = over_unknown_ground(samples(140.0, OFF_AT_20_S, predicted=hills), 33.0, 140.0)
    found = [((o.t_ns - S) / S, check.update(o)) for o in observations]
    refused_at = [t for t, r in found if r]
    assert refused_at[-1] == pytest.approx(93.0, abs=0.2)
    assert check.unexplained_sd == pytest.approx(20.0, abs=1.5)


def test_an_offset_that_remains_after_a_mismatch_is_a_sigma_until_it_is_gone() -> None:
    off: Profile = lambda t: OFF_AT_20_S(t) if t < 80.0 else hills(t)  # noqa: E731
    check = ChangeCheck()
    found = [((o.t_ns - S) / S, check.update(o), check.unexplained_sd) for o in samples(100.0, off, predicted=hills)]
    assert not any(r for t, r, _ in found if t >= 45.0), "10 s over hills are a proof"
    for t, r, offset in found:
        if 45.0 <= t < 80.0:
            assert offset == pytest.approx(20.0, abs=1.5)
        if t < 20.0 or t >= 91.0:  # the window of scatter is 10 s long
            assert (r, offset) == ((), 0.0)


def test_an_offset_is_kept_for_10_minutes() -> None:
    check = ChangeCheck()
    offsets = {round((o.t_ns - S) / S, 2): (check.update(o), check.unexplained_sd)[1] for o in of_10_hz(700.0)}
    assert offsets[600.0] == pytest.approx(20.0, abs=1.5)
    assert offsets[660.0] == 0.0


def of_10_hz(seconds: float) -> Iterable[AltimeterObservation]:
    for k in range(round(seconds * 10)):
        t = k / 10
        yield AltimeterObservation(S + round(t * S), OFF_AT_20_S(t), hills(t), 0.5, 500.0, 0.0, INS)


def test_two_moments_that_agree_across_a_hole_of_the_ground_prove_nothing() -> None:
    """Known ground for 1 s in 9: an altimeter that is off by 20 m is not proved by two means that agree."""
    observations = list(samples(100.0, OFF_AT_20_S, predicted=hills))
    sparse = [
        o if (o.t_ns - S) / S < 30.0 or (o.t_ns - S) / S % 9.0 < 1.2 else replace(o, predicted=None)
        for o in observations
    ]
    assert all(Reason.CHANGE_MISMATCH in r for t, r in reasons(sparse) if t >= 27.0)


def test_means_that_agree_seconds_apart_do_not_end_a_mismatch() -> None:
    """Known ground for 1 s in 4, and only there the altimeter, else 20 m off, says what is predicted."""

    def is_seen(t: float) -> bool:
        return t < 30.0 or t % 4.0 < 1.2

    def value(t: float) -> float:
        return OFF_AT_20_S(t) if t < 30.0 or not is_seen(t) else hills(t)

    observations = [
        o if is_seen((o.t_ns - S) / S) else replace(o, predicted=None) for o in samples(60.0, value, predicted=hills)
    ]
    assert all(Reason.CHANGE_MISMATCH in r for t, r in reasons(observations) if t >= 27.0)


@pytest.mark.parametrize(("off_m", "ends"), [(3.0, True), (6.0, False)])
def test_over_level_ground_a_mismatch_ends_when_the_prediction_itself_confirms_the_altimeter(
    off_m: float, ends: bool
) -> None:
    """20 m too much until 20 s, and then off by so much: wrong before, within 2 sigma of 2 m now, or not."""
    value: Profile = lambda t: 120.0 if t < 20.0 else 100.0 + off_m  # noqa: E731
    check = ChangeCheck()
    observations = [replace(o, absolute_sd=2.0) for o in samples(60.0, value, predicted=level(100.0))]
    found = [((o.t_ns - S) / S, check.update(o), check.unexplained_sd) for o in observations]
    assert all(r == (Reason.CHANGE_MISMATCH,) for t, r, _ in found if 26.0 <= t < 29.0)
    assert all(bool(r) is not ends for t, r, _ in found if t >= 36.0)
    assert not ends or found[-1][2] == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize("sd", [3.0, 6.0])
def test_a_drift_that_stays_is_not_forgotten_while_sigma_is_large(sd: float) -> None:
    """12 m off from 16 s on; for 3 s the sigma is 6 m, and 12 m are no 3 sigma of a difference then."""
    drifting = samples(120.0, lambda t: 100.0 + min(12.0, 2.0 * max(0.0, t - 10.0)), predicted=level(100.0))
    observations = []
    for k, o in enumerate(drifting):
        large = 40 * HZ <= k < 43 * HZ
        value, wide = o.value + 0.01 * (k % 7 - 3), sd if large else 0.5
        observations.append(replace(o, value=value, sd=wide, absolute_sd=6.0))
    reasons_at = reasons(observations)
    assert (Reason.CHANGE_MISMATCH,) in [found for _, found in reasons_at]
    assert [found for t, found in reasons_at if t > 20.0 and not found] == []


def test_two_obstacles_across_unknown_ground_are_no_drift() -> None:
    """1.7 s and, 4 s later, 0.8 s; each alone proves nothing."""
    observations = []
    for k, o in enumerate(samples(60.0, lambda t: 80.0 if 20.0 <= t < 21.7 or 26.0 <= t < 26.8 else 100.0, predicted=level(100.0))):  # fmt: skip  # noqa: E501
        known = None if 21.7 * HZ <= k < 25.7 * HZ else o.predicted
        observations.append(replace(o, predicted=known, value=o.value + 0.01 * (k % 7 - 3)))
    assert {found for _, found in reasons(observations)} == {()}
