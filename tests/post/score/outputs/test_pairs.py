"""Outputs that belong together."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fti.post.score.outputs.pairs import glide_slopes, locations
from fti.post.score.rows import Result
from tests.post.score.outputs.synthetic_messages import messages

T = np.arange(0.0, 4.0, 0.2).tolist()
GOOD: dict[str, Any] = {"state": "ok", "t1_ratio": 0.4, "t4_ratio": 0.2}


def test_each_valid_solution_has_its_location() -> None:
    valid = [t < 2.0 for t in T]
    solution = messages("/nav/nav_solution", T, valid=valid)
    there = [t for t in T if t < 2.0]
    assert locations(messages("/nav/location", there), solution).result is Result.HOLDS
    assert locations(messages("/nav/location", there[:-1]), solution).result is Result.FAILS
    assert locations(messages("/nav/location", T), solution).result is Result.FAILS


@pytest.mark.parametrize(
    ("location", "result"),
    [
        ({}, Result.HOLDS),  # of an earlier version
        ({"heading": 1.5, "velocity": {"x": 50.0, "y": 3.0, "z": 2.0}}, Result.HOLDS),
        ({"heading": 1.6}, Result.FAILS),
        ({"velocity": {"x": 3.0, "y": 50.0, "z": 2.0}}, Result.FAILS),
        ({"velocity": {"x": 50.0, "y": 3.0, "z": -2.0}}, Result.FAILS),
        ({"velocity": "fast"}, Result.FAILS),
    ],
)
def test_a_location_moves_as_its_solution(location: dict[str, Any], result: Result) -> None:
    motion: dict[str, Any] = {"heading": 1.5, "vel_east": 50.0, "vel_north": 3.0, "vel_down": -2.0}
    solution = messages("/nav/nav_solution", T, valid=True, **motion)
    assert locations(messages("/nav/location", T, **location), solution).result is result


@pytest.mark.parametrize(
    ("monitor", "slope", "result"),
    [
        (GOOD, {"valid": True, "s": 900.0}, Result.HOLDS),
        (GOOD, {"valid": False, "s": 900.0}, Result.FAILS),
        (GOOD, {"valid": False, "s": 120.0}, Result.HOLDS),  # too close for an angle
        ({**GOOD, "t4_ratio": 1.3}, {"valid": False, "s": 900.0}, Result.HOLDS),
        ({**GOOD, "state": "unavailable"}, {"valid": True, "s": 900.0}, Result.FAILS),
    ],
)
def test_a_glide_slope_is_valid_with_a_good_monitor(monitor: Any, slope: Any, result: Result) -> None:
    integrity = messages("/nav/clearance_integrity", T, **monitor)
    assert glide_slopes(messages("/nav/glide_slope", T, **slope), integrity).result is result
    assert glide_slopes(messages("/nav/glide_slope", T[:-3], **slope), integrity).result is Result.FAILS
