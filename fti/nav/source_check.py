"""Devices that give a position and do not aid the filter are compared with it.

    refused    the difference is larger than the filter's protection level and K sigma of the device, for HOLD_NS
    back in    it is smaller for AGREED_NS, while the filter's level is below half of the difference before; or the
               operator commands it

A device that is aided by a receiver of its own follows it when it lies: it is never a witness for that receiver.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from fti.nav.carried_refusal import CarriedRefusal, RefusedPart
from fti.nav.protection import K_AXIS, K_RADIAL, FilterReference, differences
from fti.nav.source_interpolation import PositionState
from fti.types import Event, Reason

HOLD_NS, AGREED_NS = 2_000_000_000, 30_000_000_000


@dataclass(slots=True)
class _Standing:
    """Of one device.  differs_ns, agrees_ns : since when, None: not;  size : of the last contradiction [m]"""

    differs_ns: int | None = None
    agrees_ns: int | None = None
    is_refused: bool = False
    size: float = 0.0


class SourceCheck:
    """Of all devices.  assumed : horizontal and vertical sigma of what states none [m], by device"""

    def __init__(self, assumed: Mapping[str, tuple[float, float]]) -> None:
        self._assumed = assumed
        self._standings = {name: _Standing() for name in assumed}

    @property
    def refused(self) -> frozenset[str]:
        """Devices that are refused."""
        return frozenset(name for name, standing in self._standings.items() if standing.is_refused)

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Those in force."""
        return [
            CarriedRefusal(name, RefusedPart.DIFFERENCE, Reason.CONTRADICTION, s.differs_ns or 0, size_m=s.size)
            for name, s in self._standings.items()
            if s.is_refused
        ]

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> list[Event]:
        """Begin with refusals of before this process; those of others are left out."""
        mine = [r for r in refusals if r.part is RefusedPart.DIFFERENCE and r.source in self._standings]
        for refusal in mine:
            self._standings[refusal.source] = _Standing(is_refused=True, size=refusal.size_m)
        text = (
            "still refused after navigation was started again; it is used again after 30 s of agreement with the filter"
        )
        return [Event(t_ns=t_ns, level="warning", source="nav", text=f"{r.source}: {text}") for r in mine]

    def readmit(self, device: str, t_ns: int) -> list[Event]:
        """Use a device again because the operator commands it, if it is refused: a small difference never resolves."""
        standing = self._standings.get(device)
        if standing is None or not standing.is_refused:
            return []
        self._standings[device] = _Standing()
        text = f"{device}: is used again: the operator commands it"
        return [Event(t_ns=t_ns, level="info", source="nav", text=text)]

    def update(self, t_ns: int, positions: Mapping[str, PositionState], compared: FilterReference) -> list[Event]:
        """Take what devices give at a time; those without a position are as they were."""
        events: list[Event] = []
        for name, position in positions.items():
            standing, size = self._standings[name], self._contradiction(name, position, compared)
            if size > 0.0:
                events += _differ(standing, t_ns, name, size)
            else:
                events += _agree(standing, t_ns, name, compared)
        return events

    def _contradiction(self, name: str, position: PositionState, compared: FilterReference) -> float:
        """The difference from the filter [m] where it is larger than what the two admit; 0: it is not."""
        level, high = differences(position, compared.position)
        assumed_level, assumed_high = self._assumed[name]
        is_level = level > compared.horizontal + K_RADIAL * (position.horizontal_sd or assumed_level)
        if is_level:
            return level
        is_high = high is not None and high > compared.vertical + K_AXIS * (position.vertical_sd or assumed_high)
        return high if is_high and high is not None else 0.0


def _differ(standing: _Standing, t_ns: int, name: str, size: float) -> list[Event]:
    standing.agrees_ns, standing.size = None, size
    if standing.differs_ns is None:
        standing.differs_ns = t_ns
    if standing.is_refused or t_ns - standing.differs_ns < HOLD_NS:
        return []
    standing.is_refused = True
    text = f"{name}: refused: {size:.0f} m from the filter; it is used again after 30 s of agreement"
    return [Event(t_ns=t_ns, level="warning", source="nav", text=text)]


def _agree(standing: _Standing, t_ns: int, name: str, compared: FilterReference) -> list[Event]:
    standing.differs_ns = None
    if standing.agrees_ns is None:
        standing.agrees_ns = t_ns
    is_resolved = max(compared.horizontal, compared.vertical) < 0.5 * standing.size
    if not standing.is_refused or t_ns - standing.agrees_ns < AGREED_NS or not is_resolved:
        return []
    standing.is_refused = False
    return [Event(t_ns=t_ns, level="info", source="nav", text=f"{name}: agrees with the filter again")]
