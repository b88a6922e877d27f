"""Lost messages and silent nodes: rules, and bounded memory with noise."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.drivers._node_supervision import MAX_STREAMS, MIN_INTERVALS, NodeSupervisor

MS = 1_000_000


def watch(silent_after: float = 5.0) -> NodeSupervisor:
    return NodeSupervisor(silent_after, Counter())


@given(st.integers(0, 255), st.lists(st.integers(0, 40), min_size=1, max_size=30))
def test_every_gap_is_counted_whatever_the_counter_was_at(start: int, gaps: list[int]) -> None:
    looked, code = watch(), start
    looked.handle_message(1, 1, "m", code=code)
    for gap in gaps:
        code = (code + 1 + gap) % 256
        looked.handle_message(1, 1, "m", code=code)
    assert looked.lost == Counter({"m": sum(gaps)}) - Counter()


def test_a_node_that_does_not_count_is_reported_once() -> None:
    looked = watch()
    reported = [looked.handle_message(t, 1, "m", code=0) for t in range(1, 9)]
    assert reported == [(), ("m_repeated",), *[()] * 6]
    assert looked.repeated == {"m": 7}
    assert (looked.handle_message(9, 1, "m", code=1), looked.handle_message(10, 1, "m", code=1)) == (
        (),
        ("m_repeated",),
    )


@given(st.integers(2, 20), st.integers(5, 500))
def test_a_node_is_silent_after_so_many_periods_and_not_before(periods: int, period_ms: int) -> None:
    looked = watch(periods)
    last = MIN_INTERVALS * period_ms * MS + 1
    for k in range(MIN_INTERVALS + 1):
        assert looked.handle_message(1 + k * period_ms * MS, "n", "m") == ()
    due = last + periods * period_ms * MS
    assert looked.tick(due) == ()
    assert looked.tick(due + 1) == ("node_n_silent",)
    assert looked.tick(due + 10 * MS) == ()
    assert looked.handle_message(due + 20 * MS, "n", "m") == ("node_n_back",)


def test_the_fastest_message_of_a_node_is_its_period() -> None:
    looked = watch()
    for t in range(0, 3001, 20):
        looked.handle_message(1 + t * MS, "n", "fast")
        if t % 500 == 0:
            looked.handle_message(1 + t * MS, "n", "slow")
    assert looked.tick(1 + 3150 * MS) == ("node_n_silent",)


def test_a_slower_rate_is_learned() -> None:
    looked = watch()
    reported = [flag for t in range(0, 1000, 20) for flag in looked.handle_message(1 + t * MS, "n", "m")]
    reported += [flag for t in range(1000, 20_000, 60) for flag in looked.handle_message(1 + t * MS, "n", "m")]
    assert reported == []
    assert looked.tick(1 + (19_960 + 290) * MS) == ()


def test_a_node_that_now_sends_ten_times_slower_is_silent_once() -> None:
    looked = watch()
    reported = [flag for t in range(0, 2000, 100) for flag in looked.handle_message(1 + t * MS, "n", "m")]
    for t in range(2900, 30_000, 100):  # others speak all the time
        reported += looked.tick(1 + t * MS)
        if t % 1000 == 900:
            reported += looked.handle_message(1 + t * MS, "n", "m")
    assert reported == ["node_n_silent", "node_n_back"]
    assert looked.tick(1 + (29_900 + 5001) * MS) == ("node_n_silent",)


@pytest.mark.parametrize("cycle_ns", [None, 100 * MS])
def test_silence_is_reported_every_time(cycle_ns: int | None) -> None:
    """An hour of silence is no interval either: it would make the period nine minutes."""
    looked, reported = watch(), list[str]()
    for begin in (0, 3_600_000, 7_200_000):
        for t in range(begin, begin + 1000, 100):
            reported += looked.handle_message(1 + t * MS, "n", "m", cycle_ns=cycle_ns)
            reported += looked.handle_message(1 + t * MS, "n", "another", cycle_ns=cycle_ns)
        reported += looked.tick(1 + (begin + 900 + 501) * MS)
    assert reported == ["node_n_silent", "node_n_back", "node_n_silent", "node_n_back", "node_n_silent"]


def test_stamps_that_stand_still_or_go_back_tell_nothing() -> None:
    looked = watch()
    for t in (5, 5, 5, 4, 3, 5, 5, 2, 1, 5):
        assert looked.handle_message(t, "n", "m") == ()


def test_noise_is_forgotten_and_what_is_really_there_is_not() -> None:
    looked = watch()
    for n in range(20 * MAX_STREAMS):
        looked.handle_message(1 + n * MS, n % 251, f"noise_{n}", code=0)
        if n % 10 == 0:
            assert looked.handle_message(1 + n * MS, "n", "m", code=n // 10 % 256) == ()
    assert len(looked._streams) <= MAX_STREAMS
    assert len(looked._nodes) <= MAX_STREAMS
    assert looked.handle_message(1 + 20 * MAX_STREAMS * MS, "n", "m", code=(2 * MAX_STREAMS + 3) % 256) == ("m_lost_3",)
