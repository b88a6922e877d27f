"""FTI time: monotonic plus a fixed epoch; kernel stamps are believed only when their age is plausible."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.clock import MAX_STAMP_AGE_NS, SECOND_NS, STEP_NS, FakeClock, Step, SystemClock, choose_epoch_ns


class Hands:
    """The kernel's clocks, moved by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, monotonic: int, realtime: int) -> None:
        self.monotonic, self.realtime = monotonic, realtime
        readings: dict[int, Callable[[], int]] = {
            time.CLOCK_MONOTONIC: lambda: self.monotonic,
            time.CLOCK_MONOTONIC_RAW: lambda: self.monotonic,
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

    clock = SystemClock(epoch_ns=0)
    stamp = hands.realtime - 1000
    monkeypatch.setattr(time, "clock_gettime_ns", read_realtime)
    assert clock.from_realtime_ns(stamp) == 60 * SECOND_NS - 1000
    assert not interruptions
    assert not clock.take_steps()


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


def test_clock_sample_names_three_clocks_and_how_close_they_were_read() -> None:
    clock = SystemClock(epoch_ns=choose_epoch_ns())
    before = time.monotonic_ns()
    sample = clock.sample()
    after = time.monotonic_ns()
    assert set(sample) == {"t_ns", "monotonic_ns", "monotonic_raw_ns", "realtime_ns", "width_ns"}
    assert before <= sample["monotonic_ns"] <= after
    assert sample["t_ns"] == sample["monotonic_ns"] + clock.epoch_ns
    assert 0 < sample["width_ns"] <= after - before
    assert sample["realtime_ns"] == pytest.approx(time.time_ns(), abs=SECOND_NS)


# ------------------------------------------------------------------------------------- steps of the real-time clock

SEEN_NS = 60 * SECOND_NS


def _stepped(monkeypatch: pytest.MonkeyPatch, step_ns: int) -> tuple[SystemClock, Hands, int]:
    """A clock, a stamp of 59.9 s, and a step that happens before anybody reads it at 60 s."""
    hands = Hands(monkeypatch, monotonic=59 * SECOND_NS, realtime=1_700_000_059 * SECOND_NS)
    clock = SystemClock(epoch_ns=0)
    stamp = hands.realtime + 900_000_000
    hands.monotonic = SEEN_NS
    hands.realtime += SECOND_NS + step_ns
    return clock, hands, stamp


@pytest.mark.parametrize("step_s", [5.0, -5.0, 0.95, -0.05, 9.8, 3600.0, -3600.0])
def test_a_stamp_from_before_a_step_is_not_believed_after_it(monkeypatch: pytest.MonkeyPatch, step_s: float) -> None:
    """Converted, it would be wrong by the step: +5 s is an age that looks as good as any."""
    clock, _, stamp = _stepped(monkeypatch, round(step_s * SECOND_NS))
    assert clock.from_realtime_ns(stamp) is None
    assert clock.from_realtime_ns(stamp) is None  # the next socket is read a moment later, with the step known
    assert clock.take_steps() == [Step(SEEN_NS, round(step_s * SECOND_NS))]
    assert clock.take_steps() == []


@pytest.mark.parametrize("step_s", [5.0, -5.0, 0.3, -0.3, -3600.0, 3600.0])
@given(
    taken_ns=st.integers(59 * SECOND_NS, 72 * SECOND_NS),
    waited_ns=st.integers(0, MAX_STAMP_AGE_NS),
    looks=st.lists(st.integers(0, 25 * SECOND_NS), max_size=5),
)
def test_around_a_step_a_stamp_is_right_or_refused(
    step_s: float, taken_ns: int, waited_ns: int, looks: list[int]
) -> None:
    """The clock is set at 60 s; stamps are taken before and after and wait; others are read in between."""
    step_ns, epoch_ns, set_at = round(step_s * SECOND_NS), 7 * SECOND_NS, 60 * SECOND_NS

    def realtime(monotonic: int) -> int:
        return 1_700_000_000 * SECOND_NS + monotonic + (step_ns if monotonic >= set_at else 0)

    with pytest.MonkeyPatch.context() as patch:
        hands = Hands(patch, monotonic=59 * SECOND_NS, realtime=realtime(59 * SECOND_NS))
        clock = SystemClock(epoch_ns)
        read_at = taken_ns + waited_ns
        for look in sorted(59 * SECOND_NS + look for look in looks):
            if look <= read_at:
                hands.monotonic, hands.realtime = look, realtime(look)
                clock.stamp_window()
        hands.monotonic, hands.realtime = read_at, realtime(read_at)
        assert clock.from_realtime_ns(realtime(taken_ns)) in (taken_ns + epoch_ns, None)


def test_stamps_are_believed_again_after_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forward: at once.  Back by 5 s: when no stamp from before can be meant any more."""
    for step_ns, until_ns in ((5 * SECOND_NS, 0), (-5 * SECOND_NS, 5 * SECOND_NS)):
        clock, hands, _ = _stepped(monkeypatch, step_ns)
        assert clock.take_steps() == []
        clock.stamp_window()
        hands.monotonic += until_ns + 2_000_000
        hands.realtime += until_ns + 2_000_000
        assert clock.from_realtime_ns(hands.realtime - 1_000_000) == hands.monotonic - 1_000_000
        assert clock.from_realtime_ns(hands.realtime - MAX_STAMP_AGE_NS + 1) is None
        hands.monotonic += 2 * MAX_STAMP_AGE_NS
        hands.realtime += 2 * MAX_STAMP_AGE_NS
        assert clock.from_realtime_ns(hands.realtime - MAX_STAMP_AGE_NS) is not None


def test_a_batch_is_carried_over_by_one_window(monkeypatch: pytest.MonkeyPatch) -> None:
    hands = Hands(monkeypatch, monotonic=60 * SECOND_NS, realtime=1_700_000_000 * SECOND_NS)
    clock = SystemClock(epoch_ns=3 * SECOND_NS)
    window = clock.stamp_window()
    assert window.oldest_ns == hands.realtime - MAX_STAMP_AGE_NS
    assert window.newest_ns == hands.realtime
    assert hands.realtime - 5 + window.offset_ns == 63 * SECOND_NS - 5


def test_what_two_readings_cannot_tell_apart_is_no_step(monkeypatch: pytest.MonkeyPatch) -> None:
    hands = Hands(monkeypatch, monotonic=60 * SECOND_NS, realtime=1_700_000_000 * SECOND_NS)
    clock = SystemClock(epoch_ns=0)
    hands.realtime += STEP_NS
    clock.sample()
    assert not clock.take_steps()
    hands.realtime += STEP_NS
    clock.sample()
    assert [step.by_ns for step in clock.take_steps()] == [2 * STEP_NS]
