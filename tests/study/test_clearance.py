"""The study of integrity with few runs: its results, and that it can fail."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import binom

from fti import parallel_runs
from fti.hil.approach_reference.approaches import START_NS, SimulatedApproach
from fti.messages.outputs import ClearanceIntegrity, IntegrityState
from fti.nav.integrity.reference import Obstacles
from fti.proportions import max_failures_by_chance, wilson
from fti.study import StudyResult, clearance
from fti.study.clearance import experiment, faults, ground, judge
from fti.study.clearance.experiment import LateJoin, NominalApproach
from fti.study.clearance.faults import FAULTS, FaultyApproach, fly_faulty
from fti.study.clearance.ground import reference, strict_reference


def by_id(results: list[StudyResult]) -> dict[str, StudyResult]:
    return {result.id: result for result in results}


def test_chance_is_that_of_the_specification() -> None:
    """3000 approaches: 39 alarms at 1 %, 6 at 0.1 %."""
    assert (max_failures_by_chance(3000, 0.01), max_failures_by_chance(3000, 0.001)) == (39, 6)
    assert max_failures_by_chance(50, 0.1) == binom.ppf(0.95, 50, 0.1)


def test_wilson_is_the_printed_interval() -> None:
    """Source: Newcombe 1998, table I: 81 of 263 is 0.2553 to 0.3662; 0 of 20 is 0 to 0.1611."""
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_too_many_alarms_do_not_hold() -> None:
    good, bad, strictly = (
        NominalApproach(False, False, 1.0, 1.0),
        NominalApproach(True, False, 1.0, 1.0),
        NominalApproach(True, True, 1.0, 1.0),
    )
    assert by_id(judge._judge_nominal([good] * 99 + [bad]))["nominal.alarms"].holds
    assert not by_id(judge._judge_nominal([good] * 90 + [bad] * 10))["nominal.alarms"].holds
    six, seven = (by_id(judge._judge_nominal([good] * (3000 - n) + [strictly] * n)) for n in (6, 7))
    assert six["strict.alarms"].holds
    assert not seven["strict.alarms"].holds
    assert seven["nominal.alarms"].holds


def test_both_references_are_one_profile_with_two_limits() -> None:
    """Their statistics are alike, so that one scan serves both; rarer alarms need higher limits."""
    plain, strict = reference(), strict_reference()
    assert all(np.array_equal(getattr(plain, name), getattr(strict, name)) for name in ("s", "z_ref", "s_ref", "s_alt"))
    assert plain.header.profile == strict.header.profile
    assert (plain.header.limits.pfa, strict.header.limits.pfa) == (0.01, 0.001)
    assert all(getattr(strict.header.limits, t) > getattr(plain.header.limits, t) for t in ("t1", "t2", "t3", "t4"))


DETECTED = FaultyApproach(True, True, True, 0.5, 0.5, 0.5, True)
MISSED = FaultyApproach(False, False, True, math.nan, math.nan, math.nan, True)


def test_a_late_alert_does_not_hold() -> None:
    late = DETECTED._replace(delay_s=2.6, size_s=2.6)
    assert by_id(judge._judge_detection("obstacle_75", [DETECTED] * 19 + [MISSED]))["obstacle_75.time_p95"].holds
    assert not by_id(judge._judge_detection("obstacle_75", [DETECTED] * 18 + [late] * 2))["obstacle_75.time_p95"].holds
    assert by_id(judge._judge_detection("height_10", [DETECTED] * 18 + [late] * 2))["height_10.time_p95"].holds
    slow = DETECTED._replace(delay_s=8.0)
    assert not by_id(judge._judge_detection("height_10", [DETECTED] * 18 + [slow] * 2))["height_10.time_p95"].holds


@pytest.mark.parametrize("missed", [2, 20])
def test_an_alert_that_never_comes_is_late(missed: int) -> None:
    """Of 20, one may be late; if only detected faults counted, a monitor that detects less would hold."""
    results = by_id(judge._judge_detection("along_60", [DETECTED] * (20 - missed) + [MISSED] * missed))
    assert (results["along_60.time_p95"].value, results["along_60.time_p95"].holds) == (math.inf, False)
    assert results["along_60.time_p50"].value == (0.5 if missed == 2 else math.inf)
    assert results["along_60.misled"].value == missed / 20


@pytest.mark.parametrize(("name", "has_time_everywhere"), [("lateral_100", False), ("height_10", True)])
def test_a_time_across_the_track_is_promised_where_a_shift_is_observable(name: str, has_time_everywhere: bool) -> None:
    """Like detection; an error of the height is observable over any ground."""
    hidden = DETECTED._replace(observable=False, delay_s=9.0, warned_s=9.0)
    results = by_id(judge._judge_detection(name, [DETECTED] * 20 + [hidden] * 20))
    names = {key for key, result in results.items() if ".time_p95" in key and result.target == "<= 7.7 s"}
    assert names == {f"{name}.time_p95" if has_time_everywhere else f"{name}.observable.time_p95"}
    assert all(results[key].holds is not has_time_everywhere for key in names)
    assert (results[f"{name}.misled"].value, results[f"{name}.not_observable.misled"].value) == (0.5, 1.0)
    late = by_id(
        judge._judge_detection(name, [DETECTED._replace(delay_s=9.0)] * 20 + [hidden._replace(delay_s=0.5)] * 20)
    )
    assert not all(late[key].holds for key in names)
    unseen = by_id(judge._judge_detection(name, [hidden] * 20))
    assert [r.holds for r in unseen.values() if r.target == "<= 7.7 s"] == [False] * has_time_everywhere


PROMISED = DETECTED._replace(is_promised=True)


@pytest.mark.parametrize(
    ("name", "approaches", "value"),
    [
        ("obstacle_150", [DETECTED] * 97 + [MISSED] * 3, 0.97),
        ("obstacle_150", [DETECTED] * 96 + [MISSED] * 4, 0.96),
        ("obstacle_60", [PROMISED] * 40 + [MISSED] * 10, 1.0),
        ("obstacle_60", [PROMISED] * 40 + [MISSED._replace(is_promised=True)] * 10, 0.8),
        ("obstacle_60", [MISSED] * 50, None),
        ("lateral_200", [DETECTED] * 30 + [MISSED._replace(observable=False)] * 20, 1.0),
        ("lateral_200", [DETECTED] * 30 + [MISSED] * 2, 0.9375),
        ("lateral_50", [DETECTED._replace(over=False)] * 9, None),
        ("height_10", [DETECTED] * 30 + [MISSED._replace(over=False)] * 20, 1.0),
        ("wrong_reference", [DETECTED] * 30 + [MISSED._replace(observable=False)] * 20, 0.6),
    ],
)
def test_detection_is_checked_where_it_is_claimed(
    name: str, approaches: list[FaultyApproach], value: float | None
) -> None:
    results = by_id(judge._judge_detection(name, approaches))
    if value is None:
        assert f"{name}.detected" not in results
    else:
        result = results[f"{name}.detected"]
        assert (result.target, result.holds) == (">= 0.97", value >= 0.97)
        assert result.value == pytest.approx(value)
    assert results[f"{name}.pd"].holds  # of all of them: reported


def test_a_promise_is_that_of_the_reference_at_the_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """60 m wide counts as 60, 150 as 100, and 20 is narrower than the table."""
    table = Obstacles(
        pd=0.97, width_m=(30.0, 60.0, 100.0), s_m=(6000.0, 3000.0, 2000.0), agl_m=(300.0, 100.0, 90.0), runs=100,
        height_m=((75.0, 20.0, 20.0), (75.0, 60.0, 20.0), (75.0, math.inf, 20.0)),
    )  # fmt: skip
    header = reference().header.model_copy(update={"obstacles": table})
    known = dataclasses.replace(reference(), header=header)
    monkeypatch.setattr(ground, "reference", lambda: known)
    kinds = ("obstacle_30", "obstacle_60", "obstacle_75", "obstacle_150")
    near, middle, far = ([ground.promises(kind, place) for kind in kinds] for place in (0, 1, 4))
    assert (near, middle, far) == ([False, True, True, True], [False, True, True, False], [False, False, True, True])


def test_an_error_below_its_alert_limit_has_a_time_from_its_size_only() -> None:
    below = DETECTED._replace(over=False, delay_s=math.nan, size_s=13.0)
    results = by_id(judge._judge_detection("lateral_50", [below] * 4))
    assert (results["lateral_50.over"].value, results["lateral_50.size_p95"].value) == (0, 13.0)
    assert "lateral_50.time_p95" not in results
    mixed = by_id(judge._judge_detection("height_10", [below, below, DETECTED, DETECTED]))
    assert (mixed["height_10.over"].value, mixed["height_10.time_p95"].value) == (2, 0.5)


def test_times_and_detection_are_split_by_what_is_observable() -> None:
    approaches = (
        [DETECTED] * 6
        + [MISSED._replace(observable=False)] * 2
        + [DETECTED._replace(observable=False, delay_s=3.0)] * 2
    )
    results = by_id(judge._judge_detection("along_60", approaches))
    parts = ("", ".observable", ".not_observable")
    assert [results[f"along_60{part}.pd"].value for part in parts] == [0.8, 1.0, 0.5]
    assert [results[f"along_60{part}.time_p50"].value for part in parts] == [0.5, 0.5, 3.0]


def test_who_is_trusted_over_the_limit_for_longer_than_it_takes_is_misled() -> None:
    """Neither ALERT nor anything else within 7.7 s; UNAVAILABLE without an ALERT does not mislead."""
    approaches = [DETECTED, MISSED, DETECTED._replace(warned_s=9.0), MISSED._replace(warned_s=0.2)]
    assert by_id(judge._judge_detection("along_60", approaches))["along_60.misled"].value == 0.5


@pytest.mark.parametrize(
    ("name", "first_over_m", "ratio"),
    [
        ("lateral_50", None, 0.5),
        ("lateral_200", 150.0, 2.0),  # half of it, half of the way over which it grows
        ("along_60", 50.0, 1.2),  # 5 / 6 of it
    ],
)
def test_a_growing_error_is_over_its_limit_where_it_has_that_size(
    name: str, first_over_m: float | None, ratio: float
) -> None:
    s = np.arange(4000.0, 2000.0, -1.0)
    flight, over = FAULTS[name].change(level(s), 3000.0, 1.0)
    assert over.max() == pytest.approx(ratio)
    assert abs(flight.nav_s - s).max() + abs(flight.nav_y).max() == pytest.approx(float(name.partition("_")[2]))
    assert (s[over >= 1.0].max(initial=-1.0) - 3000.0 == first_over_m) if first_over_m else not np.any(over >= 1.0)


def test_ten_metres_of_height_pass_their_limit_where_it_has_shrunk_to_them() -> None:
    """AL_v = 0.35 deg x s is 10 m at 1637 m."""
    s = np.arange(4000.0, 0.0, -1.0)
    flight, over = FAULTS["height_10"].change(level(s), 3000.0, -1.0)
    assert s[over >= 1.0].max() == math.floor(10.0 / math.radians(0.35))
    assert (flight.nav_alt.min(), over[s > 3000.0].max()) == (-10.0, 0.0)


def test_a_ramp_and_a_stuck_altimeter_are_over_when_the_height_is_wrong_by_the_limit() -> None:
    s = np.arange(4000.0, 0.0, -1.0)
    over = FAULTS["gnss_ramp"].change(level(s), 3000.0, 1.0)[1]
    first = s[over >= 1.0].max()
    assert (3000.0 - first) / 60.0 == pytest.approx(math.radians(0.35) * first, abs=0.05)  # 1 m/s at 60 m/s
    stuck, over = FAULTS["altimeter_stuck"].change(level(s), 3000.0, 1.0)
    assert set(stuck.agl[s <= 3000.0]) == {stuck.agl[s == 3000.0][0]}
    first = s[over >= 1.0].max()
    assert (3000.0 - first) * 0.05 == pytest.approx(math.radians(0.35) * first, abs=0.1)


def test_times_begin_where_the_fault_is_over_its_limit_and_not_where_it_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Along the track: begins at 3300 m, over AL_s at 3050 m (19 s), full at 3000 m; outputs every second."""
    states = dict.fromkeys(range(1, 40), IntegrityState.OK) | dict.fromkeys(range(16, 18), IntegrityState.ALERT)
    states |= {21: IntegrityState.CAUTION, 23: IntegrityState.ALERT}
    flight = level(np.arange(4190.0, 2000.0, -1.0))
    outputs = [
        ClearanceIntegrity(
            t_ns=START_NS + k * 10**9, t_valid_ns=None, state=state, reasons=(), valid=True, t1_ratio=0.5
        )
        for k, state in sorted(states.items())
    ]
    monkeypatch.setattr(
        faults,
        "fly_with_fault",
        lambda *arguments: (*FAULTS["along_60"].change(flight, 3000.0, 1.0), 3000.0),
    )
    monkeypatch.setattr(faults, "run_monitor", lambda *arguments: outputs)
    faulty_approach = fly_faulty(("along_60", 1, 1))
    assert (faulty_approach.detected, faulty_approach.over, faulty_approach.observable) == (True, True, True)
    assert faulty_approach.delay_s == pytest.approx(23.0 - (4190.0 - 3050.0) / 60.0)
    assert faulty_approach.size_s == pytest.approx(23.0 - (4190.0 - 3000.0) / 60.0, abs=0.02)
    assert faulty_approach.warned_s == pytest.approx(21.0 - (4190.0 - 3050.0) / 60.0)
    monkeypatch.setattr(faults, "fly_with_fault", lambda *arguments: (flight, np.full_like(flight.s, 0.9), 3000.0))
    faulty_approach = fly_faulty(("along_60", 1, 1))
    assert (
        faulty_approach.detected,
        faulty_approach.over,
        math.isnan(faulty_approach.delay_s),
        math.isnan(faulty_approach.warned_s),
    ) == (
        True,
        False,
        True,
        True,
    )
    assert not faulty_approach.trusted_again


@pytest.mark.parametrize(("trusted", "trusted_again"), [((), False), ((22,), False), ((22, 24), True)])
def test_an_alert_that_ends_before_the_error_does_is_reported(
    trusted: tuple[int, ...], trusted_again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The ALERT comes at 23 s; what was trusted before it is another question."""
    outputs = [
        ClearanceIntegrity(
            t_ns=START_NS + k * 10**9, t_valid_ns=None, reasons=(), valid=True, t1_ratio=0.5,
            state=IntegrityState.OK if k in trusted else IntegrityState.ALERT if k == 23 else IntegrityState.CAUTION,
        )
        for k in range(1, 30)
    ]  # fmt: skip
    flight = level(np.arange(4190.0, 2000.0, -1.0))
    monkeypatch.setattr(faults, "fly_with_fault", lambda *arguments: (flight, np.full_like(flight.s, 1.1), 3000.0))
    monkeypatch.setattr(faults, "run_monitor", lambda *arguments: outputs)
    faulty_approach = fly_faulty(("along_60", 1, 1))
    assert faulty_approach.trusted_again is trusted_again
    results = by_id(
        judge._judge_detection("along_60", [faulty_approach, faulty_approach._replace(trusted_again=False)])
    )
    assert results["along_60.again"].value == trusted_again / 2


def level(s: np.ndarray) -> SimulatedApproach:
    """Down a slope of 1 in 20 over level ground at 60 m/s, everything known exactly."""
    zero = np.zeros_like(s)
    return SimulatedApproach(1.0, (s[0] - s) / 60.0, s, zero, 0.05 * s, 0.05 * s, s, zero, zero, zero, zero, zero)


def test_an_approach_that_was_trusted_off_the_track_does_not_hold() -> None:
    assert all(
        result.holds
        for result in judge._judge_late_joins([LateJoin(False, False, 150.0), LateJoin(False, True, 1050.0)])
    )
    assert not by_id(judge._judge_late_joins([LateJoin(True, False, -50.0)]))["T14.before"].holds
    assert not by_id(judge._judge_late_joins([LateJoin(False, False, math.nan)]))["T14.behind"].holds


@pytest.mark.parametrize(
    ("alerted", "join_distance", "holds"),
    [(False, 299.0, True), (False, 400.0, False), (True, 400.0, True), (True, 1099.0, True), (True, 1150.0, False)],
)
def test_who_had_no_alert_is_trusted_within_300_m_and_who_had_one_within_1100(
    alerted: bool, join_distance: float, holds: bool
) -> None:
    """400 m were within the limit of both groups while they were one."""
    (result,) = judge._judge_late_joins([LateJoin(False, alerted, join_distance)])[1:]
    assert (result.id, result.holds) == ("T14.behind_alert" if alerted else "T14.behind", holds)


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        ({3000.0: "unavailable", 2300.0: "ok", 2200.0: "alert"}, (False, False, 190.8)),
        ({3000.0: "alert", 2600.0: "caution", 1400.0: "monitor"}, (False, True, 1090.8)),
        ({2600.0: "ok", 2300.0: "alert"}, (True, False, -109.2)),
        ({2300.0: "alert"}, (False, True, math.nan)),
    ],
)
def test_a_late_join_counts_the_outputs_until_it_was_trusted(
    states: dict[float, str], expected: tuple[bool, bool, float]
) -> None:
    """The track is joined 2490.8 m before the intercept point, which lies 290.8 m behind the threshold."""
    late_join = experiment.judge_late_join([output_at(s, IntegrityState(state)) for s, state in states.items()])
    assert late_join == pytest.approx(LateJoin(*expected), abs=0.1, nan_ok=True)


def output_at(s: float, state: IntegrityState) -> ClearanceIntegrity:
    return ClearanceIntegrity(t_ns=1, t_valid_ns=1, state=state, reasons=(), valid=True, s_end=s)


def test_few_runs_over_the_demonstration(monkeypatch: pytest.MonkeyPatch) -> None:
    """10 nominal approaches and two with some of the faults; the same seed gives the same."""
    some = ("obstacle_150", "along_60", "wrong_reference")
    monkeypatch.setattr(experiment, "FAULTS", {name: FAULTS[name] for name in some})
    monkeypatch.setattr(ground, "VEGETATION", (0.85,))
    monkeypatch.setattr(parallel_runs, "LOCAL_LIMIT_S", math.inf)  # each process would make its own map of the ground
    shares: list[float] = []
    results = by_id(clearance.study(10, 5, shares.append))
    assert results["nominal.alarms"].holds
    assert all(results[f"{name}.pd"].value == 1.0 for name in some)
    assert all(results[f"{name}.time_p95"].holds for name in some)
    times = [result for name, result in results.items() if name.endswith("time_p95") and result.target.startswith("<=")]
    assert len(times) >= 2  # along the track where a shift is observable, if it is anywhere
    assert all(result.holds for result in times)
    assert results["obstacle_150.detected"].value == 1.0
    claims = [result for name, result in results.items() if name.endswith(".detected")]  # where it is claimed
    assert len(claims) >= 2
    assert all(result.holds for result in claims)
    assert results["T14.before"].holds
    assert all(result.holds for name, result in results.items() if name.startswith("T14.behind"))
    assert shares[-1] == pytest.approx(1.0)
    assert experiment.fly_nominal((5, 3)) == experiment.fly_nominal((5, 3))
