"""Receivers that the filter excludes, as a whole or their heights only, with what is known of their contradictions.

Each has the conditions of its readmission (``readmission``), which count while it does not aid.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fti.constants import SECOND_NS
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal, RefusedPart
from fti.nav.confirmation import Size
from fti.nav.filter.innovation_gate import GateDecision
from fti.nav.filter.segment import FilterSegment
from fti.nav.separation.monitor import QUANTITY_AXES, SourceFault
from fti.nav.separation.readmission import AGREED_COUNT, AGREED_NS, Contradiction, ReadmissionCheck
from fti.nav.separation.source_class import HEIGHT, QUANTITIES, SourceClass, receiver_names

#: Quantities that a refusal from before this process excludes.
QUANTITIES_OF_PARTS = {RefusedPart.AIDING: QUANTITIES, RefusedPart.AIDING_HEIGHT: HEIGHT}


@dataclass(slots=True)
class ExcludedReceiver:
    """A receiver, or its heights only, that does not aid.

    label : for texts;  is_announced : whether an event has reported that it agrees and stays unconfirmed
    """

    device: str
    label: str
    onset_ns: int
    readmission_check: ReadmissionCheck
    is_announced: bool = False

    @property
    def names(self) -> frozenset[str]:
        """Names of ``Aiding``."""
        return frozenset(self.readmission_check.contradictions)

    @property
    def is_whole(self) -> bool:
        """Whether all its quantities are excluded."""
        return self.label == self.device


class ExcludedReceivers:
    """All of one filter."""

    def __init__(self) -> None:
        self._receivers: dict[str, ExcludedReceiver] = {}  # by label

    def __iter__(self) -> Iterator[ExcludedReceiver]:
        """In the order of their exclusion; they may be removed meanwhile."""
        return iter(tuple(self._receivers.values()))

    def of_device(self, device: str) -> list[ExcludedReceiver]:
        """A receiver, its heights, or both."""
        return [receiver for receiver in self if receiver.device == device]

    def find_whole(self, device: str) -> ExcludedReceiver | None:
        """A receiver that is excluded as a whole; None if it is not."""
        return self._receivers.get(device)

    @property
    def onsets(self) -> dict[str, int]:
        """Start of the contradiction of receivers that are excluded as a whole, by device."""
        return {receiver.device: receiver.onset_ns for receiver in self if receiver.is_whole}

    @property
    def without_heights(self) -> frozenset[str]:
        """Receivers whose heights do not aid, with or without their positions."""
        return frozenset(r.device for r in self if f"{r.device}.height" in r.names)

    @property
    def sizes(self) -> dict[str, Size]:
        """Contradictions of receivers that are excluded as a whole, by device."""
        return {receiver.device: size_of(receiver) for receiver in self if receiver.is_whole}

    @property
    def unconfirmed(self) -> dict[str, frozenset[str]]:
        """Names of receivers whose own tests have passed for long enough, by device."""
        names = dict[str, frozenset[str]]()
        for receiver in self:
            if receiver.readmission_check.has_passed:
                names[receiver.device] = names.get(receiver.device, frozenset()) | receiver.names
        return names

    def aiding_devices(self, group: SourceClass) -> tuple[str, ...]:
        """Devices of a class that are not excluded."""
        if not self._receivers:
            return group.devices
        excluded = frozenset[str]().union(*(receiver.names for receiver in self))
        return tuple(d for d in group.devices if not receiver_names(d, group.quantities) <= excluded)

    # ---------------------------------------------------------------------------------------------------------- changes

    def add(
        self, device: str, quantities: tuple[str, ...], finding: SourceFault, segment: FilterSegment
    ) -> ExcludedReceiver:
        """Add a receiver that contradicts the filter at the end of a segment."""
        check = ReadmissionCheck({f"{device}.{q}": _contradiction(device, q, finding, segment) for q in quantities})
        return self._add(device, quantities, finding.onset_ns, check)

    def restore(self, refusal: CarriedRefusal) -> ExcludedReceiver | None:
        """Add a receiver that was excluded before this process; None if other tests refuse it."""
        quantities = QUANTITIES_OF_PARTS.get(refusal.part)
        if quantities is None:
            return None
        check = ReadmissionCheck({f"{refusal.source}.{q}": Contradiction(QUANTITY_AXES[q]) for q in quantities})
        check.reset()
        return self._add(refusal.source, quantities, refusal.onset_ns, check)

    def _add(
        self, device: str, quantities: tuple[str, ...], onset_ns: int, check: ReadmissionCheck
    ) -> ExcludedReceiver:
        label = device if quantities == QUANTITIES else f"{device} height"
        self._receivers[label] = ExcludedReceiver(device, label, onset_ns, check)
        return self._receivers[label]

    def remove(self, receiver: ExcludedReceiver) -> None:
        """It aids again, or the filter restarts with it."""
        del self._receivers[receiver.label]

    def compare(self, segment: FilterSegment) -> None:
        """Compare their measurements in a segment with the filter, which does not use them."""
        for receiver in self:
            for entry in segment.entries:
                if entry.aiding.name in receiver.names and entry.decision is GateDecision.EXCLUDED:
                    receiver.readmission_check.compare(entry, segment.end.estimate)

    def reset(self) -> None:
        """The filter has restarted: they remain excluded, and what is known of their contradictions is lost."""
        for receiver in self:
            receiver.readmission_check.reset()

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Refusals in force."""
        return [
            CarriedRefusal(
                receiver.device,
                RefusedPart.AIDING if receiver.is_whole else RefusedPart.AIDING_HEIGHT,
                Reason.EXCLUDED,
                receiver.onset_ns,
                is_standing=True,
            )
            for receiver in self
        ]


def _contradiction(device: str, quantity: str, finding: SourceFault, segment: FilterSegment) -> Contradiction:
    """The contradiction at the exclusion of a source: its last refused innovation, or the separation.

    The innovation may lie within the gate of the copy that the filter continues from.
    """
    name, size = f"{device}.{quantity}", finding.sizes.get(quantity, 0.0)
    for entry in segment.entries:
        if entry.aiding.name == name and entry.decision is GateDecision.REFUSED and entry.innovation is not None:
            size = max(size, float(np.linalg.norm(entry.innovation)))
    is_real = size > 0.0
    return Contradiction(QUANTITY_AXES[quantity], size, segment.end.estimate.t_ns if is_real else None, is_real)


def size_of(receiver: ExcludedReceiver) -> Size:
    """Size of the contradiction of position and height; one of the velocity only has no size in metres."""
    contradictions = {name.rpartition(".")[2]: c for name, c in receiver.readmission_check.contradictions.items()}
    known = {name: c.size for name, c in contradictions.items() if c.outside_ns is not None}
    horizontal = known.get("position", 0.0)
    return Size(horizontal if horizontal > 0.0 else None, known.get("height"))


def describe_readmission(receiver: ExcludedReceiver) -> str:
    """The ways to readmit a receiver or its heights, as far as known."""
    check, command = receiver.readmission_check, f"'fti readmit {receiver.device}'"
    ways = ["a step back that ends the contradiction"] if check.is_known and check.is_outside else []
    if check.is_resolvable:
        ways.append(f"a sigma of the filter below {check.describe_resolved()}")
    if receiver.is_whole and (size_of(receiver).horizontal or 0.0) > 0.0:
        ways.append("agreement of an independent source")
    if not ways:
        return command
    agreed = f"{AGREED_NS // SECOND_NS} s and {AGREED_COUNT} fixes inside the gate of the filter"
    return f"{agreed} and {' or '.join(ways)}; or {command}"
