"""Comparison of position devices that do not aid the filter with the filter.

    refused    the difference is larger than the filter's protection level plus K sigma of the device, for HOLD_NS
    used again it is smaller for AGREED_NS, while the filter's level is below half of the former difference; or the
               operator commands it

A device that is aided by a receiver follows that receiver's faults: it never confirms it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from fti.messages.outputs import Event
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal, RefusedPart
from fti.nav.protection import K_AXIS, K_RADIAL, FilterReference, differences
from fti.nav.source_interpolation import PositionState

HOLD_NS, AGREED_NS = 2_000_000_000, 30_000_000_000


@dataclass(slots=True)
class _DeviceState:
    """Of one device.  differs_ns, agrees_ns : start of it, None: not;  size : of the last contradiction [m]"""

    differs_ns: int | None = None
    agrees_ns: int | None = None
    is_refused: bool = False
    size: float = 0.0


class SourceCheck:
    """Check of all devices.  assumed : horizontal and vertical sigma if none is stated [m], by device"""

    def __init__(self, assumed: Mapping[str, tuple[float, float]]) -> None:
        self._assumed = assumed
        self._states = {name: _DeviceState() for name in assumed}

    @property
    def refused(self) -> frozenset[str]:
        """Refused devices."""
        return frozenset(name for name, state in self._states.items() if state.is_refused)

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Refusals in force."""
        return [
            CarriedRefusal(name, RefusedPart.DIFFERENCE, Reason.CONTRADICTION, s.differs_ns or 0, size_m=s.size)
            for name, s in self._states.items()
            if s.is_refused
        ]

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> list[Event]:
        """Start with refusals from before this process; those of other tests are ignored."""
        own = [r for r in refusals if r.part is RefusedPart.DIFFERENCE and r.source in self._states]
        for refusal in own:
            self._states[refusal.source] = _DeviceState(is_refused=True, size=refusal.size_m)
        text = (
            "still refused after navigation was started again; it is used again after 30 s of agreement with the filter"
        )
        return [Event(t_ns=t_ns, level="warning", source="nav", text=f"{r.source}: {text}") for r in own]

    def readmit(self, device: str, t_ns: int) -> list[Event]:
        """Use a refused device again on the operator's command: a small difference never resolves."""
        state = self._states.get(device)
        if state is None or not state.is_refused:
            return []
        self._states[device] = _DeviceState()
        text = f"{device}: is used again: the operator commands it"
        return [Event(t_ns=t_ns, level="info", source="nav", text=text)]

    def update(self, t_ns: int, positions: Mapping[str, PositionState], reference: FilterReference) -> list[Event]:
        """Compare positions of devices at a time; the state of devices without a position does not change."""
        events: list[Event] = []
        for name, position in positions.items():
            state, size = self._states[name], self._contradiction(name, position, reference)
            if size > 0.0:
                events += _note_difference(state, t_ns, name, size)
            else:
                events += _note_agreement(state, t_ns, name, reference)
        return events

    def _contradiction(self, name: str, position: PositionState, reference: FilterReference) -> float:
        """The difference from the filter [m] if it exceeds the uncertainty of both; else 0."""
        horizontal, vertical = differences(position, reference.position)
        assumed_horizontal, assumed_vertical = self._assumed[name]
        if horizontal > reference.horizontal + K_RADIAL * (position.horizontal_sd or assumed_horizontal):
            return horizontal
        limit = reference.vertical + K_AXIS * (position.vertical_sd or assumed_vertical)
        return vertical if vertical is not None and vertical > limit else 0.0


def _note_difference(state: _DeviceState, t_ns: int, name: str, size: float) -> list[Event]:
    state.agrees_ns, state.size = None, size
    if state.differs_ns is None:
        state.differs_ns = t_ns
    if state.is_refused or t_ns - state.differs_ns < HOLD_NS:
        return []
    state.is_refused = True
    text = f"{name}: refused: {size:.0f} m from the filter; it is used again after 30 s of agreement"
    return [Event(t_ns=t_ns, level="warning", source="nav", text=text)]


def _note_agreement(state: _DeviceState, t_ns: int, name: str, reference: FilterReference) -> list[Event]:
    state.differs_ns = None
    if state.agrees_ns is None:
        state.agrees_ns = t_ns
    is_resolved = max(reference.horizontal, reference.vertical) < 0.5 * state.size
    if not state.is_refused or t_ns - state.agrees_ns < AGREED_NS or not is_resolved:
        return []
    state.is_refused = False
    return [Event(t_ns=t_ns, level="info", source="nav", text=f"{name}: agrees with the filter again")]
