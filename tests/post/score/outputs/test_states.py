"""Validity where an output has all that it needs, fields that must agree, and the protection level."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fti import config as configuration
from fti.hil.oracle.flag_definitions import FlagAllowance
from fti.hil.tables.limits import ScoreLimits
from fti.post.score.outputs.availability import availability
from fti.post.score.outputs.consistency import Consistency
from fti.post.score.outputs.protection import height_error, navigated_error, protection
from fti.post.score.rows import Result
from fti.post.score.series import TopicSeries
from tests.post.score.outputs.synthetic_messages import messages, truth

T = np.arange(0.0, 40.0, 0.2)
EVERY = np.ones(len(T), dtype=bool)
HEIGHT = "/nav/height_above_ground/altimeter"
DEMO = Path(__file__).parents[4] / "configs" / "demo.toml"
CONFIG = configuration.load(DEMO)
GLIDE = math.radians(3.0)


def _result(series: TopicSeries, may: tuple[FlagAllowance, ...] = ()) -> Result:
    (row,) = availability(series, EVERY, T, may, ScoreLimits())
    return row.result


def invalid(reasons: list[str], since_s: float) -> TopicSeries:
    stated = [reasons if t >= since_s else [] for t in T]
    return messages(
        HEIGHT, T.tolist(), valid=[not one for one in stated] if reasons else [False] * len(T), reasons=stated
    )


def test_a_valid_output_holds_and_one_that_never_is_fails() -> None:
    assert _result(messages(HEIGHT, T.tolist(), reasons=[[]] * len(T))) is Result.HOLDS
    assert _result(invalid([], 0.0)) is Result.FAILS
    assert _result(invalid(["no_profile"], 0.0)) is Result.FAILS


def test_a_first_message_without_fields_hides_nothing() -> None:
    never = messages(HEIGHT, T.tolist(), valid=False, reasons=[[]] * len(T))
    for field in ("valid", "reasons"):
        del never.rows[0][field]
    assert _result(never) is Result.FAILS
    assert Result.FAILS in consistent(never)


def test_a_location_has_its_values() -> None:
    place: dict[str, Any] = {"latitude": 52.0, "longitude": 10.0, "altitude": 500.0}
    assert consistent(messages("/nav/location", T.tolist(), **place)) == {Result.HOLDS}
    for field in place:
        assert consistent(messages("/nav/location", T.tolist(), **{**place, field: None})) == {Result.FAILS}, field


def test_a_flight_explains_its_reasons_for_a_while() -> None:
    may = (FlagAllowance(HEIGHT, 0.0, 40.0, ("incidence",)),)
    assert _result(invalid(["incidence"], 32.0), may) is Result.HOLDS
    assert _result(invalid(["incidence", "stale"], 32.0), may) is Result.FAILS
    assert _result(invalid(["incidence"], 20.0), may) is Result.FAILS


def consistent(series: TopicSeries) -> set[Result]:
    table = truth(40.0, roll=0.0, pitch=0.0)
    return {row.result for row in Consistency(series, EVERY[: len(series)], T, CONFIG, GLIDE).rows(table)}


def test_a_height_belongs_to_its_altimeter_and_its_range() -> None:
    heights = {"raw": 200.0, "nearest": 199.0, "height_agl": 190.0, "sd": 3.0}
    fine: dict[str, Any] = {"sensor": "altimeter", **heights, "datum": "agl", "point": "p"}
    assert consistent(messages(HEIGHT, T.tolist(), **fine)) == {Result.HOLDS}
    assert Result.FAILS in consistent(messages(HEIGHT, T.tolist(), **{**fine, "sensor": "autopilot"}))
    for wrong in (
        {"nearest": 210.0},
        {"sd": math.nan},
        {"datum": "msl"},
        {"point": "wheels"},
        {"reasons": [["stale"]] * len(T)},
    ):
        assert Result.FAILS in consistent(messages(HEIGHT, T.tolist(), **{**fine, **wrong})), wrong


def test_sources_are_those_of_the_configuration() -> None:
    values = dict.fromkeys(("lat", "lon", "alt", "vel_north", "vel_east", "vel_down", "roll", "pitch", "heading"), 0.0)
    sources: dict[str, Any] = {**values, "position_source": "ins", "attitude_source": "ins", "altitude_source": "ins"}
    topic = "/nav/nav_solution"
    assert consistent(messages(topic, T.tolist(), **sources)) == {Result.HOLDS}
    assert Result.FAILS in consistent(messages(topic, T.tolist(), **{**sources, "position_source": "altimeter"}))


def test_a_deviation_belongs_to_its_height_and_its_dots() -> None:
    """10 m above the path, 1000 m before the intercept point: 0.57 deg, and 1.58 dots of 0.36 deg."""
    deviation = math.degrees(math.atan2(1000.0 * math.tan(GLIDE) + 10.0, 1000.0)) - 3.0
    fine: dict[str, Any] = {
        "s": 1000.0,
        "y": 0.0,
        "dh_nav": 10.0,
        "dh": 10.0,
        "deviation": math.radians(deviation),
        "dots": deviation / 0.36,
    }
    assert deviation == pytest.approx(0.571, abs=2e-3)
    assert consistent(messages("/nav/glide_slope", T.tolist(), **fine)) == {Result.HOLDS}
    for wrong in ({"dots": -deviation / 0.36}, {"deviation": -math.radians(deviation)}, {"dh": 30.0}):
        assert Result.FAILS in consistent(messages("/nav/glide_slope", T.tolist(), **{**fine, **wrong})), wrong


def test_a_window_is_as_long_as_configured() -> None:
    topic = "/nav/clearance_integrity"
    fine: dict[str, Any] = {
        "state": "ok",
        "t2_ratio": 0.5,
        "s_begin": 1400.0,
        "s_end": 1000.0,
        "reasons": [[]] * len(T),
    }
    assert consistent(messages(topic, T.tolist(), **fine)) == {Result.HOLDS}
    for wrong in ({"s_begin": 1100.0}, {"state": "acquire"}, {"state": "monitor"}, {"t2_ratio": None}, {"s_end": None}):
        assert Result.FAILS in consistent(messages(topic, T.tolist(), **{**fine, **wrong})), wrong


@pytest.mark.parametrize(("error_m", "result"), [(5.0, Result.HOLDS), (-35.0, Result.FAILS)])
def test_an_error_beyond_the_protection_level_of_a_valid_state_fails(error_m: float, result: Result) -> None:
    table = truth(40.0, alt=(600.0, 400.0))
    true = np.interp(T, (0.0, 40.0), (600.0, 400.0))
    solution = messages("/nav/nav_solution", T.tolist(), alt=true + error_m)
    integrity = messages("/nav/clearance_integrity", T.tolist(), protection_level_v=30.0)
    error = navigated_error(integrity, solution, table)
    (row,) = protection(integrity, error, EVERY, T)
    assert row.result is result
    estimate = height_error(messages("/nav/clearance_integrity", T.tolist(), height_error=error_m), error, 15.0)
    np.testing.assert_allclose(estimate.error, 0.0, atol=1e-6)
