"""Which of several receivers is wrong, if the filter contradicts them or they contradict each other.

    by gates    receivers that the filter refuses, and those that have the same innovations
    by copies   the receiver without which the filter agrees with the copy without satellites
    by ratio    the receiver without which the filter is separated most (``is_single_fault``)

Checked against: tests/nav/test_fault_detection.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fti.nav.filter.innovation_gate import LIMITS
from fti.nav.filter.measurement_update import compute_nis
from fti.nav.filter.segment import FilterSegment
from fti.nav.separation.copies import separate
from fti.nav.separation.monitor import HALF_K_FA, REFUSED_NS, SourceFault
from fti.nav.separation.source_class import SourceClass, receiver_names

#: Ratio of the separation without a wrong receiver to that without any other one.
SINGLE_FAULT_RATIO = 1.5


@dataclass(frozen=True, slots=True)
class Attribution:
    """Of one contradiction.  group, finding : the class that contradicts at the end of a segment, and why

    receivers : the class of each of several receivers
    """

    group: SourceClass
    finding: SourceFault
    segment: FilterSegment
    receivers: Sequence[SourceClass]

    def find_wrong(self, aiding: tuple[str, ...], *, by_copies: bool) -> tuple[str, ...]:
        """The wrong ones of the receivers that aid; empty if they are unknown.  by_copies : not by gates"""
        devices = tuple(device for device in aiding if self._is_accepted_since(device)) or aiding
        if len(devices) < 2:
            return devices
        return self._find_by_copies(devices) if by_copies else self._find_by_gates(devices)

    def _is_accepted_since(self, device: str) -> bool:
        """Whether the filter has accepted a measurement of a receiver since the copy began, or refuses it now.

        A receiver that was silent cannot be the cause of a wrong filter.
        """
        moment, names = self.segment.end, receiver_names(device)
        began_ns = self.finding.copy.began_ns if self.finding.copy else 0
        accepted = (moment.gate_states[name].accepted_ns for name in names if name in moment.gate_states)
        is_accepted = any(accepted_ns is not None and accepted_ns >= began_ns for accepted_ns in accepted)
        return is_accepted or self.group.refusals.since(moment, names) is not None

    # --------------------------------------------------------------------------------------------------------- by gates

    def _find_by_gates(self, devices: tuple[str, ...]) -> tuple[str, ...]:
        """Receivers outside the gate, and those with the same innovations."""
        wrong = tuple(device for device in devices if self._contradicts(device))
        return tuple(device for device in devices if device in wrong or self._is_alike(device, wrong))

    def _contradicts(self, device: str) -> bool:
        """Whether the filter refuses one of several receivers, or its last fix is outside the gate of the copy."""
        end = self.segment.end
        if self.finding.refused:
            since = self.group.refusals.since(end, receiver_names(device) & self.group.tested_names)
            return since is not None and end.estimate.t_ns - since >= REFUSED_NS
        names = receiver_names(device, self.group.quantities[:1])
        last = [entry for entry in self.segment.entries if entry.aiding.name in names]
        if not last:
            return False
        estimate = self.finding.copy.estimate if self.finding.copy else end.estimate
        matrices = last[-1].aiding.compute_matrices(estimate)
        return compute_nis(estimate, matrices) > LIMITS[len(matrices[0])]

    def _is_alike(self, device: str, wrong: Iterable[str]) -> bool:
        """Whether a receiver has the same innovations as a refused one, although its own refusal has not lasted."""
        tested, refusals, end = self.group.tested_names, self.group.refusals, self.segment.end
        names = receiver_names(device) & tested
        others = (receiver_names(other) & tested for other in wrong)
        return self.finding.refused and any(refusals.is_alike(end, other, names) for other in others)

    # -------------------------------------------------------------------------------------------------------- by copies

    def _find_by_copies(self, devices: tuple[str, ...]) -> tuple[str, ...]:
        """The one receiver without which the filter agrees with the oldest copy; all if they have a common fault.

        With a common fault they agree with each other, and the filter without any one of them contradicts a copy.  A
        young copy shows a velocity change best, but may contain the fault: it cannot identify a single receiver.
        Empty if it is not clear, or without a copy.
        """
        monitor = self.group.monitor
        if not monitor.copy_ring.copies:
            return ()
        ratios = {device: self._ratios_without(device) for device in devices}
        if self._agree(devices) and all(max(of_copies) >= monitor.k_fa for of_copies in ratios.values()):
            return devices
        still = tuple(device for device in devices if ratios[device][0] >= monitor.k_fa)
        ending = tuple(device for device in devices if ratios[device][0] < HALF_K_FA)
        if len(still) == len(devices):
            return devices
        return ending if len(ending) == 1 and len(still) == len(devices) - 1 else ()

    def _agree(self, devices: tuple[str, ...]) -> bool:
        """Whether receivers are compared with each other, and no one contradicts."""
        monitors = [each.monitor for each in self.receivers if each.label in devices]
        return all(monitor.separations and monitor.ratio < monitor.k_fa for monitor in monitors)

    def _ratios_without(self, device: str) -> list[float]:
        """|d| over sigma of the copy without one receiver from copies without any; infinite without such a copy."""
        mine = next(each.monitor.copy_ring.oldest for each in self.receivers if each.label == device)
        if mine is None:
            return [np.inf]
        separations = [separate(mine.estimate, copy.estimate) for copy in self.group.monitor.copy_ring.copies]
        return [max(separation.level_ratios) for separation in separations]


def is_single_fault(receiver: SourceClass, receivers: Iterable[SourceClass]) -> bool:
    """Whether the separation without one of several receivers shows that exactly this one is wrong.

    If two receivers contradict each other, the separations without either are alike.  Of three, the one without the
    wrong receiver is twice as large as the others.
    """
    others = (each.monitor.ratio for each in receivers if each is not receiver)
    return receiver.monitor.ratio > SINGLE_FAULT_RATIO * max(others, default=0.0)
