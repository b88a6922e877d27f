"""Patience: nothing is skipped for being late until the ring has overrun navigation, and not after it follows again."""

from __future__ import annotations

from fti.service.patience import ENOUGH_NS, ENOUGH_PAUSES, LONGEST_WAIT_NS, SECOND_NS, TELL_NS, Patience, Skips


def test_it_is_endless_before_anything_was_lost() -> None:
    patience = Patience()
    assert not patience.ends_at(3600 * SECOND_NS)


def test_it_ends_when_what_waits_is_late_after_an_overrun() -> None:
    patience = Patience()
    patience.lose()
    assert not patience.ends_at(LONGEST_WAIT_NS)
    assert patience.ends_at(LONGEST_WAIT_NS + 1)


def test_it_comes_back_with_enough_pauses_since_the_last_loss() -> None:
    patience = Patience()
    patience.lose()
    for k in range(ENOUGH_PAUSES - 1):
        patience.rest(k * ENOUGH_NS)
    patience.lose()
    for k in range(2 * ENOUGH_PAUSES):
        patience.rest(k * ENOUGH_NS // (2 * ENOUGH_PAUSES))
    assert patience.ends_at(SECOND_NS), "often, but not for long"
    patience.rest(ENOUGH_NS)
    assert not patience.ends_at(SECOND_NS)


def test_the_first_skip_is_told_at_once_and_what_follows_together() -> None:
    skips, t_ns = Skips(), 10**18
    assert skips.news(t_ns) is None
    skips.note(7, SECOND_NS)
    first = skips.news(t_ns)
    assert first
    assert (first.t_ns, first.level, first.source) == (t_ns, "warning", "navigation")
    assert "7 frames (1.0 s) were skipped to" in first.text
    for _ in range(3):
        skips.note(100, 2 * SECOND_NS)
    assert skips.news(t_ns + TELL_NS - 1) is None
    later = skips.news(t_ns + TELL_NS)
    assert later
    assert "300 frames (6.0 s) were skipped in 3 steps to" in later.text
    assert skips.news(t_ns + 10 * TELL_NS) is None


def test_what_was_not_told_is_told_in_the_end() -> None:
    skips = Skips()
    for _ in range(2):
        skips.note(5, SECOND_NS)
        skips.news(0)
    rest = skips.rest(1)
    assert rest
    assert "5 frames" in rest.text
    assert skips.rest(2) is None
