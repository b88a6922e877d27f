"""Faults of bytes, message by message: what leaves instead, and when."""

from __future__ import annotations

import numpy as np
import pytest

from fti.canframe import CAN_SIZE, CANFD_SIZE, pack_can, unpack_can
from fti.hil.faults.messages import (
    BurstStage,
    FreezeStage,
    MessageStage,
    ReorderStage,
    bit_error_effect,
    truncation_effect,
)
from fti.hil.tables.fault_types import BitErrors, Burst, Cut, Duplicated, Freeze, LostHeader, Reordered, Truncated
from tests.hil.faults.device_flights import Flight, fly, nominal

END_S = 100.0


def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def played(stage: MessageStage, cycles: dict[float, list[bytes]]) -> dict[float, list[bytes]]:
    """What leaves a stage, at its own instants too."""
    waiting, found = sorted(cycles), {}
    while waiting or stage.due_s() is not None:
        due = stage.due_s()
        t = min([*waiting[:1], *([] if due is None else [due])])
        messages = cycles[waiting.pop(0)] if waiting and waiting[0] == t else []
        if left := stage.apply(t, messages):
            found[t] = left
    return found


def messages(flight: Flight) -> list[bytes]:
    return [message for _, messages in flight for message in messages]


# ------------------------------------------------------------------------------------------------------------ order


def test_a_message_leaves_behind_the_next_one() -> None:
    fault = Reordered(kind="reordered", from_s=1.0, to_s=4.0)
    left = played(ReorderStage(fault, rng(), END_S), {float(t): [b"%d" % t] for t in range(6)})
    assert left == {0.0: [b"0"], 2.0: [b"2", b"1"], 4.0: [b"4", b"3"], 5.0: [b"5"]}


def test_within_a_cycle_neighbours_change_places() -> None:
    fault = Reordered(kind="reordered", from_s=0.0, to_s=4.0)
    assert ReorderStage(fault, rng(), END_S).apply(1.0, [b"a", b"b", b"c", b"d"]) == [b"b", b"a", b"d", b"c"]


def test_who_waits_for_nobody_leaves_at_the_end_of_the_interval() -> None:
    fault = Reordered(kind="reordered", from_s=0.0, to_s=4.0)
    assert played(ReorderStage(fault, rng(), END_S), {1.0: [b"a"], 7.0: [b"b"]}) == {4.0: [b"a"], 7.0: [b"b"]}


def test_or_with_the_last_message_of_the_flight() -> None:
    fault = Reordered(kind="reordered", from_s=0.0, to_s=40.0)
    stage = ReorderStage(fault, rng(), 3.0)
    assert played(stage, {1.0: [b"a"], 2.0: [b"b"], 2.5: [b"c"]}) == {2.0: [b"b", b"a"], 3.0: [b"c"]}
    assert stage.apply(3.0, [b"d"]) == [b"d"]


def test_a_share_is_drawn() -> None:
    fault = Reordered(kind="reordered", from_s=0.0, to_s=4000.0, share=0.25)
    cycles = {float(t): [b"%d" % t] for t in range(3000)}
    swapped = [m for m in played(ReorderStage(fault, rng(), 5000.0), cycles).values() if len(m) == 2]
    assert len(swapped) == pytest.approx(3000 * 0.25 / 1.25, rel=0.1)  # who overtakes does not wait itself


# ------------------------------------------------------------------------------------------------------------ burst


def test_messages_are_held_and_leave_at_once() -> None:
    fault = Burst(kind="burst", from_s=1.0, to_s=3.2, hold_s=1.0)
    cycles = {t / 4: [b"%d" % t] for t in range(18)}
    left = played(BurstStage(fault, END_S), cycles)
    assert left[2.0] == [b"4", b"5", b"6", b"7"]
    assert left[3.0] == [b"8", b"9", b"10", b"11"]
    assert left[3.2] == [b"12"]
    assert left[3.25] == [b"13"]
    assert sum(map(len, left.values())) == len(cycles)


@pytest.mark.parametrize("kind", [Burst(kind="burst", from_s=1.0, to_s=60.0, hold_s=17.0),
                                  Reordered(kind="reordered", from_s=1.0, to_s=60.0)])  # fmt: skip
@pytest.mark.parametrize("until_s", [4.3, float("inf")])
def test_at_the_end_of_the_flight_nothing_is_held_back(kind: Burst | Reordered, until_s: float) -> None:
    """The interval ends a minute behind the flight; what is held leaves with the last message of the device."""
    flight = fly("mavlink", kind, until_s=until_s)
    nominal_messages = [(t, m) for t, m in nominal("mavlink") if t <= until_s]
    arrived = [(t, m) for t, m in flight if t <= until_s]
    assert sorted(messages(arrived)) == sorted(messages(nominal_messages))
    assert arrived[-1][0] <= min(until_s, nominal("mavlink")[-1][0])


# ------------------------------------------------------------------------------------------------------------ bytes


def test_a_frozen_device_repeats_the_cycle_before_the_interval() -> None:
    fault = Freeze(kind="freeze", from_s=2.0, to_s=4.0)
    cycles = {float(t): [b"a%d" % t, b"b%d" % t] for t in range(6)}
    left = played(FreezeStage(fault), cycles)
    assert left[2.0] == left[3.0] == [b"a1", b"b1"]
    assert left[4.0] == [b"a4", b"b4"]


def test_a_device_that_is_frozen_from_the_beginning_repeats_its_first_cycle() -> None:
    fault = Freeze(kind="freeze", from_s=0.0, to_s=4.0)
    assert set(map(tuple, played(FreezeStage(fault), {float(t): [b"%d" % t] for t in range(4)}).values())) == {(b"0",)}


def test_bits_are_wrong_with_the_configured_probability() -> None:
    become = bit_error_effect(BitErrors(kind="bit_errors", from_s=0.0, to_s=1.0, rate=0.01), rng(), on_can=False)
    (wrong,) = become(bytes(100_000))
    assert np.unpackbits(np.frombuffer(wrong, np.uint8)).mean() == pytest.approx(0.01, rel=0.05)


def test_on_can_only_the_data_is_wrong() -> None:
    become = bit_error_effect(BitErrors(kind="bit_errors", from_s=0.0, to_s=1.0, rate=0.5), rng(), on_can=True)
    frame = pack_can(0x123, b"\xaa\xbb\xcc")
    (wrong,) = become(frame)
    assert unpack_can(wrong)._replace(data=b"") == unpack_can(frame)._replace(data=b"")
    assert unpack_can(wrong).data != unpack_can(frame).data
    assert wrong[11:] == frame[11:]


@pytest.mark.parametrize(("size", "left"), [(8, 5), (2, 0)])
def test_a_can_frame_loses_the_end_of_its_data(size: int, left: int) -> None:
    (short,) = truncation_effect(3, on_can=True)(pack_can(0x123, bytes(range(1, size + 1)), extended=True))
    assert len(short) == CAN_SIZE
    assert unpack_can(short) == unpack_can(pack_can(0x123, bytes(range(1, left + 1)), extended=True))


def test_an_fd_frame_gets_a_length_that_there_is() -> None:
    (short,) = truncation_effect(3, on_can=True)(pack_can(0x123, bytes(range(64)), fd=True))
    assert len(short) == CANFD_SIZE
    assert unpack_can(short).data == bytes(range(48))


def test_header_and_end_are_missing_by_as_many_bytes() -> None:
    cut = messages(fly("nmea0183", LostHeader(kind="lost_header", from_s=0.0, to_s=99.0, count=3)))
    short = messages(fly("nmea0183", Truncated(kind="truncated", from_s=0.0, to_s=99.0, count=3)))
    whole = messages(nominal("nmea0183"))
    assert cut == [m[3:] for m in whole]
    assert short == [m[:-3] for m in whole]


def test_a_message_of_which_nothing_is_left_is_not_sent() -> None:
    assert not fly("lightware_ascii", Truncated(kind="truncated", from_s=0.0, to_s=99.0, count=50))


def test_twice_is_twice_at_once() -> None:
    twice = fly("ublox_ubx", Duplicated(kind="duplicated", from_s=0.0, to_s=99.0))
    assert twice == [(t, [m for m in cycle for _ in "ab"]) for t, cycle in nominal("ublox_ubx")]


def test_a_cut_cable_does_not_stop_the_device_from_counting() -> None:
    later = [m for t, m in fly("mavlink", Cut(kind="cut", from_s=1.0, to_s=3.0)) if t > 3.0]
    assert later == [m for t, m in nominal("mavlink") if t > 3.0]


def test_faults_follow_each_other_in_the_order_of_the_scenario() -> None:
    short = Truncated(kind="truncated", from_s=0.0, to_s=99.0, count=1)
    burst = Burst(kind="burst", from_s=1.0, to_s=2.0, hold_s=0.5)
    for faults in ((short, burst), (burst, short)):
        flight = fly("lightware_ascii", *faults)
        assert messages(flight) == [m[:-1] for m in messages(nominal("lightware_ascii"))]
        assert [t for t, _ in flight if 1.0 < t <= 2.0] == [1.5, 2.0]


# ------------------------------------------------------------------------------------------------------------- seed


def test_the_seed_decides_and_repeats() -> None:
    noise = BitErrors(kind="bit_errors", from_s=0.0, to_s=99.0, rate=0.01)
    assert fly("nmea0183", noise, seed=3) == fly("nmea0183", noise, seed=3)
    assert fly("nmea0183", noise, seed=3) != fly("nmea0183", noise, seed=4)


def test_another_fault_before_it_in_time_changes_nothing_in_what_is_drawn() -> None:
    first = BitErrors(kind="bit_errors", from_s=1.0, to_s=2.0, rate=0.02)
    second = BitErrors(kind="bit_errors", from_s=3.0, to_s=4.0, rate=0.02)
    cut = Cut(kind="cut", from_s=1.0, to_s=2.0)
    after = [(t, m) for t, m in fly("nmea0183", first, second) if t >= 3.0]
    assert after == [(t, m) for t, m in fly("nmea0183", cut, second) if t >= 3.0]
