"""Assertions on the messages of a topic, each against numbers that are known, and what their messages say."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from fti.hil.tables.fault_types import Fog
from fti.post.score.series import TopicSeries
from fti.post.score.truth_table import TruthTable
from fti.testing.topic import FlightContext, Topic

BEGIN_NS, SECOND_NS = 1_700_000_000_000_000_000, 1_000_000_000
END_S = 20.0
FAULTS = (Fog(kind="fog", from_s=5.0, to_s=10.0, visibility_m=50.0),)
LAT = math.radians(60.0)


def truth() -> TruthTable:
    """At 25 Hz: a climb of 2 m/s from 100 m, a turn of 0.5 rad/s through north, at 60 degrees north."""
    t = np.arange(0.0, END_S + 0.01, 0.04)
    columns = {"alt": 100.0 + 2.0 * t, "heading": 6.0 + 0.5 * t, "lat": np.full(len(t), LAT), "lon": 0.001 * t}
    return TruthTable(BEGIN_NS + (t * SECOND_NS).astype(np.int64), columns)


def topic(
    make: Callable[[float], dict[str, Any]],
    times_s: Sequence[float],
    interval: tuple[float, float] = (0.0, END_S),
    name: str = "/unit/position",
    where: Mapping[str, object] = MappingProxyType({}),
) -> Topic:
    """Messages at these times; each is true when it comes, unless it has a stamp that says otherwise."""
    log_ns = np.array([BEGIN_NS + round(t * SECOND_NS) for t in times_s], dtype=np.int64)
    series = TopicSeries(name, log_ns, [make(t) for t in times_s])
    return Topic(series, FlightContext(truth(), FAULTS, "\nsession: /tmp/session"), interval, where)


def ten_hz(until_s: float = END_S) -> list[float]:
    return [k / 10 for k in range(round(until_s * 10))]


def failure(call: Callable[..., None], *arguments: Any, **named: Any) -> str:
    with pytest.raises(AssertionError) as caught:
        call(*arguments, **named)
    return str(caught.value)


def right(t: float) -> dict[str, Any]:
    return {"alt": 100.0 + 2.0 * t}


# ---------------------------------------------------------------------------------------------------------- times


def test_rate() -> None:
    result = topic(right, ten_hz())
    result.assert_rate(9.9, 10.1)
    message = failure(result.assert_rate, 10.5)
    assert "/unit/position, 0 to 20 s: rate 10.00 Hz (200 messages); limit at least 10.5 Hz" in message
    assert "session: /tmp/session" in message
    assert "limit at least 1 Hz, at most 9 Hz" in failure(result.assert_rate, 1.0, 9.0)


def test_a_topic_that_ends_early_has_neither_its_rate_nor_its_gap() -> None:
    result = topic(right, ten_hz(5.0))
    assert "rate 2.50 Hz" in failure(result.assert_rate, 9.0)
    assert "longest gap 15.100 s, from 4.90 s on; limit 1 s" in failure(result.assert_longest_gap, 1.0)
    topic(right, ten_hz(5.0), (1.0, 4.9)).assert_longest_gap(0.11)


def test_a_topic_that_begins_late_has_a_gap() -> None:
    assert "longest gap 3.000 s, from 0.00 s on" in failure(
        topic(right, [3.0, 4.0], (0.0, 5.0)).assert_longest_gap, 2.0
    )


def test_a_topic_without_a_message_in_the_interval_fails_everything() -> None:
    result = topic(right, ten_hz(2.0), (5.0, 9.0))
    assert "rate 0.00 Hz" in failure(result.assert_rate, 1.0)
    for call in (lambda: result.assert_valid_share(0.0), lambda: result.assert_error("alt", 1e9)):
        assert "no message" in failure(call)
    assert "no message" in failure(result.assert_no_flag, "x")


# --------------------------------------------------------------------------------------------------------- values


def test_valid_share() -> None:
    result = topic(lambda t: {"valid": t < 15.0}, ten_hz())
    result.assert_valid_share(0.75)
    assert "75.0% of 200 messages are valid; limit at least 80.0%" in failure(result.assert_valid_share, 0.8)
    assert "first invalid message at 15.00 s" in failure(result.assert_valid_share, 0.8)


def test_error_names_the_worst() -> None:
    result = topic(lambda t: {"alt": 100.0 + 2.0 * t + (7.0 if t == 12.0 else 0.5)}, ten_hz())
    result.assert_error("alt", 7.001)
    message = failure(result.assert_error, "alt", 1.0)
    assert "alt: error +7 m at 12.00 s (131, truth 124); limit +-1 m" in message
    assert "1 of 200 valid messages are beyond" in message
    result.assert_error("alt", 1.0, share=0.995)
    assert "limit +-1 m for 99.9% of the messages" in failure(result.assert_error, "alt", 1.0, share=0.999)


def test_the_truth_is_taken_at_the_time_of_validity() -> None:
    """Half a second old, as its stamp says: 1 m in this climb."""

    def old(t: float) -> dict[str, Any]:
        return {"alt": 100.0 + 2.0 * (t - 0.5), "stamp": {"t_valid_ns": BEGIN_NS + round((t - 0.5) * SECOND_NS)}}

    topic(old, [t for t in ten_hz() if t > 1.0]).assert_error("alt", 0.001)
    late = topic(lambda t: {"alt": old(t)["alt"]}, [t for t in ten_hz() if t > 1.0])
    assert "error -1 m" in failure(late.assert_error, "alt", 0.9)


def test_a_heading_is_compared_around_the_circle() -> None:
    result = topic(lambda t: {"heading": (6.0 + 0.5 * t + 0.01) % (2 * math.pi)}, ten_hz(), name="/unit/attitude")
    result.assert_error("heading", 0.0101)
    assert "error +0.01 rad" in failure(result.assert_error, "heading", 0.0099)


@pytest.mark.parametrize(("quantity", "metres"), [("lat", 6_383_454.0 * 1e-6), ("lon", 6_394_209.0 * 0.5 * 1e-6)])
def test_a_place_is_compared_in_metres_along_the_ground(quantity: str, metres: float) -> None:
    """A microradian at 60 degrees north: radii of curvature of WGS84 by hand, 6383454 m and 6394209 m."""
    place: dict[str, Callable[[float], float]] = {"lat": lambda t: LAT, "lon": lambda t: 0.001 * t}
    result = topic(lambda t: {quantity: place[quantity](t) + 1e-6}, ten_hz())
    result.assert_error(quantity, metres * 1.001)
    assert " m at " in failure(result.assert_error, quantity, metres * 0.999)


def test_velocities_have_their_own_names_in_the_truth() -> None:
    columns = {"vel_down": np.array([1.0, 1.0])}
    table = TruthTable(np.array([BEGIN_NS, BEGIN_NS + 10 * SECOND_NS]), columns)
    series = TopicSeries("/unit/velocity", np.array([BEGIN_NS + SECOND_NS]), [{"down": 1.5}])
    result = Topic(series, FlightContext(table, (), ""), (0.0, 10.0), {})
    result.assert_error("down", 0.6)
    assert "down: error +0.5 m/s" in failure(result.assert_error, "down", 0.4)


def test_what_is_not_valid_is_not_compared_and_nothing_at_all_is_a_failure() -> None:
    half = topic(lambda t: {"alt": 0.0 if t < 10.0 else 100.0 + 2.0 * t, "valid": t >= 10.0}, ten_hz())
    half.assert_error("alt", 0.001)
    none = topic(lambda t: {"alt": None, "valid": False}, ten_hz())
    assert "nothing to compare: 0 of 200 messages are valid" in failure(none.assert_error, "alt", 1.0)


def test_a_number_that_is_none_is_no_success() -> None:
    result = topic(lambda t: {"alt": math.nan}, ten_hz())
    assert "nothing to compare" in failure(result.assert_error, "alt", 1.0)


def test_a_wrong_name_is_reported_with_those_that_there_are() -> None:
    result = topic(lambda t: {"alt": 1.0, "msl": 2.0, "stamp": {}}, ten_hz())
    assert "no message has a field 'altitude'; fields: alt, msl" in failure(result.assert_error, "altitude", 1.0)
    assert "has no 'msl'; select a quantity with truth=: alt, heading, lat, lon" in failure(
        result.assert_error, "msl", 1.0
    )


def test_error_within_the_stated_sigma() -> None:
    result = topic(lambda t: {"alt": 100.0 + 2.0 * t + 2.0, "vertical_sd": 1.0 if t < 10.0 else 0.5}, ten_hz())
    result.assert_error_within_sigma("alt", "vertical_sd", k=4.01)
    message = failure(result.assert_error_within_sigma, "alt", "vertical_sd")
    assert "limit +-3 vertical_sd = 1.5 m; " in message
    assert "100 of 200 valid messages are beyond" in message


@pytest.mark.parametrize("sd", [None, 0.0, -1.0, math.nan])
def test_without_a_sigma_nothing_fits_it(sd: float | None) -> None:
    result = topic(lambda t: right(t) | {"vertical_sd": sd if t >= 3.0 else 1.0}, ten_hz())
    assert "170 messages state no vertical_sd, the first at 3.00 s" in failure(
        result.assert_error_within_sigma, "alt", "vertical_sd"
    )


def test_messages_are_chosen_by_their_fields() -> None:
    result = topic(
        lambda t: {"name": "a" if round(t * 10) % 2 else "b", "value": 1.0}, ten_hz(), name="/x/y", where={"name": "a"}
    )
    assert len(result) == 100
    assert "/x/y [name = a], 0 to 20 s: rate 5.00 Hz" in failure(result.assert_rate, 6.0)


# ---------------------------------------------------------------------------------------------------------- flags


def flagged(*spans: tuple[float, float]) -> Topic:
    return topic(lambda t: {"flags": ["low"] if any(a <= t < b for a, b in spans) else []}, ten_hz())


def test_a_flag_in_time() -> None:
    flagged((5.5, 10.5)).assert_flag("low", fault=0, raised_within_s=0.6, cleared_within_s=0.6)
    flagged((5.5, 10.5)).assert_flag("low", cause_s=(5.2, 10.3), raised_within_s=0.6, cleared_within_s=0.6)
    flagged((5.5, 99.0)).assert_flag("low", fault=0, raised_within_s=0.6)


@pytest.mark.parametrize(
    ("spans", "message"),
    [
        ([], "not raised between 5.00 s and 5.60 s; it was never raised"),
        ([(7.0, 10.0)], "not raised between 5.00 s and 5.60 s; it was raised at 7.00 s"),
        ([(1.0, 2.0)], "not raised between 5.00 s and 5.60 s"),
        ([(4.0, 10.0)], "raised at 4.00 s, before its cause at 5.00 s"),
        ([(5.5, 12.0)], "raised at 5.50 s, is cleared at 12.00 s; its cause ended at 10.00 s, limit 0.6 s after it"),
        ([(5.5, 99.0)], "raised at 5.50 s, is not cleared"),
        ([(5.5, 10.0), (15.0, 16.0)], "raised at 15.00 s, is cleared at 16.00 s"),
    ],
)
def test_a_flag_at_the_wrong_time(spans: list[tuple[float, float]], message: str) -> None:
    text = failure(flagged(*spans).assert_flag, "low", fault=0, raised_within_s=0.6, cleared_within_s=0.6)
    assert f"flag 'low': {message}" in text


def test_a_condition_is_a_flag_too() -> None:
    result = topic(lambda t: {"valid": not 5.5 <= t < 10.5}, ten_hz())
    result.assert_flag(lambda row: not row["valid"], fault=0, raised_within_s=0.6, cleared_within_s=0.6)
    assert "flag of the given condition: raised at 5.50 s; limit never" in failure(
        result.assert_no_flag, lambda row: not row["valid"]
    )


def test_no_flag() -> None:
    flagged().assert_no_flag("low")
    flagged((5.0, 6.0)).assert_no_flag("high")
    assert "flag 'low': raised at 5.00 s; limit never" in failure(flagged((5.0, 6.0)).assert_no_flag, "low")


def test_a_fault_that_the_scenario_has_not() -> None:
    with pytest.raises(ValueError, match="one of the 1 faults from 0"):
        flagged().assert_flag("low", fault=1, raised_within_s=1.0)
