"""The time base of a long session follows a clock that bends with its temperature."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from fti.config import Device
from fti.messages.measurements import TimeScale
from fti.nav.device_time.clock_estimator import ClockEstimator
from fti.post.sync import ComputerClock, DeviceClockSeries, Sync
from fti.post.time_base import STEP_NS, time_base

SECOND_NS = 1_000_000_000
MS = 1_000_000
FTI_0 = 1_800_000_000 * SECOND_NS
LATENCY_NS = 5 * MS
HOURS = 3


def bend_ns(t_s: float) -> float:
    """The drift swings by 0.5 ppm in three hours, around 2 ppm [ns]."""
    turn = 2 * math.pi / (HOURS * 3600)
    return 1e3 * (2.0 * t_s + 0.5 / turn * (1 - math.cos(turn * t_s)))


def clock_over(seconds: int) -> DeviceClockSeries:
    device = Device(name="receiver", link="line", driver="nmea0183", latency_ms=5.0)
    clock_series = DeviceClockSeries(device, ClockEstimator(TimeScale.GPS, LATENCY_NS, SECOND_NS, None, "receiver"))
    rng = np.random.default_rng(2)
    late = np.abs(rng.normal(0.0, 0.5, seconds)) + np.where(rng.random(seconds) < 0.2, 25.0, 0.0)
    for k in range(seconds):
        t_ns = FTI_0 + k * SECOND_NS
        clock_series.feed(t_ns + LATENCY_NS + round(late[k] * MS), k * SECOND_NS + round(bend_ns(k)))
    clock_series.clock.finish()
    return clock_series


def no_computer() -> ComputerClock:
    return ComputerClock(*np.zeros((4, 0), dtype=np.int64))


def test_rows_every_ten_minutes_follow_the_bend() -> None:
    rows = time_base(Sync(FTI_0, [clock_over(HOURS * 3600)], no_computer()))
    assert len(rows) == HOURS * 6 + 1
    assert all(0 < b.t_fti_ns - a.t_fti_ns <= STEP_NS for a, b in pairwise(rows))
    for row in rows:
        t_s = (row.t_fti_ns - FTI_0) / SECOND_NS
        error_ms = (row.clock_ns - (row.t_fti_ns - FTI_0) - bend_ns(t_s)) / MS
        assert abs(error_ms) < 0.25, (t_s, error_ms)
    straight = max(abs(bend_ns(t) - bend_ns(HOURS * 3600) * t / (HOURS * 3600)) for t in range(0, HOURS * 3600, 600))
    assert straight / MS > 1.0  # what one line for all would be wrong by


def test_a_session_of_an_hour_is_one_line() -> None:
    rows = time_base(Sync(FTI_0, [clock_over(600)], no_computer()))
    assert [row.segment for row in rows] == [0, 0]
    assert rows[-1].t_fti_ns - rows[0].t_fti_ns > 590 * SECOND_NS


def test_a_clock_that_is_not_known_has_no_rows() -> None:
    assert time_base(Sync(FTI_0, [clock_over(5)], no_computer())) == []
