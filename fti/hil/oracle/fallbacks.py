"""What navigation must say when every device that has its position is gone: who takes its place.

First the filter, as long as its inertial unit is there; it needs satellites to begin anew, so that it does not come
back before they do.  Then radio navigation, where stations enough are configured.  Each is told by the source in
``nav_solution`` and by an event.  The duty is of the fault that takes the last device, or the inertial unit, away.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from fti.hil.faults.applicability import applies_to
from fti.hil.oracle.flag_definitions import NAV_EVENT, NAV_S, SOLUTION, ExpectedFlag, FaultFlags
from fti.hil.oracle.roles import AircraftRoles
from fti.hil.tables.fault_base import DeviceFault
from fti.hil.tables.fault_types import Breaker, BrownOut, Cut, Fault, GnssOutage, Invalid
from fti.nav.navigation import FILTER, RADIO

NAVIGATION = "navigation"
#: Ranges to fewer stations have two solutions.
MIN_STATIONS = 3


@dataclass(frozen=True, slots=True)
class _DeviceLoss:
    """A device says nothing that counts from from_s until until_s; noticed and heard again so long after [s]."""

    fault: int
    name: str
    from_s: float
    until_s: float
    within_s: float
    clears_s: float


def fallback_flags(faults: tuple[Fault, ...], craft: AircraftRoles) -> list[tuple[int, FaultFlags]]:
    """The faults that leave navigation without a device for the position, each with who takes over."""
    found = list[tuple[int, FaultFlags]]()
    for last, until_s, clears_s in _position_gaps(list(_losses(faults, craft, craft.positions)), craft):
        unit = _first_loss(_losses(faults, craft, (craft.filter_imu,)), last.from_s, until_s)
        filter_until_s = until_s if unit is None else unit.from_s
        filters = craft.filter_imu is not None and filter_until_s > last.from_s
        if filters:
            clear_s = clears_s if unit is None else unit.within_s
            found.append((last.fault, _takeover_flags((FILTER, last.name), last, filter_until_s, clear_s)))
        if craft.radio_stations >= MIN_STATIONS and not (filters and unit is None):
            after, instead = (unit, FILTER) if filters and unit else (last, last.name)
            found.append((after.fault, _takeover_flags((RADIO, instead), after, until_s, clears_s)))
    return found


def _first_loss(losses: Iterable[_DeviceLoss], from_s: float, until_s: float) -> _DeviceLoss | None:
    """The first loss in an interval."""
    during = [one for one in losses if one.from_s < until_s and one.until_s > from_s]
    return min(during, key=lambda one: one.from_s, default=None)


def _takeover_flags(who_instead: tuple[str, str], cause: _DeviceLoss, until_s: float, clears_s: float) -> FaultFlags:
    who, instead = who_instead
    is_paused = cause.from_s, until_s, cause.within_s, clears_s
    source = ExpectedFlag(SOLUTION, (f"position from {who}",), *is_paused)
    event = ExpectedFlag(NAV_EVENT, (f"position: from {who} instead of {instead}",), *is_paused)
    return FaultFlags.from_flags(NAVIGATION, (source, event), ())


def _position_gaps(gone: list[_DeviceLoss], craft: AircraftRoles) -> Iterator[tuple[_DeviceLoss, float, float]]:
    """Each stretch without any device for the position: the loss that began it, its end, and until it is seen [s]."""
    for last in gone:
        now = {one.name: one for one in gone if one.from_s <= last.from_s < one.until_s}
        if craft.positions and now.keys() == set(craft.positions):
            first = min(now.values(), key=lambda one: one.until_s)
            yield last, first.until_s, first.clears_s


def _losses(faults: tuple[Fault, ...], craft: AircraftRoles, names: tuple[str | None, ...]) -> Iterator[_DeviceLoss]:
    """What takes these devices away."""
    for index, fault in enumerate(faults):
        for bound in craft.devices:
            name = bound.device.name
            if (
                name in names
                and isinstance(fault, DeviceFault)
                and applies_to(fault, bound)
                and _causes_loss(fault, craft, name)
            ):
                yield _loss(index, fault, craft, name)


def _causes_loss(fault: DeviceFault, craft: AircraftRoles, name: str) -> bool:
    if isinstance(fault, GnssOutage):
        return craft.is_receiver(name)
    if isinstance(fault, Invalid):
        return craft.can_declare_invalid(name)
    return isinstance(fault, Cut | Breaker) or (isinstance(fault, BrownOut) and craft.stops_at(name, fault.supply_v))


def _loss(index: int, fault: DeviceFault, craft: AircraftRoles, name: str) -> _DeviceLoss:
    told = isinstance(fault, GnssOutage | Invalid)  # a device that says so is gone at once
    within_s = (craft.period_s(name) if told else craft.max_age_s(name)) + NAV_S
    fix_s = craft.FIX_S if isinstance(fault, GnssOutage) else craft.boot_s(name)
    return _DeviceLoss(index, name, fault.from_s, fault.to_s, within_s, 2 * craft.period_s(name) + NAV_S + fix_s)
