"""FTI time: monotonic plus a fixed epoch; a kernel stamp is accepted if it can have waited in its socket."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.clock import (
    EPOCH_STEP_NS,
    MAX_QUEUE_DELAY_NS,
    STEP_NS,
    Clock,
    ClockStep,
    FakeClock,
    SystemClock,
    choose_epoch_ns,
    describe_wrong_time,
)
from fti.constants import SECOND_NS
from fti.messages.frames import TICK_PERIOD_NS

STALL_NS = 130 * SECOND_NS


def carried_over(clock: Clock, stamp_ns: int, since_ns: int) -> int | None:
    """FTI time of a CLOCK_REALTIME stamp from a socket that was empty at since_ns; None when it is not accepted."""
    offset_ns, oldest_ns, newest_ns = clock.stamp_window(since_ns)
    return stamp_ns + offset_ns if oldest_ns <= stamp_ns <= newest_ns else None


class Hands:
    """Simulated clocks of the kernel."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, monotonic: int, realtime: int) -> None:
        self.monotonic, self.realtime = monotonic, realtime
        readings: dict[int, Callable[[], int]] = {
            time.CLOCK_MONOTONIC: lambda: self.monotonic,
            time.CLOCK_MONOTONIC_RAW: lambda: self.monotonic,
            time.CLOCK_REALTIME: lambda: self.realtime,
        }
        monkeypatch.setattr("fti.clock.time.monotonic_ns", lambda: self.monotonic)
        monkeypatch.setattr("fti.clock.time.clock_gettime_ns", lambda clock: readings[clock]())


@pytest.mark.parametrize("offset_ns", [0, 1, 9_999_999, 499_999_999, 510_000_001, 1_700_000_000_123_456_789, -7])
def test_fti_time_is_real_time_to_half_a_tick(monkeypatch: pytest.MonkeyPatch, offset_ns: int) -> None:
    hands = Hands(monkeypatch, monotonic=77 * SECOND_NS + 5, realtime=77 * SECOND_NS + 5 + offset_ns)
    clock = SystemClock(choose_epoch_ns())
    assert abs(clock.now_ns() - hands.realtime) <= 10_000_000


@pytest.mark.parametrize("offset_ns", [0, 499_999_999, 1_700_000_000_123_456_789, -7])
def test_ticks_are_at_multiples_of_their_period_on_both_clocks(monkeypatch: pytest.MonkeyPatch, offset_ns: int) -> None:
    Hands(monkeypatch, monotonic=77 * SECOND_NS + 5, realtime=77 * SECOND_NS + 5 + offset_ns)
    assert EPOCH_STEP_NS % TICK_PERIOD_NS == 0
    assert choose_epoch_ns() % TICK_PERIOD_NS == 0


@pytest.mark.parametrize("monotonic", [5, 77 * SECOND_NS + 5, 400 * 86400 * SECOND_NS + 999_999_999])
@pytest.mark.parametrize(
    ("realtime", "when"),
    [
        (-(2**63), "before 1970"),
        (-1, "before 1970"),
        (SECOND_NS - 1, "before 1970"),
        (SECOND_NS, None),
        (1_700_000_000 * SECOND_NS, None),
        (2**32 * SECOND_NS - 1, None),
        (2**32 * SECOND_NS, "after 2106"),
        (2**63, "after 2106"),
    ],
)
def test_fti_time_is_one_that_files_can_hold_whatever_the_clock_says(
    monkeypatch: pytest.MonkeyPatch, monotonic: int, realtime: int, when: str | None
) -> None:
    Hands(monkeypatch, monotonic=monotonic, realtime=realtime)
    epoch, reported = choose_epoch_ns(), describe_wrong_time()
    assert epoch % TICK_PERIOD_NS == 0
    year_2000 = int(datetime(2000, 1, 1, tzinfo=UTC).timestamp()) * SECOND_NS
    if when is None:
        assert abs(monotonic + epoch - realtime) <= TICK_PERIOD_NS // 2
        assert reported is None
    else:
        assert year_2000 <= monotonic + epoch <= year_2000 + TICK_PERIOD_NS
        assert reported is not None
        assert reported.startswith(f"the real-time clock is {when}; ")


def test_a_step_of_real_time_does_not_move_fti_time(monkeypatch: pytest.MonkeyPatch) -> None:
    hands = Hands(monkeypatch, monotonic=1000, realtime=5 * SECOND_NS)
    clock = SystemClock(epoch_ns=10 * SECOND_NS)
    hands.realtime += 3600 * SECOND_NS
    hands.monotonic += 7
    assert clock.now_ns() == 10 * SECOND_NS + 1007


@pytest.mark.parametrize("waited_ns", [0, 20_000_000, STALL_NS])
@pytest.mark.parametrize(
    ("after_ns", "accepted"),
    [(0, True), (1, True), (-MAX_QUEUE_DELAY_NS, True), (-MAX_QUEUE_DELAY_NS - 1, False), (-3600 * SECOND_NS, False)],
)
def test_a_stamp_may_be_as_old_as_the_last_look_at_its_socket(
    monkeypatch: pytest.MonkeyPatch, waited_ns: int, after_ns: int, accepted: bool
) -> None:
    """The socket was empty at 60 s; it is read after a pause of any length."""
    hands = Hands(monkeypatch, monotonic=60 * SECOND_NS, realtime=1_700_000_000 * SECOND_NS)
    clock = SystemClock(epoch_ns=3 * SECOND_NS)
    stamp, since_ns = hands.realtime + after_ns, clock.now_ns()
    hands.monotonic += waited_ns + 1
    hands.realtime += waited_ns + 1
    assert carried_over(clock, stamp, since_ns) == (63 * SECOND_NS + after_ns if accepted else None)
    assert carried_over(clock, hands.realtime + 1, since_ns) is None
    assert not clock.take_steps()


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
    assert carried_over(clock, stamp, 59 * SECOND_NS) == 60 * SECOND_NS - 1000
    assert not interruptions
    assert not clock.take_steps()


def test_system_clock_runs_with_the_monotonic_clock() -> None:
    clock = SystemClock(epoch_ns=choose_epoch_ns())
    before = time.monotonic_ns() + clock.epoch_ns
    assert before <= clock.now_ns() <= time.monotonic_ns() + clock.epoch_ns
    now = carried_over(clock, time.clock_gettime_ns(time.CLOCK_REALTIME), before)
    assert now is not None
    assert before <= now


def test_fake_clock_moves_only_on_request() -> None:
    clock = FakeClock(time_ns=5)
    assert clock.now_ns() == clock.now_ns() == 5
    clock.advance(1.5)
    assert clock.now_ns() == 5 + 1_500_000_000
    assert carried_over(clock, 6, since_ns=5) == 6
    assert carried_over(clock, clock.now_ns() + 1, since_ns=5) is None
    clock.advance(11)
    assert carried_over(clock, 6, since_ns=6 + MAX_QUEUE_DELAY_NS) == 6
    assert carried_over(clock, 6, since_ns=7 + MAX_QUEUE_DELAY_NS) is None


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

DETECTED_NS = 60 * SECOND_NS


def _stepped(monkeypatch: pytest.MonkeyPatch, step_ns: int) -> tuple[SystemClock, Hands, int]:
    """A clock, a stamp of 59.9 s, and a step that happens before anybody reads it at 60 s."""
    hands = Hands(monkeypatch, monotonic=59 * SECOND_NS, realtime=1_700_000_059 * SECOND_NS)
    clock = SystemClock(epoch_ns=0)
    stamp = hands.realtime + 900_000_000
    hands.monotonic = DETECTED_NS
    hands.realtime += SECOND_NS + step_ns
    return clock, hands, stamp


@pytest.mark.parametrize("step_s", [5.0, -5.0, 0.95, -0.05, 9.8, 3600.0, -3600.0])
def test_a_stamp_from_before_a_step_is_not_accepted_after_it(monkeypatch: pytest.MonkeyPatch, step_s: float) -> None:
    """Converted, it would be wrong by the step: +5 s is an age that looks as good as any."""
    clock, _, stamp = _stepped(monkeypatch, round(step_s * SECOND_NS))
    assert carried_over(clock, stamp, 59 * SECOND_NS) is None
    assert carried_over(clock, stamp, 59 * SECOND_NS) is None  # the next socket is read later, with the step known
    assert clock.take_steps() == [ClockStep(DETECTED_NS, round(step_s * SECOND_NS))]
    assert clock.take_steps() == []


@pytest.mark.parametrize("step_s", [5.0, -5.0, 0.3, -0.3, -3600.0, 3600.0])
@given(
    taken_ns=st.integers(59 * SECOND_NS, 72 * SECOND_NS),
    waited_ns=st.one_of(st.integers(0, 25 * SECOND_NS), st.integers(0, STALL_NS)),
    empty_ns=st.one_of(st.integers(0, SECOND_NS), st.integers(0, STALL_NS)),
    looks=st.lists(st.integers(0, 40 * SECOND_NS), max_size=5),
)
def test_around_a_step_a_stamp_is_right_or_refused(
    step_s: float, taken_ns: int, waited_ns: int, empty_ns: int, looks: list[int]
) -> None:
    """The clock is set at 60 s; stamps are taken before and after and wait; others are read in between.

    empty_ns : so long before the stamp its socket was empty
    """
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
                clock.stamp_window(look + epoch_ns)
        hands.monotonic, hands.realtime = read_at, realtime(read_at)
        number = carried_over(clock, realtime(taken_ns), taken_ns - empty_ns + epoch_ns)
        assert number in (taken_ns + epoch_ns, None)


@pytest.mark.parametrize(("step_s", "until_s"), [(5.0, 0.0), (0.5, 0.0), (-3600.0, 0.0), (-0.5, 0.5)])
def test_stamps_are_accepted_again_after_a_step(monkeypatch: pytest.MonkeyPatch, step_s: float, until_s: float) -> None:
    """At once, where none from before can be mistaken for one of now; set back a little: when real time is there."""
    clock, hands, _ = _stepped(monkeypatch, round(step_s * SECOND_NS))
    clock.stamp_window(DETECTED_NS)
    for later_ns in (1_000_000, round(until_s * SECOND_NS) + 1_000_000):
        hands.monotonic += later_ns
        hands.realtime += later_ns
        accepted = hands.monotonic > DETECTED_NS + until_s * SECOND_NS
        stamp = carried_over(clock, hands.realtime - 100_000, hands.monotonic - 20_000_000)
        assert stamp == (hands.monotonic - 100_000 if accepted else None)


def test_a_step_does_not_affect_a_socket_that_was_empty_behind_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Set back by 5 s; one socket has been empty since, in the other one something may wait from before."""
    clock, hands, _ = _stepped(monkeypatch, -5 * SECOND_NS)
    clock.stamp_window(DETECTED_NS)
    hands.monotonic += 2 * SECOND_NS
    hands.realtime += 2 * SECOND_NS
    assert carried_over(clock, hands.realtime - 1000, hands.monotonic - 1_000_000) == hands.monotonic - 1000
    assert carried_over(clock, hands.realtime - 1000, DETECTED_NS - 9 * SECOND_NS) is None


def test_two_steps_in_one_pause_that_cancel_each_other_leave_no_wrong_stamp(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody can see them afterwards: the stamps in between do not fit between the two looks."""
    hands = Hands(monkeypatch, monotonic=60 * SECOND_NS, realtime=1_700_000_000 * SECOND_NS)
    clock = SystemClock(epoch_ns=0)
    between = [hands.realtime + STALL_NS // 2 + step_s * SECOND_NS for step_s in (-3600, 3600)]
    hands.monotonic += STALL_NS
    hands.realtime += STALL_NS
    assert [carried_over(clock, stamp, 60 * SECOND_NS) for stamp in between] == [None, None]


def test_a_batch_is_carried_over_by_one_window(monkeypatch: pytest.MonkeyPatch) -> None:
    hands = Hands(monkeypatch, monotonic=60 * SECOND_NS, realtime=1_700_000_000 * SECOND_NS)
    clock = SystemClock(epoch_ns=3 * SECOND_NS)
    window = clock.stamp_window(62 * SECOND_NS)
    assert window.oldest_ns == hands.realtime - SECOND_NS - MAX_QUEUE_DELAY_NS
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
    assert [step.size_ns for step in clock.take_steps()] == [2 * STEP_NS]
