"""What a monitor remembers of the oldest copy, and which receivers differ from the filter alike."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fti.nav.filter.gate import Judgement
from fti.nav.separation.copies import Separation
from fti.nav.separation.ladder import Ladder, Rungs
from fti.nav.separation.monitor import HORIZONTAL_AXES, K_FA, SETTLE_NS, Refusals, SeparationMonitor

SECOND_NS = 10**9


class Shown(Ladder):
    """A ladder whose one copy differs from the filter by a ratio; notes what it is asked to keep."""

    def __init__(self) -> None:
        super().__init__(frozenset(), frozenset(), Rungs(4, SECOND_NS))
        self.ratio = 0.0
        self.kept: list[bool] = []

    def separations(self, now: Any) -> list[Separation]:
        d, ones = np.array([self.ratio, 0.0, 0.0, 0.0, 0.0, 0.0]), np.ones(6)
        return [Separation(d, ones, ones, (self.ratio, 0.0), 1.0)]

    def renew(self, now: Any, *, keep_oldest: bool = False) -> None:
        self.kept.append(keep_oldest)


def kept_after(ratios: list[float], *, is_held: bool) -> list[bool]:
    """Whether the oldest copy was kept at each renewal."""
    ladder = Shown()
    monitor = SeparationMonitor(ladder, HORIZONTAL_AXES)
    if is_held:
        monitor.hold_oldest()
    for k, ratio in enumerate(ratios):
        ladder.ratio = ratio
        moment: Any = SimpleNamespace(estimate=SimpleNamespace(t_ns=k * 2 * SETTLE_NS))
        monitor.follow(moment, may_renew=k > 0)
    return ladder.kept


@pytest.mark.parametrize(
    ("ratios", "is_held", "expected"),
    [
        ([0.0, 0.4 * K_FA, 1.0], True, [False, False]),  # it never differed by half of K_FA
        ([0.0, 0.6 * K_FA, 1.0], True, [True]),  # its sigma grew: that ends nothing
        ([0.6 * K_FA, 1.0, 0.5, 0.1], True, [True] * 3),
        ([0.0, 0.6 * K_FA, 1.0], False, [False]),
    ],
)
def test_a_copy_that_is_held_and_has_contradicted_is_not_replaced(
    ratios: list[float], is_held: bool, expected: list[bool]
) -> None:
    assert kept_after(ratios, is_held=is_held) == expected


def test_what_is_forgotten_is_not_held_any_more() -> None:
    monitor = SeparationMonitor(Shown(), HORIZONTAL_AXES)
    monitor.hold_oldest()
    monitor.clear()
    assert not monitor._is_held


def test_only_the_oldest_copy_is_held_for_what_it_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    ladder = Shown()
    monitor = SeparationMonitor(ladder, HORIZONTAL_AXES)
    monitor.hold_oldest()
    shown = ladder.separations(None)

    def separations(_: Any) -> list[Separation]:
        ladder.ratio = 0.6 * K_FA
        return [*shown, *Shown.separations(ladder, None)]

    monkeypatch.setattr(ladder, "separations", separations)
    moment: Any = SimpleNamespace(estimate=SimpleNamespace(t_ns=0))
    monitor.follow(moment, may_renew=False)
    assert not monitor._was_half


def refusals_of(**innovations: tuple[Judgement, list[float]]) -> tuple[Refusals, Any]:
    """Refusals of velocities at one moment, by receiver."""
    entries = [
        SimpleNamespace(
            t_ns=SECOND_NS,
            aiding=SimpleNamespace(name=f"{device}.velocity"),
            judgement=judgement,
            innovation=np.array(innovation),
        )
        for device, (judgement, innovation) in innovations.items()
    ]
    since = {
        entry.aiding.name: SimpleNamespace(refused_since_ns=SECOND_NS if entry.judgement is Judgement.REFUSED else None)
        for entry in entries
    }
    now = SimpleNamespace(estimate=SimpleNamespace(t_ns=SECOND_NS), standings=since)
    found = Refusals()
    segment: Any = SimpleNamespace(entries=entries, end=now)
    found.follow(segment, frozenset(since))
    return found, now


@pytest.mark.parametrize(
    ("other", "is_alike"),
    [
        ([0.7, 0.2, 0.0], True),
        ([0.8, 0.5, 0.1], True),
        ([0.3, 0.1, 0.0], False),  # it follows the filter
        ([-0.8, -0.3, 0.0], False),  # a filter that has followed the wrong one is on the other side of the right one
        ([0.0, 0.8, 0.0], False),
    ],
)
def test_a_receiver_that_the_gate_lets_in_may_tell_the_same_as_one_that_it_refuses(
    other: list[float], is_alike: bool
) -> None:
    found, now = refusals_of(a=(Judgement.REFUSED, [0.8, 0.3, 0.0]), b=(Judgement.BELIEVED, other))
    names = frozenset({"a.velocity"}), frozenset({"b.velocity"})
    assert found.is_alike(now, *names) is is_alike
    assert not found.is_alike(now, *names[::-1]), "b is not refused"
