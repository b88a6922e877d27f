"""The curve of the smallest faults, against sums by hand and against events of flights."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fti.study.faults.curve import smallest_detected, table
from fti.study.faults.detectability import filter_response, separation_sds


def test_a_filter_that_follows_at_once_and_a_sigma_that_stays() -> None:
    """By hand: copies replaced at 8 s, every 2 s; 6 s of a ramp of 1 m/s are 6 m, against 0.5 m: 7.29 * 0.5 / 6."""
    moved = np.stack((np.arange(20.0), np.zeros(20)), axis=1)
    sds = np.tile([0.5, 1.0], (20, 1))
    assert smallest_detected(moved, sds, 8) == pytest.approx(7.29 * 0.5 / 6.0)


def test_the_age_at_which_it_is_seen_best_counts() -> None:
    """By hand: sigma grows with the square of the age, t^2 / 10: t / ((t + 2)^2 / 10) is largest at 2 s, 1.25."""
    age = np.arange(1.0, 21.0)
    moved = np.stack((np.arange(20.0), np.zeros(20)), axis=1)
    assert smallest_detected(moved, np.stack((age**2 / 10.0, age), axis=1), 8) == pytest.approx(7.29 / 1.25)


def test_a_filter_that_does_not_move_sees_nothing() -> None:
    assert smallest_detected(np.zeros((20, 2)), np.ones((20, 2)), 8) == np.inf


def test_the_filter_comes_to_follow_a_ramp_of_position_and_velocity() -> None:
    """With a MEMS unit, of which it holds little, within a minute; with a navigation grade one it lags."""
    t = np.arange(61.0)
    moved = filter_response("mems", np.stack((t, np.ones(61)), axis=1))
    assert moved[-1] == pytest.approx([60.0, 1.0], rel=0.05)
    assert filter_response("navigation", np.stack((t, np.ones(61)), axis=1))[10, 1] < 0.6


def test_sigma_of_the_separation_is_that_of_flights() -> None:
    """Events of flights with a tactical unit (test_fault_detection): 0.6 m and 0.1 m/s at ages of 7 to 14 s."""
    sds = separation_sds("tactical", 14)
    assert 0.4 < sds[7, 0] < 1.0
    assert 0.05 < sds[7, 1] < 0.15
    assert np.all(np.diff(sds, axis=0) > 0.0)


def test_the_table_has_the_figures_of_the_safety_page() -> None:
    text = (Path(__file__).parents[2] / "docs/safety.md").read_text(encoding="utf-8")
    assert all(row in text for row in table().splitlines()[2:])
