"""Sessions of a short flight in which a flag is hidden, and what may explain it: nothing that the unit states."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from fti.hil.truth_log import END_TOPIC, FLIGHT_METADATA, LATE_TOPIC, REAL_TIME_KEY
from fti.logger.reading.mcap_file import McapMessage
from fti.post.score.comparison import Score
from fti.post.score.observed_flags import ObservedFlags
from fti.post.score.outcome import FlightOutcome
from fti.post.score.outputs.flight_reference import flight_reference
from fti.post.score.reference_setup import read_reference_setup
from fti.post.score.rows import Result
from fti.post.score.truth_reader import read_flight_truth
from fti.post.score.unit_findings import MAX_BEHIND_SHARE
from tests.post.score.edited_sessions import DERIVED, RAW, TRUTH, Change, copy_session, file_of, rewrite, with_content
from tests.post.score.short_flight import score_of, session_of, short_scenario

FROM_S, TO_S = 10.0, 13.0
SCENARIO = short_scenario(({"kind": "cut", "devices": ("altimeter",), "from_s": FROM_S, "to_s": TO_S},))
SECOND_NS = 1_000_000_000
Seconds = Callable[[McapMessage], float]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The session of the flight."""
    return session_of(SCENARIO, tmp_path_factory.mktemp("flown"))


@pytest.fixture
def hidden(recorded: Path, tmp_path: Path) -> Path:
    """The same without the flag."""
    session = copy_session(recorded, tmp_path)
    rewrite(file_of(session, DERIVED), without_stale)
    return session


def without_stale(item: McapMessage) -> McapMessage:
    if not item.topic.name.startswith("/nav/height"):
        return item
    reasons = [reason for reason in json.loads(item.data)["reasons"] if reason != "stale"]
    return with_content(item, reasons=reasons)


def in_flight(session: Path) -> Seconds:
    begin_ns = score_of(SCENARIO, session).flight_truth.begin_ns
    return lambda item: (item.log_time - begin_ns) / SECOND_NS


def is_later(item: McapMessage, seconds: Seconds) -> bool:
    """Than 20 s; the end of the flight is."""
    return item.topic.name == END_TOPIC or seconds(item) > 20.0


def result(score: Score) -> Result:
    return next(row.result for row in score.rows if "stale" in row.flag)


def late_rows(seconds: Seconds, spans: list[tuple[float, float]]) -> Change:
    """Rows of the truth that were written when the bench had time again."""

    def change(item: McapMessage) -> McapMessage:
        for from_s, until_s in spans:
            if from_s <= seconds(item) < until_s:
                return item._replace(publish_time=item.log_time + round((until_s - seconds(item)) * SECOND_NS))
        return item._replace(publish_time=item.log_time + 2_000_000)

    return change


def test_the_flight_holds_and_is_known_to_be_accelerated(recorded: Path) -> None:
    score = score_of(SCENARIO, recorded)
    assert score.outcome is FlightOutcome.HOLDS
    assert not score.flight_truth.real_time


def test_a_hidden_flag_is_a_miss(hidden: Path) -> None:
    assert result(score_of(SCENARIO, hidden)) is Result.MISSING


def test_lateness_that_the_unit_states_explains_nothing(recorded: Path, hidden: Path) -> None:
    """Throughout the flight: that is a failure of its own."""

    def late(item: McapMessage) -> McapMessage:
        navigation = json.loads(item.data).get("navigation") if item.topic.name == "/fti/health" else None
        return with_content(item, navigation={**navigation, "lag_ms": 600.0}) if navigation else item

    rewrite(file_of(hidden, RAW), late)
    score = score_of(SCENARIO, hidden)
    assert result(score) is Result.MISSING
    assert score.outcome is FlightOutcome.FAILED
    failing = [finding.name for finding in score.findings if finding.result is Result.FAILS]
    assert failing == ["navigation in time"]
    assert MAX_BEHIND_SHARE < 0.5


def test_missing_ticks_explain_nothing(hidden: Path) -> None:
    seconds = in_flight(hidden)
    rewrite(
        file_of(hidden, RAW),
        lambda item: None if item.topic.name == "/fti/tick" and FROM_S - 1 < seconds(item) < TO_S else item,
    )
    score = score_of(SCENARIO, hidden)
    assert result(score) is Result.MISSING
    assert [finding.name for finding in score.findings if finding.result is Result.FAILS] == ["recorder"]


def test_a_session_without_any_tick_fails(recorded: Path, tmp_path: Path) -> None:
    session = copy_session(recorded, tmp_path)
    rewrite(file_of(session, RAW), lambda item: None if item.topic.name == "/fti/tick" else item)
    assert score_of(SCENARIO, session).outcome is FlightOutcome.FAILED


@pytest.mark.parametrize("stated", ["true", None])
def test_lateness_of_the_emulator_in_the_truth_explains_a_miss(hidden: Path, stated: str | None) -> None:
    """One that does not state whether it was in real time is compared by its rows."""
    seconds = in_flight(hidden)
    flight = None if stated is None else {REAL_TIME_KEY: stated}
    rewrite(
        file_of(hidden, TRUTH), late_rows(seconds, [(FROM_S - 0.5, FROM_S + 2.0)]), metadata={FLIGHT_METADATA: flight}
    )
    score = score_of(SCENARIO, hidden)
    assert score.flight_truth.real_time
    assert result(score) is Result.LATE_BENCH
    assert score.lateness.total_s == pytest.approx(2.5, abs=0.2)
    assert score.outcome is not FlightOutcome.FAILED


@pytest.mark.parametrize(("real_time", "expected"), [("true", Result.LATE_BENCH), ("false", Result.MISSING)])
def test_lateness_of_the_kernel_in_the_truth_explains_a_miss(hidden: Path, real_time: str, expected: Result) -> None:
    begin_ns = score_of(SCENARIO, hidden).flight_truth.begin_ns
    late = LATE_TOPIC, begin_ns + round(FROM_S * SECOND_NS), begin_ns + round((FROM_S + 0.5) * SECOND_NS)
    rewrite(file_of(hidden, TRUTH), metadata={FLIGHT_METADATA: {REAL_TIME_KEY: real_time}}, more=[late])
    score = score_of(SCENARIO, hidden)
    assert result(score) is expected
    assert [(p.from_s, p.until_s) for p in score.flight_truth.pauses] == ([(10.0, 10.5)] if real_time == "true" else [])


def test_a_bench_that_was_late_for_too_much_proves_nothing(hidden: Path) -> None:
    seconds = in_flight(hidden)
    rewrite(
        file_of(hidden, TRUTH), late_rows(seconds, [(9.0, 20.0)]), metadata={FLIGHT_METADATA: {REAL_TIME_KEY: "true"}}
    )
    score = score_of(SCENARIO, hidden)
    assert score.outcome is FlightOutcome.INCONCLUSIVE
    assert score.lateness.share > 0.2


def test_an_accelerated_flight_explains_no_miss(hidden: Path) -> None:
    """Whatever its rows say, and whatever the session says of itself."""
    seconds = in_flight(hidden)
    rewrite(file_of(hidden, TRUTH), late_rows(seconds, [(FROM_S - 0.5, FROM_S + 2.0)]))
    for kind in (RAW, DERIVED):
        rewrite(file_of(hidden, kind), metadata={"fti": {"name": "short", "origin": "hil"}})
    score = score_of(SCENARIO, hidden)
    assert result(score) is Result.MISSING
    assert (score.flight_truth.real_time, score.flight_truth.pauses) == (False, ())


def test_a_flight_that_goes_on_is_scored_as_far_as_its_truth_was_read(recorded: Path, tmp_path: Path) -> None:
    session = copy_session(recorded, tmp_path)
    truth, seconds = file_of(session, TRUTH), in_flight(session)
    whole = truth.read_bytes()
    rewrite(truth, lambda item: None if is_later(item, seconds) else item)
    begun = read_flight_truth(truth, SCENARIO)
    truth.write_bytes(whole)  # the emulator has written on
    reference = flight_reference(SCENARIO, read_reference_setup(begun, SCENARIO), begun, ObservedFlags())
    assert reference.truth.end_s == pytest.approx(20.0, abs=0.1)
    assert reference.table.duration_s == pytest.approx(reference.truth.end_s)


def test_a_flight_without_its_end_proves_nothing(recorded: Path, tmp_path: Path) -> None:
    session = copy_session(recorded, tmp_path)
    seconds = in_flight(session)
    rewrite(file_of(session, TRUTH), lambda item: None if is_later(item, seconds) else item)
    score = score_of(SCENARIO, session)
    assert score.outcome is FlightOutcome.INCONCLUSIVE
    assert "the end of its flight" in score.bench.text
