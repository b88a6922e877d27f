"""The monitor over a synthetic profile: what each fault looks like, when it is said and when it is over."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise

import numpy as np
import pytest
from msgspec import structs

from fti.config import Approach
from fti.messages.outputs import ClearanceIntegrity, IntegrityState
from fti.messages.reasons import Reason
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.go_around import GoAround
from fti.nav.integrity.monitor import ClearanceMonitor, ClearanceSample
from fti.nav.integrity.reference import ApproachReference
from fti.nav.integrity.statistics import Matcher
from fti.nav.integrity.window import Bins

Flight = Callable[..., Iterator[ClearanceSample]]
Ground = Callable[[np.ndarray], np.ndarray]
S = 1_000_000_000
#: Wide enough for the protection level of the fixture down to the intercept point: 10.3 m.
SETTINGS = Approach(profile="", alert_v_m=12.0)
EVALUATED = {IntegrityState.OK, IntegrityState.MONITOR, IntegrityState.CAUTION, IntegrityState.ALERT}


@pytest.fixture
def monitor(reference: ApproachReference) -> ClearanceMonitor:
    return ClearanceMonitor(reference, SETTINGS)


def run(monitor: ClearanceMonitor, samples: Iterable[ClearanceSample]) -> list[ClearanceIntegrity]:
    return [out for sample in samples if (out := monitor.step(sample)) is not None]


def states(outputs: Iterable[ClearanceIntegrity]) -> list[IntegrityState]:
    """The states, without repetitions."""
    results = [output.state for output in outputs]
    return results[:1] + [b for a, b in pairwise(results) if a is not b]


def near(outputs: list[ClearanceIntegrity], s: float) -> ClearanceIntegrity:
    return min((o for o in outputs if o.s_end is not None), key=lambda o: abs((o.s_end or 0) - s))


# ----------------------------------------------------------------------------------------------------- statistics


def bins_of(reference: ApproachReference, shift: float = 0.0, offset: float = 0.0, first: int = 200) -> Bins:
    """A window that sees the profile ``shift`` metres farther out, and ``offset`` metres higher."""
    k = round(shift / 5)
    z = reference.z_ref[first + k : first + k + 81] + offset
    return Bins(first, np.ones(81, bool), z, np.zeros(81))


@pytest.mark.parametrize("shift", [-150.0, -35.0, 0.0, 35.0, 100.0])
def test_match_finds_an_injected_shift(reference: ApproachReference, shift: float) -> None:
    statistics = Matcher(reference, 50.0).evaluate(bins_of(reference, shift), 1.0)
    assert statistics.shift == pytest.approx(shift, abs=1.0)
    assert statistics.t2 == pytest.approx(statistics.t1, abs=1e-6)
    assert (statistics.t1 > 20.0) is (shift != 0.0)


def test_match_finds_a_shift_between_the_steps(reference: ApproachReference) -> None:
    here = np.interp(reference.s[200:281] + 33.0, reference.s, reference.z_ref)
    statistics = Matcher(reference, 50.0).evaluate(Bins(200, np.ones(81, bool), here, np.zeros(81)), 1.0)
    assert statistics.shift == pytest.approx(33.0, abs=0.5)


def test_a_shift_beyond_the_last_tried_is_unknown_not_zero(reference: ApproachReference) -> None:
    bowl = dataclasses.replace(reference, z_ref=1e-3 * (reference.s - 1000.0) ** 2)
    statistics = Matcher(bowl, 50.0).evaluate(bins_of(bowl, shift=300.0), 1.0)
    assert (statistics.shift, statistics.shift_sd) == (None, None)
    assert Matcher(bowl, 50.0).evaluate(bins_of(bowl, shift=150.0), 1.0).shift == pytest.approx(150.0, abs=0.1)


def test_a_constant_height_error_is_in_t3_alone(reference: ApproachReference) -> None:
    clean = Matcher(reference, 50.0).evaluate(bins_of(reference), 1.0)
    statistics = Matcher(reference, 50.0).evaluate(bins_of(reference, offset=12.0), 1.0)
    assert statistics.height_error == pytest.approx(12.0)
    assert (statistics.t1, statistics.t2, statistics.t4) == pytest.approx((clean.t1, clean.t2, clean.t4), abs=1e-9)
    # s_b^2 = navigation 1 + datum 1 + (K / K_eff) / sum w with K_eff = 10 and w = 1 / 1.25
    assert statistics.height_error_sd == pytest.approx(math.sqrt(1 + 1 + 1.25 / 10))
    assert statistics.t3 == pytest.approx(12.0 / statistics.height_error_sd)


def test_t1_is_the_weighted_sum_of_squares(reference: ApproachReference) -> None:
    bins = bins_of(reference)
    z = bins.z + np.resize([1.0, -1.0], 81)
    statistics = Matcher(reference, 50.0).evaluate(Bins(200, bins.filled, z, bins.dh), 1.0)
    mean = 1 / 81
    assert statistics.t1 == pytest.approx(10 / 81 * 81 * (1 - mean**2) / 1.25)


def test_empty_bins_have_no_weight(reference: ApproachReference) -> None:
    bins = bins_of(reference)
    filled = np.arange(81) % 7 != 0
    statistics = Matcher(reference, 50.0).evaluate(Bins(200, filled, np.where(filled, bins.z, 0.0), bins.dh), 1.0)
    assert statistics.t1 == pytest.approx(0.0, abs=1e-9)
    assert statistics.shift == pytest.approx(0.0, abs=0.5)


def test_t4_is_the_excess_over_the_median_of_what_was_seen(reference: ApproachReference) -> None:
    bins = bins_of(reference)
    filled = np.arange(81) % 5 != 3
    residual = np.linspace(4.0, -3.0, 81)
    residual[6] = 15.0
    statistics = Matcher(reference, 50.0).evaluate(
        Bins(200, filled, np.where(filled, bins.z + residual, 0.0), bins.dh), 1.0
    )
    assert statistics.t4 == pytest.approx((15.0 - np.median(residual[filled])) / math.sqrt(1.25))


def test_observability_is_that_of_the_flatter_side_of_the_peak(reference: ApproachReference) -> None:
    statistics = Matcher(reference, 50.0).evaluate(bins_of(reference), 1.0)
    here = reference.z_ref[200:281]
    sides = [here - reference.z_ref[200 + k : 281 + k] for k in (-10, 10)]
    sharp = [10 / 81 * float(((e - e.mean()) ** 2).sum()) / 1.25 for e in sides]
    assert sharp[0] != pytest.approx(sharp[1])
    assert statistics.observability == pytest.approx(min(sharp))


def test_flat_ground_is_not_observable(reference: ApproachReference) -> None:
    flat = dataclasses.replace(reference, z_ref=np.full_like(reference.z_ref, 200.0))
    assert Matcher(flat, 50.0).evaluate(bins_of(flat), 1.0).observability == pytest.approx(0.0, abs=1e-9)
    assert Matcher(reference, 50.0).evaluate(bins_of(reference), 1.0).observability > (3 + 1.64) ** 2


# ------------------------------------------------------------------------------------------------ protection levels


def test_protection_levels_add_limit_and_missed_detection(monitor: ClearanceMonitor, flight: Flight) -> None:
    out = run(monitor, flight(begin=2990.0, end=1900.0))[-1]
    # s_b^2 = 1 + 1 + 1.25 / 10, t_3 = 4, and 3.09 of Pmd = 1e-3
    assert out.protection_level_v == pytest.approx((4.0 + 3.0902) * math.sqrt(2.125), rel=1e-3)
    assert monitor.statistics is not None
    assert out.protection_level_s == pytest.approx((3.0 + 3.0902) * monitor.statistics.shift_resolution, rel=1e-3)


def test_resolution_is_that_of_the_peak(reference: ApproachReference) -> None:
    """For a slope of 1 in 10 that changes sides every 50 m: J(d) = sum w (0.1 d)^2, and s_s = 1 / sqrt(J / d^2)."""
    zigzag = dataclasses.replace(reference, z_ref=np.abs((reference.s + 25.0) % 100.0 - 50.0) * 0.1)
    statistics = Matcher(zigzag, 50.0).evaluate(bins_of(zigzag), 1.0)
    assert statistics.shift_resolution == pytest.approx(1.0 / math.sqrt(10 * 0.01 / 1.25), rel=0.15)


def test_a_height_as_large_as_its_protection_level_is_seen_in_999_of_1000(reference: ApproachReference) -> None:
    matcher, rng = Matcher(reference, 50.0), np.random.default_rng(5)
    sd = matcher.evaluate(bins_of(reference), 1.0).height_error_sd
    errors = (4.0 + 3.0902) * sd + rng.normal(0.0, sd, 4000)
    missed = sum(matcher.evaluate(bins_of(reference, offset=error), 1.0).t3 <= 4.0 for error in errors)
    assert missed <= 12  # 4 are expected; 12 or fewer with 99.97 %


def test_a_protection_level_above_the_alert_limit_is_unavailable_but_an_obstacle_is_reported(
    reference: ApproachReference, flight: Flight
) -> None:
    strict = ClearanceMonitor(reference, Approach(profile=""))
    outputs = run(strict, flight(begin=2990.0, surface=lambda s: 60.0 if 860.0 < s < 900.0 else 0.0))
    last = (4.0 + 3.0902) * math.sqrt(2.125) / math.radians(0.35)  # from here on it is above 0.35 deg
    assert {o.state for o in outputs if o.valid and (o.s_end or 0) > last} <= {
        IntegrityState.OK,
        IntegrityState.MONITOR,
    }
    after = [o for o in outputs if 900.0 < (o.s_end or 0) < last - 20.0]
    assert after
    assert {(o.state, o.reasons[0], o.valid) for o in after} == {
        (IntegrityState.UNAVAILABLE, Reason.PROTECTION_LEVEL, False)
    }
    alert = next(o for o in outputs if o.state is IntegrityState.ALERT)
    assert Reason.OBSTACLE in alert.reasons
    assert 840.0 < (alert.s_end or 0) < 900.0


def test_an_unknown_place_is_unavailable_but_an_obstacle_is_reported(
    reference: ApproachReference, flight: Flight
) -> None:
    """A filter that coasts on a barometer knows its height within metres and its place within hundreds."""
    outputs = list[ClearanceIntegrity]()
    monitor = ClearanceMonitor(reference, SETTINGS)
    for sample in flight(begin=2990.0, surface=lambda s: 60.0 if 860.0 < s < 900.0 else 0.0):
        sd = 32.0 if sample.s > 1800.0 else 33.0  # 3.09 times that is 98.9 and 102 m; AL_y is 100 m
        outputs += run(monitor, [structs.replace(sample, horizontal_sd=sd)])
    known = [o for o in outputs if 1810.0 < (o.s_end or 0.0) < 2500.0]
    unknown = [o for o in outputs if 910.0 < (o.s_end or 0.0) < 1790.0]
    assert known
    assert {o.state for o in known} <= {IntegrityState.OK, IntegrityState.MONITOR}
    assert {(o.state, o.reasons[0], o.valid) for o in unknown} == {
        (IntegrityState.UNAVAILABLE, Reason.POSITION_UNCERTAIN, False)
    }
    assert any(o.state is IntegrityState.ALERT and Reason.OBSTACLE in o.reasons for o in outputs)


# ---------------------------------------------------------------------------------------------------------- flights


def test_nominal_approach_becomes_ok_and_stays(monitor: ClearanceMonitor, flight: Flight) -> None:
    outputs = run(monitor, flight(begin=2990.0))
    assert set(states(outputs)) <= {IntegrityState.ACQUIRE, IntegrityState.OK, IntegrityState.MONITOR}
    first = next(o for o in outputs if o.valid)
    assert 2990.0 - (first.s_end or 0) == pytest.approx(400.0, abs=15.0)
    assert sum(o.state is IntegrityState.OK for o in outputs) > 0.5 * len(outputs)
    assert all(abs(o.shift or 0) < 10 for o in outputs if o.state is IntegrityState.OK)


def test_updates_come_every_10_m_and_200_ms_whichever_is_later(monitor: ClearanceMonitor, flight: Flight) -> None:
    times = [o.t_valid_ns or 0 for o in run(monitor, flight(begin=2990.0, end=1500.0))]
    assert {b - a for a, b in pairwise(times)} == {200_000_000}


def test_a_slow_aircraft_is_evaluated_every_10_m(monitor: ClearanceMonitor, flight: Flight) -> None:
    ends = [o.s_end or 0 for o in run(monitor, flight(begin=2990.0, end=2500.0, speed=20.0))]
    assert {round(a - b, 6) for a, b in pairwise(ends)} <= {10.4}


def test_over_flat_ground_it_monitors_without_judging_the_shift(
    reference: ApproachReference, flight: Flight, ground: Ground
) -> None:
    flat = dataclasses.replace(reference, z_ref=np.full_like(reference.z_ref, 200.0))
    level = flight(begin=2990.0, end=2000.0, surface=lambda s: 200.0 - float(ground(np.array(s))))
    evaluated = [o for o in run(ClearanceMonitor(flat, SETTINGS), level) if o.valid]
    assert {o.state for o in evaluated} == {IntegrityState.MONITOR}
    assert {o.reasons for o in evaluated} == {(Reason.NOT_OBSERVABLE,)}
    assert all(o.t2_ratio is None and o.t1_ratio is not None for o in evaluated)


def test_outputs_name_window_limits_and_reference(monitor: ClearanceMonitor, flight: Flight) -> None:
    out = near(run(monitor, flight(begin=2990.0, end=1900.0)), 2000.0)
    assert (out.s_begin or 0) - (out.s_end or 0) == 400.0
    assert out.alert_limit_v == pytest.approx(max(12.0, math.radians(0.35) * (out.s_end or 0)))
    assert out.alert_limit_s == 50.0
    assert out.reference == monitor.reference.hash


def test_obstacle_alerts_at_once_and_is_over_a_whole_window_after_it_has_left_the_last(
    monitor: ClearanceMonitor, flight: Flight
) -> None:
    """T1 sees it as long as the window holds it: 400 m, and a calm window is 400 m more."""
    outputs = run(monitor, flight(begin=2990.0, surface=lambda s: 60.0 if 1960.0 < s < 2000.0 else 0.0))
    alert = next(o for o in outputs if o.state is IntegrityState.ALERT)
    over = next(o for o in outputs if o.state in (IntegrityState.OK, IntegrityState.MONITOR) and o.t_ns > alert.t_ns)
    entered, left = ((2990.0 - s) / 60.0 + 1.0 for s in (2000.0, 1960.0))
    assert Reason.OBSTACLE in alert.reasons
    assert alert.t_ns / S - entered < 0.5
    assert 800.0 / 60.0 <= over.t_ns / S - left <= 800.0 / 60.0 + 1.0
    assert states(outputs).count(IntegrityState.ALERT) == 1


def test_an_alert_outlives_a_small_obstacle_by_a_whole_window(monitor: ClearanceMonitor, flight: Flight) -> None:
    """One bin, 12 m: T4 alone sees it, and forgets it after 50 m; updates are 12 m apart."""
    outputs = run(monitor, flight(begin=2990.0, surface=lambda s: 12.0 if 1997.5 < s < 2002.5 else 0.0))
    alerts = [o for o in outputs if o.state is IntegrityState.ALERT]
    assert {o.reasons for o in alerts} <= {(Reason.OBSTACLE,), (Reason.OBSTACLE, Reason.NOT_OBSERVABLE)}
    over = [o.s_end or 0 for o in alerts if (o.t4_ratio or 0) > 0.8]
    assert 1950.0 <= min(over) < 2000.0
    assert 400.0 <= min(over) - (alerts[-1].s_end or 0) < 400.0 + 12.0 * 2


def test_an_alert_does_not_end_where_the_ground_happens_to_be_alike(
    reference: ApproachReference, monitor: ClearanceMonitor, flight: Flight
) -> None:
    """Ground that is another one in bumps of 30 m every 500 m: one leaves the window 100 m before the next is there."""
    bumpy = flight(begin=2990.0, end=900.0, surface=lambda s: 30.0 if s % 500.0 < 30.0 and s < 2600.0 else 0.0)
    outputs = run(monitor, bumpy)
    first = next(k for k, o in enumerate(outputs) if o.state is IntegrityState.ALERT)
    assert {o.state for o in outputs[first:]} == {IntegrityState.ALERT}
    calm = [o for o in outputs[first:] if max(o.t1_ratio or 0, o.t2_ratio or 0, o.t3_ratio or 0, o.t4_ratio or 0) < 0.8]
    assert len(calm) > 10


def test_a_hole_is_no_obstacle(monitor: ClearanceMonitor, flight: Flight) -> None:
    outputs = run(monitor, flight(begin=2990.0, surface=lambda s: -30.0 if 1990.0 < s < 2000.0 else 0.0))
    assert all(Reason.OBSTACLE not in o.reasons for o in outputs)


def test_navigation_35_m_ahead_raises_t1_and_t2(monitor: ClearanceMonitor, flight: Flight) -> None:
    outputs = run(monitor, flight(begin=2960.0, end=1500.0, nav_s=lambda s: s - 35.0))
    evaluated = [o for o in outputs if o.valid and o.t2_ratio is not None]
    assert evaluated
    assert all((o.t1_ratio or 0) > 1 and (o.t2_ratio or 0) > 1 for o in evaluated)
    assert evaluated[-1].state is IntegrityState.ALERT
    assert {Reason.ABSOLUTE_MATCH, Reason.SHIFTED} <= set(evaluated[-1].reasons)
    assert evaluated[-1].shift == pytest.approx(35.0, abs=3.0)


def test_navigated_height_15_m_wrong_is_a_height_error(monitor: ClearanceMonitor, flight: Flight) -> None:
    out = run(monitor, flight(begin=2990.0, end=1500.0, nav_alt=15.0))[-1]
    assert (out.state, out.reasons) == (IntegrityState.ALERT, (Reason.HEIGHT_ERROR,))
    assert out.height_error == pytest.approx(15.0, abs=0.5)


def test_flying_high_is_no_integrity_error(monitor: ClearanceMonitor, flight: Flight) -> None:
    outputs = run(monitor, flight(begin=2990.0, end=500.0, height=20.0))
    assert IntegrityState.ALERT not in states(outputs)


def test_stuck_altimeter_is_an_alert(monitor: ClearanceMonitor, flight: Flight) -> None:
    outputs = run(monitor, flight(begin=2990.0, agl=lambda s, h: h if s > 2000.0 else 100.0))
    stuck_s = (2990.0 - 2000.0) / 60.0 + 1.0
    alert = next(o for o in outputs if o.state is IntegrityState.ALERT)
    assert 0.0 < alert.t_ns / S - stuck_s < 400.0 / 60.0


@pytest.mark.parametrize("side", [-200.0, 200.0])
def test_off_track_is_refused_until_back(monitor: ClearanceMonitor, flight: Flight, side: float) -> None:
    outputs = run(monitor, flight(begin=2990.0, y=lambda s: side if 1400.0 < s < 2200.0 else 0.0))
    begin_s, back = ((2990.0 - s) / 60.0 + 1.0 for s in (2200.0, 1400.0))
    away = [o for o in outputs if o.reasons == (Reason.OFF_TRACK,)]
    assert away[0].t_ns / S - begin_s < 0.3
    assert [o for o in outputs if away[0].t_ns <= o.t_ns < back * S] == away
    assert {o.state for o in away} == {IntegrityState.UNAVAILABLE}
    assert max(b.t_ns - a.t_ns for a, b in pairwise(away)) <= 540_000_000
    after = next(o for o in outputs if o.valid and o.t_ns / S > back)
    assert 0.8 * 390.0 <= (after.t_ns / S - back) * 60.0 <= 400.0


def test_too_much_bank_is_refused_and_a_short_one_leaves_the_window_usable(
    monitor: ClearanceMonitor, flight: Flight
) -> None:
    outputs = run(monitor, flight(begin=2990.0, end=1000.0, roll=lambda s: 0.2 if 1940.0 < s < 2000.0 else 0.0))
    refused = [o for o in outputs if o.state is IntegrityState.UNAVAILABLE]
    assert {o.reasons for o in refused} == {(Reason.ROLL,)}
    following = next(o for o in outputs if o.t_ns > refused[-1].t_ns)
    assert following.valid


def test_gaps_make_the_window_unusable(monitor: ClearanceMonitor, flight: Flight) -> None:
    outputs = run(monitor, (x for x in flight(begin=2990.0, end=1000.0) if not 1900.0 < x.s < 2000.0))
    gaps = [o for o in outputs if o.reasons == (Reason.GAPS,)]
    assert gaps
    assert all(1480.0 < (o.s_end or 0) < 1901.0 for o in gaps)
    assert near(outputs, 1100.0).valid


def test_going_back_by_more_than_20_m_clears_the_window(monitor: ClearanceMonitor, flight: Flight) -> None:
    first = run(monitor, flight(begin=2990.0, end=2000.0))
    assert first[-1].valid
    assert run(monitor, flight(begin=2015.0, end=1950.0, start_ns=30 * S))[-1].valid
    again = run(monitor, flight(begin=1975.0, end=1700.0, start_ns=40 * S))
    assert set(states(again)) == {IntegrityState.ACQUIRE}


def test_past_the_intercept_point_it_ends_and_a_new_approach_begins_with_acquire(
    monitor: ClearanceMonitor, flight: Flight
) -> None:
    outputs = run(monitor, flight(begin=500.0, end=-150.0))
    assert (outputs[-1].state, outputs[-1].reasons) == (IntegrityState.UNAVAILABLE, (Reason.END,))
    again = run(monitor, flight(begin=2990.0, end=2000.0, start_ns=100 * S))
    assert states(again)[0] is IntegrityState.ACQUIRE
    assert again[-1].valid


def test_outside_the_profile_is_refused(monitor: ClearanceMonitor, flight: Flight) -> None:
    (*_, last) = run(monitor, flight(begin=3500.0, end=3100.0, agl=lambda s, h: 100.0))
    assert last.reasons == (Reason.OUTSIDE_PROFILE,)


def test_go_around_is_reported_after_3_s_of_climb(monitor: ClearanceMonitor, flight: Flight) -> None:
    run(monitor, flight(begin=2990.0, end=2000.0))
    outputs = run(monitor, flight(begin=2000.0, end=1500.0, climb=5.0, start_ns=20 * S))
    around = next(o for o in outputs if o.reasons == (Reason.GO_AROUND,))
    assert around.t_ns - 20 * S == pytest.approx(3 * S, abs=0.05 * S)
    again = run(monitor, flight(begin=1500.0, end=1000.0, start_ns=40 * S))
    assert IntegrityState.ACQUIRE in states(again)


def test_a_gust_is_no_go_around() -> None:
    judge = GoAround()
    climbs = [3.0] * 70 + [1.0] + [3.0] * 70
    assert not any(judge.step(k * S // 25, climb) for k, climb in enumerate(climbs))
    assert judge.step(6 * S, None) is False


def test_silence_is_repeated_and_one_lost_sample_has_no_output(monitor: ClearanceMonitor, flight: Flight) -> None:
    outputs = run(monitor, flight(begin=2990.0, end=2000.0))
    now = outputs[-1].t_ns
    used = now + 10**8
    monitor.step(next(flight(begin=2000.0, start_ns=used)))
    assert monitor.refuse(used + S // 10, None, (Reason.NO_RETURN,)) is None
    output = monitor.refuse(used + S // 5, None, (Reason.NO_RETURN,))
    assert output is not None
    assert (output.state, output.reasons, output.valid) == (IntegrityState.UNAVAILABLE, (Reason.NO_RETURN,), False)
    assert monitor.tick(output.t_ns + S // 4) is None
    repeated = monitor.tick(output.t_ns + S // 2)
    assert repeated is not None
    assert repeated.t_ns == output.t_ns + S // 2


def test_same_samples_same_outputs(reference: ApproachReference, flight: Flight, path: ApproachPath) -> None:
    first, second = (run(ClearanceMonitor(reference, SETTINGS), flight(seed=3)) for _ in range(2))
    assert repr(first) == repr(second)


HOSTILE = {
    "s": Reason.NO_POSITION,
    "alt": Reason.NO_POSITION,
    "agl": Reason.NO_RETURN,
    "y": Reason.OFF_TRACK,
    "roll": Reason.ROLL,
    "pitch": Reason.PITCH,
}


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_no_number_is_refused_and_forgotten(
    monitor: ClearanceMonitor, flight: Flight, name: str, value: float
) -> None:
    """For 0.4 s; afterwards the window is judged as if nothing had been."""
    outputs = []
    for k, x in enumerate(flight(begin=2990.0, end=1500.0)):
        output = monitor.step(structs.replace(x, **{name: value}) if 300 <= k < 310 else x)
        outputs += [output] if output else []
    refused = [o for o in outputs if o.state is IntegrityState.UNAVAILABLE]
    expected = {HOSTILE[name], Reason.OUTSIDE_PROFILE} if (name, value) == ("s", math.inf) else {HOSTILE[name]}
    assert {o.reasons[0] for o in refused} <= expected
    assert refused
    assert outputs[-1].valid
    assert all(math.isfinite(o.t1_ratio) for o in outputs if o.t1_ratio is not None)


@pytest.mark.parametrize("sd", [math.nan, -1.0, 0.0, math.inf])
def test_a_sigma_that_is_none_counts_as_unknown(reference: ApproachReference, sd: float) -> None:
    """No number would keep T3 below its limit for ever."""
    matcher = Matcher(reference, 50.0)
    assert (
        matcher.evaluate(bins_of(reference, offset=12.0), sd).t3
        == matcher.evaluate(bins_of(reference, offset=12.0), None).t3
    )


def test_late_duplicated_and_backward_samples_do_not_upset_it(monitor: ClearanceMonitor, flight: Flight) -> None:
    samples = list(flight(begin=2990.0, end=1500.0))
    mixed = [x for k in range(0, len(samples) - 5, 5) for x in (samples[k + 3], *samples[k : k + 3], samples[k + 1])]
    outputs = run(monitor, mixed)
    assert {o.state for o in outputs if o.valid} <= {IntegrityState.OK, IntegrityState.MONITOR}
    assert outputs[-1].valid
