"""Suspicion of a class of sources, and receivers with the same innovation."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fti.nav.filter.innovation_gate import GateDecision
from fti.nav.separation.copies import Separation
from fti.nav.separation.copy_ring import CopyRing, RingSettings
from fti.nav.separation.monitor import HORIZONTAL_AXES, K_FA, K_FA_SATELLITES, SETTLE_NS, Refusals, SeparationMonitor

SECOND_NS = 10**9


class Shown(CopyRing):
    """A ladder whose one copy differs from the filter by a ratio; counts its renewals."""

    def __init__(self) -> None:
        super().__init__(frozenset(), frozenset(), RingSettings(4, SECOND_NS))
        self.ratio = 0.0
        self.renewals = 0

    def separations(self, now: Any) -> list[Separation]:
        d, ones = np.array([self.ratio, 0.0, 0.0, 0.0, 0.0, 0.0]), np.ones(6)
        return [Separation(d, ones, ones, (self.ratio, 0.0), 1.0)]

    def renew(self, now: Any, *, keep_oldest: bool = False) -> None:
        self.renewals += 1


@pytest.mark.parametrize(
    ("ratio", "k_fa", "is_suspected", "is_renewed"),
    [
        (4.0, K_FA_SATELLITES, False, False),
        (4.4, K_FA_SATELLITES, True, False),
        (4.4, K_FA, False, False),
        (2.5, K_FA_SATELLITES, False, True),  # nominal: a copy that is not replaced grows old, and the levels with it
        (2.5, K_FA, False, True),
    ],
)
def test_a_class_has_a_limit_of_its_own_and_all_are_renewed_below_the_same(
    ratio: float, k_fa: float, is_suspected: bool, is_renewed: bool
) -> None:
    copy_ring = Shown()
    monitor = SeparationMonitor(copy_ring, HORIZONTAL_AXES, k_fa)
    for k, shown in enumerate((0.0, ratio)):
        copy_ring.ratio = shown
        moment: Any = SimpleNamespace(estimate=SimpleNamespace(t_ns=k * 2 * SETTLE_NS))
        monitor.follow(moment, may_renew=k > 0)
    assert (monitor.is_suspected, copy_ring.renewals == 1) == (is_suspected, is_renewed)


def refusals_of(**innovations: tuple[GateDecision, list[float]]) -> tuple[Refusals, Any]:
    """Refusals of velocities at one moment, by receiver."""
    entries = [
        SimpleNamespace(
            t_ns=SECOND_NS,
            aiding=SimpleNamespace(name=f"{device}.velocity"),
            decision=decision,
            innovation=np.array(innovation),
        )
        for device, (decision, innovation) in innovations.items()
    ]
    since = {
        entry.aiding.name: SimpleNamespace(
            refused_since_ns=SECOND_NS if entry.decision is GateDecision.REFUSED else None
        )
        for entry in entries
    }
    now = SimpleNamespace(estimate=SimpleNamespace(t_ns=SECOND_NS), gate_states=since)
    refusals = Refusals()
    segment: Any = SimpleNamespace(entries=entries, end=now)
    refusals.follow(segment, frozenset(since))
    return refusals, now


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
def test_a_receiver_inside_the_gate_may_have_the_same_innovation_as_a_refused_one(
    other: list[float], is_alike: bool
) -> None:
    found, now = refusals_of(a=(GateDecision.REFUSED, [0.8, 0.3, 0.0]), b=(GateDecision.ACCEPTED, other))
    names = frozenset({"a.velocity"}), frozenset({"b.velocity"})
    assert found.is_alike(now, *names) is is_alike
    assert not found.is_alike(now, *names[::-1]), "b is not refused"
