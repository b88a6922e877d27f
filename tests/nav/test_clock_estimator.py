"""A device's clock relative to FTI time: estimate, sigma, and the effect of wrong clocks."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fti.messages.measurements import TimeScale
from fti.nav.device_time.clock_estimator import (
    MAX_LATENESS_NS,
    MIN_OUTLIERS,
    TIMEOUT_SEGMENT_NS,
    TIMEOUT_TRUST_NS,
    ClockEstimator,
    ClockState,
)

SECOND_NS = 1_000_000_000
MS = 1_000_000
DAY_NS = 86_400 * SECOND_NS
FTI_0 = 1_800_000_000 * SECOND_NS
LATENCY_NS = 20 * MS
MAX_AGE_NS = 500 * MS

Delays = Callable[[np.random.Generator, int], np.ndarray]


def quick(rng: np.random.Generator, n: int) -> np.ndarray:
    """Half a millisecond of scheduling, now and then more."""
    return np.asarray(np.abs(rng.normal(0.0, 0.5, n)) + np.where(rng.random(n) < 0.1, rng.uniform(0.0, 25.0, n), 0.0))


@dataclasses.dataclass
class Device:
    """A device whose clock is fast by drift_ppm and began at zero_ns; messages arrive late by delays [ms]."""

    drift_ppm: float = 0.0
    zero_ns: int = 315_000_000 * SECOND_NS
    rate_hz: float = 5.0
    delays: Delays = quick
    seed: int = 1

    def messages(self, begin_s: float, end_s: float) -> Iterable[tuple[int, int, int]]:
        """(when it was true, arrival, time of the device) [ns], the first two in FTI time."""
        n = int((end_s - begin_s) * self.rate_hz)
        late = self.delays(np.random.default_rng((self.seed, int(begin_s))), n)
        for k in range(n):
            t_ns = round((begin_s + k / self.rate_hz) * SECOND_NS)
            dev_ns = self.zero_ns + t_ns + round(t_ns * self.drift_ppm * 1e-6)
            yield FTI_0 + t_ns, FTI_0 + t_ns + LATENCY_NS + round(late[k] * MS), dev_ns


def make_clock(scale: TimeScale = TimeScale.GPS) -> ClockEstimator:
    return ClockEstimator(scale, LATENCY_NS, MAX_AGE_NS, name="receiver")


def run(clock: ClockEstimator, device: Device, begin_s: float, end_s: float) -> list[tuple[int, int | None]]:
    """(true time, time of validity by the clock), per message."""
    return [(true, clock.feed(rx, dev)) for true, rx, dev in device.messages(begin_s, end_s)]


def errors_ms(rows: list[tuple[int, int | None]]) -> list[float]:
    return [(valid_ns - true) / MS for true, valid_ns in rows if valid_ns is not None]


@settings(max_examples=settings().max_examples // 4)
@given(
    drift_ppm=st.floats(-90.0, 90.0),
    zero_ns=st.integers(0, 2**62),
    rate_hz=st.sampled_from([1.0, 5.0, 20.0]),
    seed=st.integers(0, 2**20),
)
def test_offset_and_drift_are_found_and_validity_times_follow(
    drift_ppm: float, zero_ns: int, rate_hz: float, seed: int
) -> None:
    device = Device(drift_ppm, zero_ns, rate_hz, seed=seed)
    clock = make_clock()
    rows = run(clock, device, 0.0, 200.0)
    assert clock.state is ClockState.GOOD
    assert len(clock.segments) == 1
    segment = clock.segments[0]
    assert abs(segment.drift_ppm - drift_ppm) <= max(3 * 1e6 * segment.line.slope_95, 0.01)
    late = rows[len(rows) // 2 :]
    assert all(valid_ns is not None for _, valid_ns in late)
    assert max(map(abs, errors_ms(late))) < 1.5  # arrivals were off by up to 25 ms
    at = FTI_0 + 200 * SECOND_NS
    assert clock.device_ns(at) == pytest.approx(
        zero_ns + 200 * SECOND_NS + round(200_000 * drift_ppm), abs=1.5 * MS + 4 * clock.sd_ns(at)
    )


def test_before_it_is_known_the_arrival_counts() -> None:
    clock = make_clock()
    assert [valid_ns for _, valid_ns in run(clock, Device(), 0.0, 8.0)] == [None] * 40
    assert clock.state is ClockState.LEARNING


@settings(max_examples=settings().max_examples // 3)
@given(
    jumps_ms=st.lists(st.integers(-(2**40), 2**40), min_size=1, max_size=4),
    delay_ms=st.floats(0.0, 3000.0),
    seed=st.integers(0, 2**20),
)
def test_whatever_a_clock_does_no_message_is_younger_than_its_arrival_or_older_than_a_way_holds(
    jumps_ms: list[int], delay_ms: float, seed: int
) -> None:
    """Always latency <= arrival - validity <= maximum lateness; else the clock is not trusted."""
    clock = make_clock()
    zero_ns = 0

    def sometimes_late(rng: np.random.Generator, n: int) -> np.ndarray:
        return np.asarray(np.where(rng.random(n) < 0.5, rng.uniform(0.0, delay_ms, n), 0.0))

    for i, jump_ms in enumerate([0, *jumps_ms]):
        zero_ns += jump_ms * MS
        device = Device(zero_ns=zero_ns, delays=sometimes_late, seed=seed)
        for _, rx, dev in device.messages(40.0 * i, 40.0 * (i + 1)):
            valid_ns = clock.feed(rx, dev)
            assert valid_ns is None or LATENCY_NS <= rx - valid_ns <= LATENCY_NS + MAX_LATENESS_NS


def test_a_late_message_keeps_the_time_at_which_it_was_true_and_is_counted() -> None:
    """Source 003, figure 6.10: logs that come 25 ms and more late carry the time of their validity."""

    def logs(rng: np.random.Generator, n: int) -> np.ndarray:
        return np.asarray(np.abs(rng.normal(0.0, 0.3, n)) + np.where(np.arange(n) % 10 == 9, 80.0, 0.0))

    clock = make_clock()
    run(clock, Device(delays=logs), 0.0, 60.0)
    rows = run(clock, Device(delays=logs), 60.0, 120.0)
    assert max(map(abs, errors_ms(rows))) < 1.0
    assert 50 <= clock.segments[0].late <= 60  # all but those before the clock was known
    assert clock.segments[0].largest_ns == pytest.approx(80 * MS, abs=2 * MS)
    assert clock.refused == 0


@pytest.mark.parametrize("step_s", [-1.0, 1.0, 0.2, -0.2, 30.0, -3600.0 * 24 * 365])
def test_a_step_is_not_trusted_and_then_starts_a_new_segment(step_s: float) -> None:
    """A leap second, a restart, a receiver that finds its date."""
    clock = make_clock(TimeScale.UTC)
    before = Device(drift_ppm=2.0)
    after = dataclasses.replace(before, zero_ns=before.zero_ns + round(step_s * SECOND_NS))
    run(clock, before, 0.0, 60.0)
    clock.drain_event_texts()
    rows = run(clock, after, 60.0, 180.0)
    tail = [(true, valid_ns) for true, valid_ns in rows if true - FTI_0 - 60 * SECOND_NS > TIMEOUT_TRUST_NS + SECOND_NS]
    assert max(map(abs, errors_ms(tail)), default=0.0) < 1.5
    assert len(clock.segments) == 2
    assert clock.segments[1].first_ns - FTI_0 == pytest.approx(60 * SECOND_NS, abs=SECOND_NS)
    learned = next(true for true, valid_ns in tail if valid_ns is not None) - FTI_0 - 60 * SECOND_NS
    assert TIMEOUT_SEGMENT_NS < learned < 3 * TIMEOUT_SEGMENT_NS
    news = clock.drain_event_texts()
    match = re.search(r"stepped by ([-+.0-9]+) s", news[0])
    assert match
    assert float(match[1]) == pytest.approx(step_s, abs=0.03)
    assert all("is known" in text for text in news[1:])
    assert rows[-1][1] is not None


@pytest.mark.parametrize(
    ("scale", "period_ns"),
    [
        (TimeScale.BOOT, 2**32 * MS),
        (TimeScale.GPS, 7 * DAY_NS),
        (TimeScale.GPS, 1024 * 7 * DAY_NS),
        (TimeScale.UTC, DAY_NS),
    ],
)
def test_a_counter_that_starts_again_goes_on(scale: TimeScale, period_ns: int) -> None:
    clock = make_clock(scale)
    device = Device(drift_ppm=1.0, zero_ns=period_ns - 100 * SECOND_NS)
    rows = []
    for true, rx, dev in device.messages(0.0, 200.0):
        rows.append((true, clock.feed(rx, dev % period_ns)))
    assert len(clock.segments) == 1
    assert clock.refused == 0
    assert max(map(abs, errors_ms(rows[500:]))) < 1.0
    assert rows[500][1] is not None
    at = FTI_0 + 200 * SECOND_NS
    assert clock.device_ns(at) == pytest.approx(100 * SECOND_NS, abs=2 * MS)
    assert sum("counter" in text for text in clock.drain_event_texts()) == 1


def test_a_burst_after_a_stall_is_put_back_where_it_belongs() -> None:
    """The machine reads nothing for 0.4 s; then everything comes at once."""

    def stall(rng: np.random.Generator, n: int) -> np.ndarray:
        t = np.arange(n) / 20.0 % 30.0
        return np.asarray(np.where((t > 20.0) & (t < 20.4), 1e3 * (20.4 - t), np.abs(rng.normal(0.0, 0.2, n))))

    clock = make_clock()
    device = Device(rate_hz=20.0, delays=stall)
    run(clock, device, 0.0, 60.0)
    rows = run(clock, device, 60.0, 120.0)
    assert len(errors_ms(rows)) == len(rows)
    assert max(map(abs, errors_ms(rows))) < 1.0


def test_a_backlog_beyond_the_age_limit_does_not_pass_for_fresh() -> None:
    """A converter holds everything for 3 s and then sends it at once: most of it is stale, and must be seen to be."""

    def backlog(rng: np.random.Generator, n: int) -> np.ndarray:
        t = np.arange(n) / 20.0
        return np.asarray(np.where((t > 30.0) & (t < 33.0), 1e3 * (33.0 - t), 0.2))

    clock = make_clock()
    device = Device(rate_hz=20.0, delays=backlog)
    run(clock, device, 0.0, 60.0)
    rows = run(clock, device, 60.0, 120.0)
    assert len(errors_ms(rows)) == len(rows)
    assert max(map(abs, errors_ms(rows))) < 1.0
    assert clock.refused > 0


@pytest.mark.parametrize("step_s", [-0.4, -0.8, -1000.0])
def test_a_clock_that_goes_back_is_not_trusted_after_few_messages(step_s: float) -> None:
    """What is merely late comes in order: five messages from before the newest are of a clock that was set."""
    clock = make_clock()
    before = Device(rate_hz=50.0)
    after = dataclasses.replace(before, zero_ns=before.zero_ns + round(step_s * SECOND_NS))
    run(clock, before, 0.0, 60.0)
    rows = run(clock, after, 60.0, 68.0)
    assert all(valid_ns is None for _, valid_ns in rows[MIN_OUTLIERS:])
    assert clock.state is ClockState.AWAY


def test_a_clock_that_stands_still_is_not_reported() -> None:
    clock = make_clock()
    for k in range(1000):
        assert clock.feed(FTI_0 + k * 100 * MS, 0) is None
    assert clock.drain_event_texts() == []


def test_a_clock_that_bends_with_its_temperature_is_followed() -> None:
    """From -1 to +1 ppm within the two hours: validity times stay within a millisecond."""
    clock = make_clock()
    worst = 0.0
    rng = np.random.default_rng(4)
    for k in range(7200):
        t_ns = k * SECOND_NS
        bend_ns = round((-1.0 + k / 7200.0) * 1e-6 * t_ns)
        valid_ns = clock.feed(FTI_0 + t_ns + LATENCY_NS + round(abs(rng.normal(0.0, 0.3)) * MS), t_ns + bend_ns)
        if k > 60:
            assert valid_ns is not None
            worst = max(worst, abs(valid_ns - FTI_0 - t_ns) / MS)
    assert worst < 1.0
    assert len(clock.segments) == 1


@pytest.mark.parametrize(("period_ms", "resolution_ns"), [(20.0, 0), (20.4, 1 * MS), (1000 / 3, 1 * MS)])
def test_the_resolution_of_a_clock_limits_what_is_known_of_it(period_ms: float, resolution_ns: int) -> None:
    """A clock with a resolution of milliseconds; times at whole multiples of the period may be exact."""
    clock = make_clock(TimeScale.BOOT)
    for k in range(round(60_000 / period_ms)):
        t_ns = round(k * period_ms * MS)
        clock.feed(FTI_0 + t_ns + LATENCY_NS, t_ns // MS * MS)
    clock.finish()
    segment = clock.segments[0]
    assert segment.resolution_ns == resolution_ns
    assert segment.line.slope_95 >= resolution_ns / (60 * SECOND_NS)
    assert abs(segment.drift_ppm) <= 1e6 * segment.line.slope_95


def test_the_first_message_may_be_the_late_one() -> None:
    clock = make_clock()
    device = Device()
    rx, dev = next((rx, dev) for _, rx, dev in device.messages(0.0, 1.0))
    clock.feed(rx + 300 * MS, dev)
    run(clock, device, 0.2, 30.0)
    assert clock.state is ClockState.GOOD
    assert len(clock.segments) == 1
    assert not any("gone by" in text for text in clock.drain_event_texts())


def test_the_same_messages_give_the_same_times() -> None:
    first, second = (run(make_clock(), Device(drift_ppm=3.0), 0.0, 90.0) for _ in range(2))
    assert first == second
