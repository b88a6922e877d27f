"""The comparison itself, on what a daemon might have said."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fti.config import TerrainFiles
from fti.devices import bind_devices
from fti.hil.oracle.roles import TruthSeries
from fti.hil.scenario import Scenario
from fti.post.reprocess import Setup
from fti.post.score.comparison import Score, score_flight
from fti.post.score.observed_flags import ObservedFlags, Words
from fti.post.score.outcome import FlightOutcome
from fti.post.score.report import as_json, as_text
from fti.post.score.rows import Result
from fti.post.score.truth_reader import FlightPause, FlightTruth, merge_pauses
from fti.post.score.truth_table import TruthTable
from tests.post.score.short_flight import daemon_config, short_scenario

HEIGHT = "/nav/height_above_ground/altimeter"
CUT = {"kind": "cut", "devices": ("altimeter",), "from_s": 20.0, "to_s": 23.0}  # too short for health
STALE = frozenset({"stale"})
NOTHING: Words = frozenset()


def flight_truth(end_s: float = 40.0, *pauses: FlightPause, bank_s: tuple[float, float] = (0.0, 0.0)) -> FlightTruth:
    t = np.arange(0.0, end_s + 0.02, 0.04)
    roll = np.where((t > bank_s[0]) & (t < bank_s[1]), math.radians(40.0), 0.0)
    table = TruthTable(np.rint(1e9 * t).astype(np.int64), {})
    return FlightTruth(
        Path("truth.mcap"),
        0,
        table,
        TruthSeries(t, 0 * t + 200.0, 4000.0 - 60.0 * t, 0 * t, roll, 0 * t, 0 * t),
        pauses,
    )


def observe(*statements: tuple[float, str, Words]) -> ObservedFlags:
    observed_flags = ObservedFlags()
    for t, place, words in statements:
        observed_flags.feed(t, place, words)
    return observed_flags


@pytest.fixture
def setup(tmp_path: Path) -> Setup:
    config = daemon_config(tmp_path)
    return Setup(config, {}, bind_devices(config), None)


def score(
    setup: Setup,
    observed: ObservedFlags,
    flight: FlightTruth | None = None,
    faults: tuple[dict[str, object], ...] = (CUT,),
) -> Score:
    return score_flight(short_scenario(faults), setup, flight or flight_truth(), observed)


def height_result(result: Score) -> Result:
    return next(row.result for row in result.rows if row.flag == f"{HEIGHT} stale")


def test_a_flag_in_time_and_gone_in_time_is_found(setup: Setup) -> None:
    result = score(setup, observe((20.6, HEIGHT, STALE), (23.1, HEIGHT, NOTHING)))
    (row,) = result.rows
    assert result.holds
    assert row.result is Result.FOUND
    assert (row.after_s, row.clear_s) == pytest.approx((0.6, 0.1))


def test_nothing_reported_is_a_miss(setup: Setup) -> None:
    result = score(setup, observe())
    assert not result.holds
    assert height_result(result) is Result.MISSING


def test_a_flag_of_another_place_is_a_miss_and_not_expected(setup: Setup) -> None:
    other = "/nav/height_above_ground/laser"
    result = score(setup, observe((20.6, other, STALE), (23.1, other, NOTHING)))
    assert height_result(result) is Result.MISSING
    assert [one.place for one in result.unexpected] == [other]


def test_a_flag_after_its_time_is_late(setup: Setup) -> None:
    result = score(setup, observe((20.9, HEIGHT, STALE), (23.1, HEIGHT, NOTHING)))
    assert height_result(result) is Result.LATE
    assert not result.holds


def test_a_flag_that_stays_does_not_clear_and_is_not_expected(setup: Setup) -> None:
    result = score(setup, observe((20.6, HEIGHT, STALE)))
    assert height_result(result) is Result.STAYS
    (rest,) = result.unexpected
    assert (rest.word, rest.until_s) == ("stale", float("inf"))
    assert rest.from_s > 24.0


def test_a_flag_that_the_next_fault_raises_goes_with_that(setup: Setup) -> None:
    observed = observe((20.6, HEIGHT, STALE), (26.1, HEIGHT, NOTHING))
    at_once, later = ({**CUT, "from_s": from_s, "to_s": from_s + 3.0} for from_s in (23.0, 25.5))
    assert score(setup, observed, faults=(CUT, at_once)).holds
    assert height_result(score(setup, observed, faults=(CUT, later))) is Result.STAYS


def test_a_flag_without_a_cause_is_not_expected(setup: Setup) -> None:
    result = score(setup, observe((12.0, HEIGHT, STALE), (12.5, HEIGHT, NOTHING)), faults=())
    assert not result.holds
    assert [(one.from_s, one.until_s) for one in result.unexpected] == [(12.0, 12.5)]


def test_what_the_flight_explains_is_expected(setup: Setup) -> None:
    roll, banked = frozenset({"roll"}), flight_truth(bank_s=(30.0, 32.0))
    assert score(setup, observe((30.1, HEIGHT, roll), (32.1, HEIGHT, NOTHING)), banked, faults=()).holds
    assert not score(setup, observe((27.1, HEIGHT, roll), (29.1, HEIGHT, NOTHING)), banked, faults=()).holds


def test_a_deviation_is_expected_at_the_edge_in_the_beam_and_nowhere_else(setup: Setup) -> None:
    flight, deviation = flight_truth(), frozenset({"deviation"})
    nav = setup.config.nav.model_copy(update={"terrain": TerrainFiles(scene="demo_country")})
    setup = replace(setup, config=setup.config.model_copy(update={"nav": nav}))
    here = np.where(flight.truth.t < 30.0, 160.0, 180.0)
    over_wood = replace(flight, truth=replace(flight.truth, ranges={"altimeter": (here, here, here)}))
    for at_s, holds in ((29.92, True), (27.0, False), (33.0, False)):
        observed = observe((at_s, HEIGHT, deviation), (at_s + 0.12, HEIGHT, NOTHING))
        assert score(setup, observed, over_wood, faults=()).holds is holds
        assert not score(setup, observed, faults=()).holds
    stays = observe((29.92, HEIGHT, deviation), (31.5, HEIGHT, NOTHING))
    assert not score(setup, stays, over_wood, faults=()).holds


@pytest.mark.parametrize(
    ("sd", "at_s", "result"),
    [(5.0, 20.1, Result.FOUND), (5.2, 20.1, Result.FOUND), (3.0, 20.1, Result.MISSING), (5.0, 24.0, Result.LATE)],
)
def test_a_number_that_must_be_stated_is_looked_for(setup: Setup, sd: float, at_s: float, result: Result) -> None:
    worse = {"kind": "gnss_degraded", "devices": ("gnss",), "from_s": 20.0, "to_s": 30.0}
    observed = observe()
    for axis in ("horizontal", "vertical"):
        observed.values[f"/gnss/position.{axis}_sd"] = [(19.0, 2.0), (at_s, sd), (31.0, 2.0)]
    found = score(setup, observed, faults=({**worse, "horizontal_m": 5.0, "vertical_m": 5.0},))
    assert {row.result for row in found.rows} == {result}


def test_what_is_reported_before_the_daemon_knows_anything_is_no_flag(setup: Setup) -> None:
    assert score(setup, observe((-1.0, HEIGHT, STALE), (3.0, HEIGHT, NOTHING)), faults=()).holds


@pytest.mark.parametrize(
    ("kind", "keys", "word", "holds"),
    [
        ("stuck", {}, "silent", False),
        ("stuck", {}, "damaged bytes", False),
        ("clock_jump", {"by_s": 0.05}, "clock away", True),
        ("clock_jump", {"by_s": 0.05}, "wrong rate", False),
        ("cut", {}, "silent", True),
        ("cut", {}, "damaged bytes", False),
        ("bit_errors", {"rate": 1e-6}, "damaged bytes", True),
    ],
)
def test_a_fault_explains_its_own_words_of_health(
    setup: Setup, kind: str, keys: dict[str, object], word: str, holds: bool
) -> None:
    fault = {"kind": kind, "devices": ("spare",), "from_s": 20.0, "to_s": 21.0, **keys}
    health = "/fti/health/devices/spare"
    observed = observe((20.5, health, frozenset({word})), (21.5, health, NOTHING))
    assert score(setup, observed, faults=(fault,)).holds is holds


def test_a_fault_does_not_explain_what_only_has_a_name_like_its_device(setup: Setup) -> None:
    """Of the source of the position: navigation's change of source is explained, a restart of navigation is not."""
    fault = {"kind": "cut", "devices": ("gnss",), "from_s": 20.0, "to_s": 21.0}
    for name, holds in (("nav", True), ("navigation", False)):
        place = f"/fti/event/{name}"
        observed = observe((20.5, place, frozenset({"restarted"})), (20.5, place, NOTHING))
        assert (not score(setup, observed, faults=(fault,)).unexpected) is holds, name


def test_a_warning_without_a_cause_is_not_expected(setup: Setup) -> None:
    event = frozenset({"failed and goes on"})
    result = score(
        setup, observe((12.0, "/fti/event/pipeline", event), (12.0, "/fti/event/pipeline", NOTHING)), faults=()
    )
    assert [one.word for one in result.unexpected] == ["failed and goes on"]


def test_what_was_not_flown_is_not_scored(setup: Setup) -> None:
    result = score(setup, observe(), flight_truth(20.5))
    assert result.holds
    assert height_result(result) is Result.NOT_FLOWN


def test_a_pause_of_the_machine_is_allowed_for(setup: Setup) -> None:
    late = observe((20.9, HEIGHT, STALE), (23.1, HEIGHT, NOTHING))
    assert height_result(score(setup, late, flight_truth(40.0, FlightPause(20.2, 20.5)))) is Result.FOUND
    assert height_result(score(setup, late, flight_truth(40.0, FlightPause(2.0, 2.3)))) is Result.LATE


@pytest.mark.parametrize(
    ("place", "word", "seconds"),
    [
        (HEIGHT, "stale", 7.5),
        ("/fti/health/devices/spare", "wrong rate", 7.5),
        ("/fti/health/devices/spare", "clock away", 14.0),
        ("/nav/clearance_integrity", "alert", 14.0),
    ],
)
def test_so_long_after_a_pause_flags_are_not_scored(setup: Setup, place: str, word: str, seconds: float) -> None:
    late = flight_truth(60.0, FlightPause(20.0, 20.5))
    for until_s, holds in ((20.5 + seconds, True), (20.6 + seconds, False)):
        observed = observe((20.2, place, frozenset({word})), (until_s, place, NOTHING))
        assert score(setup, observed, late, faults=()).holds is holds


def test_a_miss_in_a_pause_is_reported_as_such_and_shows_nothing(setup: Setup) -> None:
    result = score(setup, observe(), flight_truth(40.0, FlightPause(20.0, 22.0)))
    assert height_result(result) is Result.LATE_BENCH
    assert result.outcome is FlightOutcome.INCONCLUSIVE
    assert as_text(result)[-1].startswith("inconclusive: 0 of 0")


def test_a_pause_behind_the_time_of_a_flag_explains_nothing(setup: Setup) -> None:
    cut = {**CUT, "to_s": 30.0}
    for observed in (observe(), observe((25.0, HEIGHT, STALE), (30.1, HEIGHT, NOTHING))):
        result = height_result(score(setup, observed, flight_truth(40.0, FlightPause(22.0, 22.2)), faults=(cut,)))
        assert result is (Result.LATE if observed.spans else Result.MISSING)


def test_a_pause_before_a_cause_explains_a_late_flag_and_not_a_missing_one(setup: Setup) -> None:
    """The flag is due 0.8 s after the cause, and a window of 5 s begins anew behind the pause."""
    cut, late = {**CUT, "to_s": 30.0}, flight_truth(40.0, FlightPause(19.0, 19.2))
    expected = {24.9: Result.LATE_BENCH, 25.2: Result.LATE}
    for came_s, result in expected.items():
        observed = observe((came_s, HEIGHT, STALE), (30.1, HEIGHT, NOTHING))
        assert height_result(score(setup, observed, late, (cut,))) is result
    assert height_result(score(setup, observe(), late, (cut,))) is Result.MISSING
    cut = {**CUT, "to_s": 24.0}
    assert height_result(score(setup, observe(), late, (cut,))) is Result.LATE_BENCH


def test_a_pause_before_the_end_of_a_cause_explains_that_its_flag_stays(setup: Setup) -> None:
    observed = observe((20.6, HEIGHT, STALE), (26.0, HEIGHT, NOTHING))
    assert height_result(score(setup, observed, flight_truth(40.0, FlightPause(22.5, 22.7)))) is Result.LATE_BENCH
    assert height_result(score(setup, observed, flight_truth(40.0, FlightPause(10.0, 10.2)))) is Result.STAYS


def test_what_nobody_knows_yet_is_reported(setup: Setup) -> None:
    stuck = {"kind": "stuck", "devices": ("altimeter",), "from_s": 20.0, "to_s": 23.0}
    result = score(setup, observe(), faults=(stuck,))
    assert result.holds
    assert [row.result for row in result.rows] == [Result.UNKNOWN]
    assert "not known yet" in "\n".join(as_text(result))


@pytest.mark.parametrize(
    ("value", "observed", "result"),
    [
        (10.0, 10.4, Result.FOUND),
        (10.0, 10.6, Result.MISSING),
        (10.0, 9.8, Result.FOUND),
        (10.0, 9.7, Result.MISSING),
        (10.0, None, Result.MISSING),
        (True, True, Result.FOUND),
        (True, False, Result.MISSING),
        ("ok", "ok", Result.FOUND),
        ("ok", "alert", Result.MISSING),
        ("stale", ["roll", "stale"], Result.FOUND),
        ("stale", [], Result.MISSING),
    ],
)
def test_expected_values(setup: Setup, value: object, observed: object, result: Result) -> None:
    expectation = {"channel": "/nav/x.y", "at_s": 20.0, "value": value, "plus": 0.5, "minus": 0.25, "within_s": 1.0}
    flight: Scenario = short_scenario((), expect=(expectation,))
    observed_at_20 = ObservedFlags()
    observed_at_20.values["/nav/x.y"] = [(19.9, value), (20.5, observed), (21.1, value)]
    found = score_flight(flight, setup, flight_truth(), observed_at_20)
    assert found.expected[0].result is result
    assert found.holds is (result is Result.FOUND)


def test_pauses_that_touch_are_one() -> None:
    parts = [FlightPause(5.0, 6.0), FlightPause(1.0, 2.0), FlightPause(1.5, 3.0)]
    assert list(merge_pauses(parts)) == [FlightPause(1.0, 3.0), FlightPause(5.0, 6.0)]


def test_a_status_that_is_not_repeated_ends() -> None:
    observed = observe((20.0, "/pickups/device_status", frozenset({"lost"})), (30.0, "/pickups/device_status", NOTHING))
    (span,) = observed.intervals("/pickups/", ["lost"])
    assert (span.from_s, span.until_s) == (20.0, 22.0)


def test_for_programs_it_is_the_same(setup: Setup) -> None:
    content = as_json(score(setup, observe((20.6, HEIGHT, STALE))))
    assert content["holds"] is False
    assert [row["verdict"] for row in content["rows"]] == ["does not clear"]
    assert content["unexpected"][0]["until_s"] is None


@pytest.mark.parametrize(
    ("first_report_s", "real_time", "unexpected"),
    [
        (1.0, True, True),
        (5.0, True, True),
        (8.0, True, False),
        (11.0, True, False),
        (40.0, True, False),
        (8.0, False, True),
        (40.0, False, True),
    ],
)
def test_the_start_ends_a_window_after_navigation_began_or_had_to(
    setup: Setup, first_report_s: float, real_time: bool, unexpected: bool
) -> None:
    """An accelerated flight has no start; no other takes longer than it may."""
    health, wrong = "/fti/health/devices/spare", frozenset({"wrong rate"})
    observed = observe((11.5, health, wrong), (12.5, health, NOTHING), (20.0, health, wrong), (21.0, health, NOTHING))
    observed.first_report_s = first_report_s
    result = score(setup, observed, replace(flight_truth(), real_time=real_time), faults=())
    assert [one.from_s for one in result.unexpected] == ([11.5, 20.0] if unexpected else [20.0])


def test_what_is_reported_while_the_daemon_waits_for_the_flight_is_not_scored(setup: Setup) -> None:
    link, silent = "/fti/health/links/spare", frozenset({"silent"})
    for until_s, holds in ((1.0, True), (7.0, False)):
        observed = observe(
            (-163.0, link, silent), (-92.0, link, NOTHING), (-5.0, link, silent), (until_s, link, NOTHING)
        )
        observed.first_report_s = -188.0
        assert score(setup, observed, faults=()).holds is holds, until_s


@pytest.mark.parametrize(
    ("first_report_s", "from_s", "result"),
    [
        (6.0, 5.0, Result.START),
        (6.0, 6.5, Result.MISSING),
        (9.9, 9.0, Result.START),
        (19.0, 9.0, Result.START),
        (19.0, 11.0, Result.MISSING),
        (math.inf, 11.0, Result.MISSING),
    ],
)
def test_a_required_flag_in_the_start_is_not_scored_and_a_later_one_is(
    setup: Setup, first_report_s: float, from_s: float, result: Result
) -> None:
    """However long the unit took: a start that is longer than allowed explains nothing."""
    observed = observe()
    observed.first_report_s = first_report_s
    cut = {**CUT, "from_s": from_s, "to_s": from_s + 3.0}
    found = score(setup, observed, faults=(cut,))
    assert height_result(found) is result
    assert height_result(score(setup, observed, replace(flight_truth(), real_time=False), (cut,))) is Result.MISSING


@pytest.mark.parametrize(
    ("first_report_s", "real_time", "holds"), [(9.9, True, True), (10.1, True, False), (0.1, False, False)]
)
def test_a_unit_that_begins_too_late_fails(setup: Setup, first_report_s: float, real_time: bool, holds: bool) -> None:
    observed = observe()
    observed.first_report_s = first_report_s
    result = score(setup, observed, replace(flight_truth(), real_time=real_time), faults=())
    assert result.outcome is (FlightOutcome.HOLDS if holds else FlightOutcome.FAILED)


def test_a_navigation_that_never_begins_fails(setup: Setup) -> None:
    observed = observe()
    observed.first_report_s = math.inf
    result = score(setup, observed, faults=())
    assert result.outcome is FlightOutcome.FAILED
    assert "no report of navigation" in as_text(result)[-1]


@pytest.mark.parametrize(("behind_s", "holds"), [(7.9, True), (8.1, False), (40.0, False)])
def test_navigation_that_is_behind_explains_nothing_and_fails_by_itself(
    setup: Setup, behind_s: float, holds: bool
) -> None:
    observed = observe()
    observed.lag_intervals.append(FlightPause(0.0, behind_s))
    assert score(setup, observed, faults=()).holds is holds
    assert height_result(score(setup, observed)) is Result.MISSING


def test_navigation_may_be_behind_where_the_bench_was_late_and_while_it_starts(setup: Setup) -> None:
    observed = observe()
    observed.lag_intervals.append(FlightPause(0.0, 14.9))
    observed.first_report_s = 10.0
    assert score(setup, observed, faults=()).holds
    observed.lag_intervals.append(FlightPause(20.0, 29.0))
    assert not score(setup, observed, faults=()).holds
    assert score(setup, observed, flight_truth(40.0, FlightPause(20.0, 24.0)), faults=()).holds


@pytest.mark.parametrize(
    ("gaps", "ticks", "holds"),
    [
        ([(20.0, 20.4)], (-1.0, 41.0), True),
        ([(20.0, 20.4), (25.0, 25.5)], (-1.0, 41.0), False),  # more than a fiftieth of the flight
        ([(20.0, 21.1)], (-1.0, 41.0), False),
        ([], (9.0, 41.0), True),
        ([], (11.5, 41.0), False),
        ([], (-1.0, 37.5), True),
        ([], (-1.0, 35.0), False),
        ([], (math.inf, -math.inf), False),
    ],
)
def test_missing_ticks_explain_nothing_and_fail_by_themselves(
    setup: Setup, gaps: list[tuple[float, float]], ticks: tuple[float, float], holds: bool
) -> None:
    observed = observe()
    observed.tick_gaps, observed.ticks = [FlightPause(*gap) for gap in gaps], ticks
    assert score(setup, observed, faults=()).holds is holds
    assert height_result(score(setup, observed)) is Result.MISSING


def test_ticks_may_be_missing_where_the_bench_was_late(setup: Setup) -> None:
    observed = observe()
    observed.tick_gaps = [FlightPause(20.0, 22.5)]
    assert not score(setup, observed, faults=()).holds
    assert score(setup, observed, flight_truth(40.0, FlightPause(20.0, 22.4)), faults=()).holds


@pytest.mark.parametrize(
    ("pauses", "outcome"),
    [
        ([FlightPause(10.0, 29.9)], FlightOutcome.HOLDS),
        ([FlightPause(10.0, 30.1)], FlightOutcome.INCONCLUSIVE),  # a fifth of the flight
        ([FlightPause(t, t + 0.2) for t in range(6, 66, 10)], FlightOutcome.HOLDS),
        (
            [FlightPause(t, t + 0.2) for t in range(6, 76, 10)],
            FlightOutcome.INCONCLUSIVE,
        ),  # half of it is not compared then
    ],
)
def test_a_bench_that_is_late_for_too_much_proves_nothing(
    setup: Setup, pauses: list[FlightPause], outcome: FlightOutcome
) -> None:
    assert score(setup, observe(), flight_truth(100.0, *pauses), faults=()).outcome is outcome


def test_a_miss_is_a_miss_however_late_the_bench_was_elsewhere(setup: Setup) -> None:
    result = score(setup, observe(), flight_truth(40.0, FlightPause(26.0, 39.0)))
    assert height_result(result) is Result.MISSING
    assert result.outcome is FlightOutcome.FAILED
    assert result.bench.result is Result.LATE_BENCH


def test_a_flight_in_which_nothing_is_scored_proves_nothing(setup: Setup) -> None:
    assert score(setup, observe(), flight_truth(4.0), faults=()).outcome is FlightOutcome.INCONCLUSIVE
    assert score(setup, observe(), flight_truth(6.0), faults=()).outcome is FlightOutcome.HOLDS


def test_the_lateness_of_the_bench_is_reported(setup: Setup) -> None:
    result = score(setup, observe(), flight_truth(40.0, FlightPause(10.0, 11.0), FlightPause(15.0, 18.0)), faults=())
    content = as_json(result)["excused"]
    assert (content["share"], content["number"], content["longest_s"]) == (pytest.approx(0.1), 2, 3.0)
    assert "late 2 times, at most 3.00 s, in total 10.0% of the flight" in "\n".join(as_text(result))


def test_when_navigation_began_is_reported(setup: Setup) -> None:
    observed = observe()
    observed.first_report_s = 12.3
    result = score(setup, observed, faults=())
    assert "first report of navigation after 12.3 s" in "\n".join(as_text(result))
    assert as_json(result)["began_s"] == 12.3


@pytest.mark.parametrize(("last_report_s", "holds"), [(39.0, True), (35.5, True), (24.0, False)])
def test_a_navigation_that_is_gone_when_the_flight_ends_fails(setup: Setup, last_report_s: float, holds: bool) -> None:
    """However much of the flight was before; that it is behind since then explains nothing."""
    observed = observe()
    observed.last_report_s = last_report_s
    observed.lag_intervals.append(FlightPause(last_report_s, 40.0))
    result = score(setup, observed, faults=())
    assert result.holds is holds
    assert ("no report of navigation in the last 16 s" in as_text(result)[-1]) is not holds
