"""Expected flags when all position devices are lost: the fallback source of the position.

First the filter, while its inertial unit works; it needs satellites to start again, so it does not return before them.
Then radio navigation, if enough stations are configured.  The source in ``nav_solution`` and an event report each.
The flag belongs to the fault that causes the loss of the last device, or of the inertial unit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from fti.hil.faults.applicability import applies_to
from fti.hil.oracle.flag_definitions import NAV_EVENT, NAV_S, SOLUTION, ExpectedFlag, FaultFlags
from fti.hil.oracle.roles import AircraftRoles
from fti.hil.tables.fault_base import DeviceFault
from fti.hil.tables.fault_types import Breaker, BrownOut, Cut, Fault, GnssOutage, Invalid
from fti.nav.navigation import FILTER, RADIO

NAVIGATION = "navigation"
#: Ranges to two stations are ambiguous.
MIN_STATIONS = 3


@dataclass(frozen=True, slots=True)
class _DeviceLoss:
    """A device is unusable from from_s until until_s; detected within within_s, used again within clears_s [s]."""

    fault: int
    name: str
    from_s: float
    until_s: float
    within_s: float
    clears_s: float


def fallback_flags(faults: tuple[Fault, ...], craft: AircraftRoles) -> list[tuple[int, FaultFlags]]:
    """The faults after which no device gives a position, each with the flags of the fallback source."""
    found = list[tuple[int, FaultFlags]]()
    for last, until_s, clears_s in _position_gaps(list(_losses(faults, craft, craft.positions)), craft):
        losses = _losses(faults, craft, (craft.filter_imu,))
        during = (loss for loss in losses if loss.from_s < until_s and loss.until_s > last.from_s)
        unit = min(during, key=lambda loss: loss.from_s, default=None)
        filter_until_s = until_s if unit is None else unit.from_s
        has_filter = craft.filter_imu is not None and filter_until_s > last.from_s
        if has_filter:
            clear_s = clears_s if unit is None else unit.within_s
            found.append((last.fault, _takeover_flags((FILTER, last.name), last, filter_until_s, clear_s)))
        if craft.radio_stations >= MIN_STATIONS and not (has_filter and unit is None):
            cause, old = (unit, FILTER) if has_filter and unit else (last, last.name)
            found.append((cause.fault, _takeover_flags((RADIO, old), cause, until_s, clears_s)))
    return found


def _takeover_flags(sources: tuple[str, str], cause: _DeviceLoss, until_s: float, clears_s: float) -> FaultFlags:
    new, old = sources
    timing = cause.from_s, until_s, cause.within_s, clears_s
    source = ExpectedFlag(SOLUTION, (f"position from {new}",), *timing)
    event = ExpectedFlag(NAV_EVENT, (f"position: from {new} instead of {old}",), *timing)
    return FaultFlags.from_flags(NAVIGATION, (source, event), ())


def _position_gaps(losses: list[_DeviceLoss], craft: AircraftRoles) -> Iterator[tuple[_DeviceLoss, float, float]]:
    """Each interval without a position device: the loss that starts it, its end, and the delay of its detection [s]."""
    for last in losses:
        now = {one.name: one for one in losses if one.from_s <= last.from_s < one.until_s}
        if craft.positions and now.keys() == set(craft.positions):
            first = min(now.values(), key=lambda one: one.until_s)
            yield last, first.until_s, first.clears_s


def _losses(faults: tuple[Fault, ...], craft: AircraftRoles, names: tuple[str | None, ...]) -> Iterator[_DeviceLoss]:
    for index, fault in enumerate(faults):
        for bound in craft.devices:
            name = bound.device.name
            if name not in names or not isinstance(fault, DeviceFault):
                continue
            if applies_to(fault, bound) and _causes_loss(fault, craft, name):
                is_declared = isinstance(fault, GnssOutage | Invalid)  # no age limit to wait for
                within_s = (craft.period_s(name) if is_declared else craft.max_age_s(name)) + NAV_S
                fix_s = craft.FIX_S if isinstance(fault, GnssOutage) else craft.boot_s(name)
                clears_s = 2 * craft.period_s(name) + NAV_S + fix_s
                yield _DeviceLoss(index, name, fault.from_s, fault.to_s, within_s, clears_s)


def _causes_loss(fault: DeviceFault, craft: AircraftRoles, name: str) -> bool:
    if isinstance(fault, GnssOutage):
        return craft.is_receiver(name)
    if isinstance(fault, Invalid):
        return craft.can_declare_invalid(name)
    return isinstance(fault, Cut | Breaker) or (isinstance(fault, BrownOut) and craft.stops_at(name, fault.supply_v))
