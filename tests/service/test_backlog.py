"""Patience: nothing is skipped for being late until the ring has overrun navigation, and not after it follows again."""

from __future__ import annotations

from fti.constants import SECOND_NS
from fti.service.navigation.backlog import (
    EVENT_PERIOD_NS,
    MAX_WAIT_NS,
    MIN_IDLE_COUNT,
    MIN_IDLE_NS,
    BacklogPolicy,
    SkipReporter,
)


def test_it_is_endless_before_anything_was_lost() -> None:
    backlog = BacklogPolicy()
    assert not backlog.must_skip(3600 * SECOND_NS)


def test_it_ends_when_what_waits_is_late_after_an_overrun() -> None:
    backlog = BacklogPolicy()
    backlog.on_overrun()
    assert not backlog.must_skip(MAX_WAIT_NS)
    assert backlog.must_skip(MAX_WAIT_NS + 1)


def test_it_comes_back_with_enough_pauses_since_the_last_loss() -> None:
    backlog = BacklogPolicy()
    backlog.on_overrun()
    for k in range(MIN_IDLE_COUNT - 1):
        backlog.on_idle(k * MIN_IDLE_NS)
    backlog.on_overrun()
    for k in range(2 * MIN_IDLE_COUNT):
        backlog.on_idle(k * MIN_IDLE_NS // (2 * MIN_IDLE_COUNT))
    assert backlog.must_skip(SECOND_NS), "often, but not for long"
    backlog.on_idle(MIN_IDLE_NS)
    assert not backlog.must_skip(SECOND_NS)


def test_the_first_skip_is_reported_at_once_and_what_follows_together() -> None:
    skips, t_ns = SkipReporter(), 10**18
    assert skips.take_event(t_ns) is None
    skips.add(7, SECOND_NS)
    first = skips.take_event(t_ns)
    assert first
    assert (first.t_ns, first.level, first.source) == (t_ns, "warning", "navigation")
    assert "7 frames (1.0 s) were skipped to" in first.text
    for _ in range(3):
        skips.add(100, 2 * SECOND_NS)
    assert skips.take_event(t_ns + EVENT_PERIOD_NS - 1) is None
    later = skips.take_event(t_ns + EVENT_PERIOD_NS)
    assert later
    assert "300 frames (6.0 s) were skipped in 3 steps to" in later.text
    assert skips.take_event(t_ns + 10 * EVENT_PERIOD_NS) is None


def test_unreported_skips_are_reported_at_the_end() -> None:
    skips = SkipReporter()
    for _ in range(2):
        skips.add(5, SECOND_NS)
        skips.take_event(0)
    event = skips.flush(1)
    assert event
    assert "5 frames" in event.text
    assert skips.flush(2) is None
