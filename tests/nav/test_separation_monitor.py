"""Suspicion of a class of sources, and receivers with the same innovation."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fti.nav.filter.innovation_gate import GateDecision
from fti.nav.separation.copies import FilterCopy, Separation
from fti.nav.separation.copy_ring import CopyRing, RingSettings
from fti.nav.separation.monitor import (
    DOWN_AXIS,
    HORIZONTAL_AXES,
    K_FA,
    K_FA_SATELLITES,
    SETTLE_NS,
    Refusals,
    SeparationMonitor,
)

SECOND_NS = 10**9


class Shown(CopyRing):
    """A ladder whose one copy differs from the filter by a ratio; counts its renewals."""

    def __init__(self, heading_sd: float = 0.0) -> None:
        super().__init__(frozenset(), frozenset(), RingSettings(4, SECOND_NS))
        self.ratio = 0.0
        self.renewals = 0
        estimate: Any = None
        self.copies.append(FilterCopy(0, estimate, {}, frozenset(), heading_sd=heading_sd))

    def separations(self, now: Any) -> list[Separation]:
        d, ones = np.array([self.ratio, 0.0, self.ratio, 0.0, 0.0, 0.0]), np.ones(6)
        return [Separation(d, ones, ones, (self.ratio, 0.0), 1.0)]

    def clear(self) -> None:
        """Keep the copy."""

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
        monitor.follow(moment_at(k * 2 * SETTLE_NS), may_renew=k > 0)
    assert (monitor.is_suspected, copy_ring.renewals == 1) == (is_suspected, is_renewed)


def moment_at(t_ns: int, heading_sd: float = 0.0) -> Any:
    return SimpleNamespace(estimate=SimpleNamespace(t_ns=t_ns, rpy_sd=(0.0, 0.0, heading_sd)))


@pytest.mark.parametrize(
    ("copy_deg", "filter_deg", "axes", "is_suspected"),
    [
        (40.0, 39.0, HORIZONTAL_AXES, True),  # straight on: neither knows it
        (40.0, 5.0, HORIZONTAL_AXES, False),  # the filter has found it in a turn
        (40.0, 5.0, DOWN_AXIS, True),
        (4.0, 2.0, HORIZONTAL_AXES, True),  # certain enough for a linear effect
    ],
)
def test_a_copy_whose_heading_was_lost_does_not_count_after_the_filter_has_found_it(
    copy_deg: float, filter_deg: float, axes: tuple[int, ...], is_suspected: bool
) -> None:
    copy_ring = Shown(np.radians(copy_deg))
    monitor = SeparationMonitor(copy_ring, axes)
    copy_ring.ratio = 6.0
    monitor.follow(moment_at(2 * SETTLE_NS, float(np.radians(filter_deg))), may_renew=True)
    assert monitor.is_suspected == is_suspected


def test_its_gate_does_not_count_either() -> None:
    copy_ring = Shown(np.radians(40.0))
    monitor = SeparationMonitor(copy_ring, HORIZONTAL_AXES)
    copy_ring.copies[0].outside_ns, copy_ring.copies[0].times = 0, 100
    for heading_deg, is_faulty in ((39.0, True), (5.0, False)):
        monitor.follow(moment_at(2 * SETTLE_NS, float(np.radians(heading_deg))), may_renew=False)
        assert (monitor.find(2 * SETTLE_NS, Refusals()) is not None) == is_faulty


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
