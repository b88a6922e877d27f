"""Patience: nothing is skipped for being late until the ring has overrun navigation, and not after it follows again."""

from __future__ import annotations

from fti.service.navigation.backlog import (
    EVENT_PERIOD_NS,
    MAX_WAIT_NS,
    MIN_IDLE_COUNT,
    MIN_IDLE_NS,
    SECOND_NS,
    BacklogPolicy,
    SkipReporter,
)


def test_it_is_endless_before_anything_was_lost() -> None:
    patience = BacklogPolicy()
    assert not patience.must_skip(3600 * SECOND_NS)


def test_it_ends_when_what_waits_is_late_after_an_overrun() -> None:
    patience = BacklogPolicy()
    patience.on_overrun()
    assert not patience.must_skip(MAX_WAIT_NS)
    assert patience.must_skip(MAX_WAIT_NS + 1)


def test_it_comes_back_with_enough_pauses_since_the_last_loss() -> None:
    patience = BacklogPolicy()
    patience.on_overrun()
    for k in range(MIN_IDLE_COUNT - 1):
        patience.rest(k * MIN_IDLE_NS)
    patience.on_overrun()
    for k in range(2 * MIN_IDLE_COUNT):
        patience.rest(k * MIN_IDLE_NS // (2 * MIN_IDLE_COUNT))
    assert patience.must_skip(SECOND_NS), "often, but not for long"
    patience.rest(MIN_IDLE_NS)
    assert not patience.must_skip(SECOND_NS)


def test_the_first_skip_is_told_at_once_and_what_follows_together() -> None:
    skips, t_ns = SkipReporter(), 10**18
    assert skips.take_event(t_ns) is None
    skips.note(7, SECOND_NS)
    first = skips.take_event(t_ns)
    assert first
    assert (first.t_ns, first.level, first.source) == (t_ns, "warning", "navigation")
    assert "7 frames (1.0 s) were skipped to" in first.text
    for _ in range(3):
        skips.note(100, 2 * SECOND_NS)
    assert skips.take_event(t_ns + EVENT_PERIOD_NS - 1) is None
    later = skips.take_event(t_ns + EVENT_PERIOD_NS)
    assert later
    assert "300 frames (6.0 s) were skipped in 3 steps to" in later.text
    assert skips.take_event(t_ns + 10 * EVENT_PERIOD_NS) is None


def test_what_was_not_told_is_told_in_the_end() -> None:
    skips = SkipReporter()
    for _ in range(2):
        skips.note(5, SECOND_NS)
        skips.take_event(0)
    rest = skips.rest(1)
    assert rest
    assert "5 frames" in rest.text
    assert skips.rest(2) is None
