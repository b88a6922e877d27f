"""Decoded measurements beside what the device meant to state."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.post.score.outputs.value_check import IntendedValues, unsent_intervals, value_rows
from fti.post.score.rows import Result
from fti.post.score.series import TopicSeries
from tests.post.score.outputs.synthetic_messages import BEGIN_NS, messages, stamp_ns

FLIGHT = (0.0, 40.0)
SECONDS = np.arange(0.5, 40.0, 1.0)
T = np.arange(0.0, 40.0, 0.1)


def pressure(t: np.ndarray) -> np.ndarray:
    return 95_000.0 + 20.0 * t


def intended(**columns: np.ndarray) -> IntendedValues:
    return {name.replace("__", "."): (stamp_ns(SECONDS), values) for name, values in columns.items()}


def result(
    series: TopicSeries, intended_values: IntendedValues, exempt: list[tuple[float, float]] | None = None
) -> Result:
    (row,) = value_rows(series, intended_values, FLIGHT, exempt or [], BEGIN_NS)
    return row.result


INTENDED = intended(static_pressure__p_static=pressure(SECONDS))


def of(values: np.ndarray) -> TopicSeries:
    return messages("/air_data/static_pressure", T.tolist(), p_static=values)


def test_what_was_meant_holds() -> None:
    noisy = pressure(T) + np.random.default_rng(1).normal(0.0, 3.0, len(T))
    assert result(of(noisy), INTENDED) is Result.HOLDS


@pytest.mark.parametrize(
    "values",
    [
        pressure(T) + 800.0,
        1.02 * pressure(T),
        np.full(len(T), pressure(T)[0]),
        np.full(len(T), np.nan),
        pressure(T[::-1]),
    ],
    ids=["bias", "scale", "frozen", "no number", "backwards"],
)
def test_other_numbers_fail(values: np.ndarray) -> None:
    assert result(of(values), INTENDED) is Result.FAILS


def test_a_fault_explains_other_numbers() -> None:
    wrong = pressure(T) + np.where(T > 20.0, 800.0, 0.0)
    assert result(of(wrong), INTENDED) is Result.FAILS
    assert result(of(wrong), INTENDED, [(19.0, 40.0)]) is Result.HOLDS


def test_readings_are_distinguished_by_name_and_vectors_by_component() -> None:
    names = ["volts", "amperes"] * (len(T) // 2)
    values = np.where(np.arange(len(T)) % 2 == 0, 28.0, 3.0)
    series = messages("/pdu/reading", T.tolist(), name=names, value=values)
    intended_values = {"reading[amperes].value": (stamp_ns(SECONDS), np.full(len(SECONDS), 3.0))}
    assert result(series, intended_values) is Result.HOLDS
    assert result(series, {"reading[volts].value": intended_values["reading[amperes].value"]}) is Result.FAILS
    vector = messages("/ins/imu_sample", T.tolist(), accel_b=[[0.1, 0.2, -9.8]] * len(T))
    third = {"imu_sample.accel_b_2": (stamp_ns(SECONDS), np.full(len(SECONDS), -9.8))}
    assert result(vector, third) is Result.HOLDS
    assert result(vector, {"imu_sample.accel_b_1": third["imu_sample.accel_b_2"]}) is Result.FAILS


def test_a_heading_through_north_is_no_jump() -> None:
    heading = np.where(T % 2.0 < 1.0, 0.01, 2.0 * math.pi - 0.01)
    series = messages("/ahrs/attitude", T.tolist(), heading=heading)
    intended_values = intended(attitude__heading=np.full(len(SECONDS), 2.0 * math.pi - 0.005))
    assert result(series, intended_values) is Result.HOLDS


def test_a_kind_is_not_required_while_the_device_has_none() -> None:
    """The other kinds go on, so that the seconds without it are known."""
    some = SECONDS < 10.0
    intended_values = {**INTENDED, "dme_range[a].slant_range": (stamp_ns(SECONDS[some]), np.full(int(some.sum()), 3e4))}
    gaps = list(unsent_intervals(intended_values, "dme_range", BEGIN_NS))
    assert min(begin for begin, _ in gaps) == pytest.approx(9.5)
    assert max(end for _, end in gaps) == pytest.approx(39.5)
    assert not list(unsent_intervals(intended_values, "static_pressure", BEGIN_NS))
    assert not list(unsent_intervals(intended_values, "device_status", BEGIN_NS))


def test_steps_of_a_protocol_are_in_its_sigma_and_a_wild_sigma_helps_nobody() -> None:
    """Heights in steps of 20 ft, of which the device states the sigma: 1.8 m."""
    true = 300.0 - 0.5 * T
    steps = np.round(true / 6.1) * 6.1
    intended_values = {"radio_height.height_agl": (stamp_ns(SECONDS), 300.0 - 0.5 * SECONDS)}
    for values, sd, expected in (
        (steps, 1.8, Result.HOLDS),
        (steps + 30.0, 1.8, Result.FAILS),
        (steps + 30.0, 100.0, Result.FAILS),
    ):
        series = messages("/altimeter/radio_height", T.tolist(), height_agl=values, sd=sd)
        assert result(series, intended_values) is expected
