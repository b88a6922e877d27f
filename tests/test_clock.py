"""FTI time: monotonic plus a fixed epoch; kernel stamps are believed only when their age is plausible."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from fti.clock import MAX_STAMP_AGE_NS, SECOND_NS, FakeClock, SystemClock, choose_epoch_ns, sample_clocks


class Hands:
    """The kernel's clocks, moved by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, monotonic: int, realtime: int) -> None:
        self.monotonic, self.realtime = monotonic, realtime
        readings: dict[int, Callable[[], int]] = {
            time.CLOCK_MONOTONIC: lambda: self.monotonic,
            time.CLOCK_REALTIME: lambda: self.realtime,
        }
        monkeypatch.setattr("fti.clock.time.monotonic_ns", lambda: self.monotonic)
        monkeypatch.setattr("fti.clock.time.clock_gettime_ns", lambda clock: readings[clock]())


@pytest.mark.parametrize("offset_ns", [0, 1, 499_999_999, 500_000_001, 1_700_000_000_123_456_789])
def test_epoch_is_whole_seconds_within_half_a_second(monkeypatch: pytest.MonkeyPatch, offset_ns: int) -> None:
    Hands(monkeypatch, monotonic=77 * SECOND_NS + 5, realtime=77 * SECOND_NS + 5 + offset_ns)
    epoch = choose_epoch_ns()
    assert epoch % SECOND_NS == 0
    assert abs(epoch - offset_ns) <= SECOND_NS // 2


def test_a_step_of_real_time_does_not_move_fti_time(monkeypatch: pytest.MonkeyPatch) -> None:
    hands = Hands(monkeypatch, monotonic=1000, realtime=5 * SECOND_NS)
    clock = SystemClock(epoch_ns=10 * SECOND_NS)
    hands.realtime += 3600 * SECOND_NS
    hands.monotonic += 7
    assert clock.now_ns() == 10 * SECOND_NS + 1007


@pytest.mark.parametrize(
    ("age_ns", "believed"),
    [(0, True), (1, True), (MAX_STAMP_AGE_NS, True), (MAX_STAMP_AGE_NS + 1, False), (-1, False), (-SECOND_NS, False)],
)
def test_kernel_stamp_is_carried_over_by_its_age(monkeypatch: pytest.MonkeyPatch, age_ns: int, believed: bool) -> None:
    hands = Hands(monkeypatch, monotonic=60 * SECOND_NS, realtime=1_700_000_000 * SECOND_NS)
    clock = SystemClock(epoch_ns=3 * SECOND_NS)
    stamp = clock.from_realtime_ns(hands.realtime - age_ns)
    assert stamp == (63 * SECOND_NS - age_ns if believed else None)


def test_an_interruption_between_two_readings_is_not_taken_for_age(monkeypatch: pytest.MonkeyPatch) -> None:
    """50 ms pass between the two clocks at the first try; the stamp is as if they had been read together."""
    hands = Hands(monkeypatch, monotonic=60 * SECOND_NS, realtime=1_700_000_000 * SECOND_NS)
    interruptions = [50_000_000]

    def read_realtime(clock_id: int) -> int:
        late = interruptions.pop() if interruptions else 0
        hands.realtime += late
        hands.monotonic += late
        return hands.realtime - late

    stamp = hands.realtime - 1000
    monkeypatch.setattr(time, "clock_gettime_ns", read_realtime)
    assert SystemClock(epoch_ns=0).from_realtime_ns(stamp) == 60 * SECOND_NS - 1000


def test_system_clock_runs_with_the_monotonic_clock() -> None:
    clock = SystemClock(epoch_ns=choose_epoch_ns())
    before = time.monotonic_ns() + clock.epoch_ns
    assert before <= clock.now_ns() <= time.monotonic_ns() + clock.epoch_ns
    now = clock.from_realtime_ns(time.clock_gettime_ns(time.CLOCK_REALTIME))
    assert now is not None
    assert before <= now


def test_fake_clock_moves_only_when_told() -> None:
    clock = FakeClock(time_ns=5)
    assert clock.now_ns() == clock.now_ns() == 5
    clock.advance(1.5)
    assert clock.now_ns() == 5 + 1_500_000_000
    assert clock.from_realtime_ns(6) == 6
    assert clock.from_realtime_ns(clock.now_ns() + 1) is None
    clock.advance(11)
    assert clock.from_realtime_ns(6) is None


def test_clock_sample_names_three_clocks() -> None:
    before = time.monotonic_ns()
    sample = sample_clocks()
    assert set(sample) == {"monotonic_ns", "monotonic_raw_ns", "realtime_ns"}
    assert before <= sample["monotonic_ns"] <= time.monotonic_ns()
