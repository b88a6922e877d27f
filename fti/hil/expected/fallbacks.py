"""What navigation must say when every device that has its position is gone: who takes its place.

First the filter, as long as its inertial unit is there; it needs satellites to begin anew, so that it does not come
back before they do.  Then radio navigation, where stations enough are configured.  Each is told by the source in
``nav_solution`` and by an event.  The duty is of the fault that takes the last device, or the inertial unit, away.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from fti.hil.expected.aircraft import Aircraft
from fti.hil.expected.duties import NAV_EVENT, NAV_S, SOLUTION, Duty, Told
from fti.hil.faults.fitting import is_of
from fti.hil.tables.bases import OnDevices
from fti.hil.tables.kinds import Breaker, BrownOut, Cut, Fault, GnssOutage, Invalid
from fti.nav.navigation import FILTER, RADIO

NAVIGATION = "navigation"
#: Ranges to fewer stations have two solutions.
STATIONS = 3


@dataclass(frozen=True, slots=True)
class _Gone:
    """A device says nothing that counts from from_s until until_s; noticed and heard again so long after [s]."""

    fault: int
    name: str
    from_s: float
    until_s: float
    within_s: float
    clears_s: float


def of_fallbacks(faults: tuple[Fault, ...], craft: Aircraft) -> list[tuple[int, Told]]:
    """The faults that leave navigation without a device for the position, each with who takes over."""
    found = list[tuple[int, Told]]()
    for last, until_s, clears_s in _without_position(list(_losses(faults, craft, craft.positions)), craft):
        unit = _first(_losses(faults, craft, (craft.filter_imu,)), last.from_s, until_s)
        filter_until_s = until_s if unit is None else unit.from_s
        filters = craft.filter_imu is not None and filter_until_s > last.from_s
        if filters:
            clear_s = clears_s if unit is None else unit.within_s
            found.append((last.fault, _taken((FILTER, last.name), last, filter_until_s, clear_s)))
        if craft.radio_stations >= STATIONS and not (filters and unit is None):
            after, instead = (unit, FILTER) if filters and unit else (last, last.name)
            found.append((after.fault, _taken((RADIO, instead), after, until_s, clears_s)))
    return found


def _first(losses: Iterable[_Gone], from_s: float, until_s: float) -> _Gone | None:
    """The first loss in an interval."""
    during = [one for one in losses if one.from_s < until_s and one.until_s > from_s]
    return min(during, key=lambda one: one.from_s, default=None)


def _taken(who_instead: tuple[str, str], cause: _Gone, until_s: float, clears_s: float) -> Told:
    who, instead = who_instead
    stands = cause.from_s, until_s, cause.within_s, clears_s
    source = Duty(SOLUTION, (f"position from {who}",), *stands)
    event = Duty(NAV_EVENT, (f"position: from {who} instead of {instead}",), *stands)
    return Told.from_duties(NAVIGATION, (source, event), ())


def _without_position(gone: list[_Gone], craft: Aircraft) -> Iterator[tuple[_Gone, float, float]]:
    """Each stretch without any device for the position: the loss that began it, its end, and until it is seen [s]."""
    for last in gone:
        now = {one.name: one for one in gone if one.from_s <= last.from_s < one.until_s}
        if craft.positions and now.keys() == set(craft.positions):
            first = min(now.values(), key=lambda one: one.until_s)
            yield last, first.until_s, first.clears_s


def _losses(faults: tuple[Fault, ...], craft: Aircraft, names: tuple[str | None, ...]) -> Iterator[_Gone]:
    """What takes these devices away."""
    for index, fault in enumerate(faults):
        for bound in craft.devices:
            name = bound.device.name
            if name in names and isinstance(fault, OnDevices) and is_of(fault, bound) and _takes(fault, craft, name):
                yield _loss(index, fault, craft, name)


def _takes(fault: OnDevices, craft: Aircraft, name: str) -> bool:
    if isinstance(fault, GnssOutage):
        return craft.is_receiver(name)
    if isinstance(fault, Invalid):
        return craft.says_invalid(name)
    return isinstance(fault, Cut | Breaker) or (isinstance(fault, BrownOut) and craft.stops_at(name, fault.supply_v))


def _loss(index: int, fault: OnDevices, craft: Aircraft, name: str) -> _Gone:
    told = isinstance(fault, GnssOutage | Invalid)  # a device that says so is gone at once
    within_s = (craft.period_s(name) if told else craft.max_age_s(name)) + NAV_S
    fix_s = craft.FIX_S if isinstance(fault, GnssOutage) else craft.boot_s(name)
    return _Gone(index, name, fault.from_s, fault.to_s, within_s, 2 * craft.period_s(name) + NAV_S + fix_s)
