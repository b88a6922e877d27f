"""Intervals and activity: what is computed in a stream is what numpy computes of all times at once."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.logger.statistics.interval_stats import MAX_GAPS, Intervals, TimeGap
from fti.logger.statistics.topic_stats import MAX_BINS, Activity

SECOND = 1_000_000_000
BEGIN = 1_767_323_045_000_000_000


def regular(rate_hz: float, seconds: float, jitter_s: float = 0.0, seed: int = 0) -> NDArray[np.int64]:
    """Times of a topic at a rate, each late by up to a jitter."""
    periods = np.arange(round(rate_hz * seconds)) / rate_hz
    late = np.random.default_rng(seed).uniform(0.0, jitter_s, len(periods))
    return BEGIN + np.round((periods + late) * SECOND).astype(np.int64)


def intervals_of(times: NDArray[np.int64], piece: int = 1000) -> Intervals:
    statistics = Intervals()
    for at in range(0, len(times), piece):
        statistics.add(times[at : at + piece])
    return statistics


def test_jitter_is_that_of_all_intervals_at_once() -> None:
    times = regular(100, 60, jitter_s=0.002)
    found, expected = intervals_of(times), np.diff(times) / SECOND
    assert found.count == len(times) - 1
    assert found.sd_s == pytest.approx(expected.std(), rel=1e-6)
    assert found.p99_s == pytest.approx(np.quantile(expected, 0.99), rel=0.01)
    assert found.usual_s == pytest.approx(np.quantile(expected, 0.95), rel=0.01)
    assert (found.gap_count, found.gaps) == (0, [])


def test_a_gap_is_found_and_does_not_spoil_the_jitter() -> None:
    times = regular(50, 40)
    times = np.concatenate((times[:500], times[600:]))
    intervals = intervals_of(times, piece=7)
    assert intervals.gap_count == 1
    assert intervals.gaps == [TimeGap(int(times[499]), 2_020_000_000)] == [intervals.longest]
    assert intervals.gap_limit_s == pytest.approx(0.1, rel=0.03)
    assert intervals.sd_s == pytest.approx(0.0, abs=1e-6)
    assert intervals.p99_s == pytest.approx(0.02, abs=1e-6)


def test_bursts_are_no_gaps() -> None:
    """Twenty frames at once, ten times a second."""
    bursts = np.repeat(regular(10, 60), 20) + np.tile(np.arange(20) * 3_000, 600)
    intervals = intervals_of(np.asarray(bursts, np.int64))
    assert intervals.gap_count == 0
    assert intervals.usual_s == pytest.approx(0.1, rel=0.01)


def test_of_many_gaps_the_longest_are_kept_and_all_are_counted() -> None:
    lengths = np.concatenate(([0.01] * 100_000, np.linspace(1, 2, 300)))
    times = BEGIN + np.round(np.cumsum(np.random.default_rng(0).permutation(lengths)) * SECOND).astype(np.int64)
    intervals = intervals_of(times, piece=8192)
    assert intervals.gap_count == pytest.approx(300, abs=1)  # the first interval may be one of them
    assert len(intervals.gaps) == MAX_GAPS
    assert min(gap.length_ns for gap in intervals.gaps) == pytest.approx(1.334 * SECOND, rel=0.01)
    assert intervals.gaps == sorted(intervals.gaps)


def test_times_that_go_back_are_no_interval() -> None:
    intervals = intervals_of(BEGIN + np.array([0, 10, 5, 20], np.int64) * SECOND)
    assert intervals.longest == TimeGap(BEGIN, 10 * SECOND)
    assert intervals.count == 3


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_messages_have_no_intervals(count: int) -> None:
    intervals = Intervals()
    if count:
        intervals.add(np.array([BEGIN]))
    assert (intervals.longest, intervals.usual_s, intervals.gap_limit_s, intervals.sd_s, intervals.p99_s) == (None,) * 5
    assert (intervals.gap_count, intervals.gaps) == (0, [])


def test_messages_of_one_moment_are_no_gaps() -> None:
    intervals = intervals_of(np.array([BEGIN] * 3))
    assert (intervals.gap_count, intervals.sd_s) == (0, 0.0)


# ------------------------------------------------------------------------------------------------------- activity


def test_activity_counts_everything_in_little_memory() -> None:
    statistics = Activity()
    for part in np.split(regular(100, 4000), 400):
        statistics.add(part)
    assert len(statistics._bins) <= MAX_BINS
    counts = statistics.counts(BEGIN, BEGIN + 4000 * SECOND, 40)
    assert sum(counts) == 400_000
    assert counts == pytest.approx([10_000] * 40, rel=0.03)


def test_silence_is_nothing_and_the_usual_rate_is_one() -> None:
    times = regular(100, 100)
    statistics = Activity()
    statistics.add(np.concatenate((times[:4000], times[6000:])))
    rates = statistics.relative(BEGIN, BEGIN + 100 * SECOND, 50, 0.01 * SECOND)
    assert rates[21:30] == [0.0] * 9
    assert rates[20] == pytest.approx(0.0, abs=0.05)  # a bin stands on its edge
    assert rates[:20] + rates[30:] == pytest.approx([1.0] * 40, rel=0.05)


def test_a_slow_topic_is_no_comb() -> None:
    statistics = Activity()
    statistics.add(regular(1, 30))
    assert min(statistics.relative(BEGIN, BEGIN + 30 * SECOND, 150, 1.0 * SECOND)) > 0.5


def test_what_is_rare_stays_where_it_is() -> None:
    statistics = Activity()
    statistics.add(BEGIN + np.array([10, 50]) * SECOND)
    rates = statistics.relative(BEGIN, BEGIN + 100 * SECOND, 100, 40.0 * SECOND)
    assert [n for n, rate in enumerate(rates) if rate] == [10, 50]
