"""Roles: selection of the devices for attitude and position, and the navigation state at one time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

from msgspec import Struct
from msgspec.structs import replace

from fti.config import AlertLimits
from fti.messages.outputs import Event, NavSolution
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal
from fti.nav.attitude_protection import AttitudeLevels
from fti.nav.protection import FilterReference, Protection, compare_with_filter, is_beyond, stated_levels
from fti.nav.source_check import SourceCheck
from fti.nav.source_interpolation import AttitudeState, NavSource, PositionState

if TYPE_CHECKING:
    from fti.nav.vertical.vertical_channel import VerticalState

#: After a gap in the input, changes of sources are not reported for so long [ns].
SETTLE_NS = 300_000_000
#: Sources that are not devices.
FILTER, VERTICAL, RADIO = "filter", "vertical", "radio"
#: Sigmas of a fallback that states none [m].
UNKNOWN_SD = (5.0, 10.0)


class NavState(Struct, frozen=True, gc=False):
    """State of navigation at t_ns; unknown values are None.

    altitude_holders : altimeters that alone bound the altitude (``fti.nav.altitude_hold``)
    """

    t_ns: int
    attitude: AttitudeState | None
    position: PositionState | None
    attitude_source: str | None
    position_source: str | None
    altitude_source: str | None = None
    altitude_holders: tuple[str, ...] = ()


class Fallback(Protocol):
    """Replacement for devices."""

    def position(self, t_ns: int) -> tuple[PositionState, str] | None:
        """Position with altitude, and the name of its source."""

    def attitude(self, t_ns: int) -> AttitudeState | None:
        """Attitude."""

    def altitude(self, t_ns: int) -> VerticalState | None:
        """Altitude only."""

    def altitude_holders(self, source: str | None) -> tuple[str, ...]:
        """Altimeters that alone bound the altitude of a source."""

    def filter_reference(self, t_ns: int) -> FilterReference | None:
        """Reference for the comparison of devices; None if there is none."""

    @property
    def refused(self) -> frozenset[str]:
        """Devices whose positions are excluded."""

    @property
    def refused_heights(self) -> frozenset[str]:
        """Devices whose altitudes are excluded."""


class Navigation:
    """The roles ``nav.attitude`` and ``nav.position``: the first device in order of preference with a valid value.

    fallback : used if no device has one; sources are then FILTER or RADIO, and VERTICAL for the altitude only
    assumed  : sigmas of positions that state none, by device [m]
    """

    def __init__(
        self,
        attitude: Sequence[NavSource],
        position: Sequence[NavSource],
        fallback: Fallback | None = None,
        assumed: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    ) -> None:
        self._attitude = attitude
        self._position = position
        self._fallback = fallback
        self._assumed = assumed
        self._check = SourceCheck(assumed)
        self._reported: dict[str, str | None] = {"attitude": None, "position": None}
        self._is_vertical_alone = False  # only the altitude is from the vertical channel
        self._held_by: tuple[str, ...] = ()
        self._after_gap = False
        self._quiet_until_ns = 0

    def reset_after_gap(self) -> None:
        """The input has a gap that is not caused by the sources: do not report their silence."""
        self._after_gap = True

    def at(self, t_ns: int) -> NavState:
        """The state at t_ns."""
        attitude, attitude_source = self._find_attitude(t_ns)
        position, position_source = self._find_position(t_ns, attitude)
        altitude_source = position_source if position and position.alt is not None else None
        if self._fallback and position and position.alt is None and (found := self._fallback.altitude(t_ns)):
            down = position.down if found.climb is None else -found.climb
            position = replace(position, alt=found.alt, vertical_sd=found.alt_sd, down=down)
            altitude_source = VERTICAL
        holders = self._fallback.altitude_holders(altitude_source) if self._fallback else ()
        return NavState(t_ns, attitude, position, attitude_source, position_source, altitude_source, holders)

    def _find_attitude(self, t_ns: int) -> tuple[AttitudeState | None, str | None]:
        for source in self._attitude:
            if found := source.attitude(t_ns):
                return found, source.name
        if self._fallback and (found := self._fallback.attitude(t_ns)):
            return found, FILTER
        return None, None

    def _find_position(self, t_ns: int, attitude: AttitudeState | None) -> tuple[PositionState | None, str | None]:
        """A position with altitude from a device or the fallback, else the first horizontal one."""
        flat: tuple[PositionState | None, str | None] = (None, None)
        refused, without_height = self.refused, self._fallback.refused_heights if self._fallback else frozenset()
        for source in self._position:
            found = source.position(t_ns, attitude) if source.name not in refused else None
            if found and source.name in without_height:
                found = replace(found, alt=None, vertical_sd=None)
            if found and found.alt is not None:
                return found, source.name
            if found and flat[0] is None:
                flat = found, source.name
        if self._fallback and (whole := self._fallback.position(t_ns)):
            return whole
        return flat

    @property
    def refused(self) -> frozenset[str]:
        """Devices of ``nav.position`` that are not used because they contradict others."""
        return self._check.refused | (self._fallback.refused if self._fallback else frozenset())

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Refusals in force by the comparison with the filter."""
        return self._check.refusals

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> list[Event]:
        """Start with refusals from before this process."""
        return self._check.restore(refusals, t_ns)

    def readmit(self, device: str, t_ns: int) -> list[Event]:
        """Use a device again that the filter contradicts, on the operator's command."""
        return self._check.readmit(device, t_ns)

    def compare(self, state: NavState) -> list[Event]:
        """Compare devices that do not aid the filter with it; an event for each that is refused or used again."""
        reference = self._fallback.filter_reference(state.t_ns) if self._fallback else None
        if reference is None:
            return []
        others = [source for source in self._position if source.name not in reference.aided_by]
        positions = {source.name: source.position(state.t_ns, state.attitude) for source in others}
        known = {name: position for name, position in positions.items() if position is not None}
        return self._check.update(state.t_ns, known, reference)

    def protection(self, state: NavState) -> Protection:
        """Protection levels of the position of a state."""
        if state.position is None:
            return Protection(None, None)
        reference = self._fallback.filter_reference(state.t_ns) if self._fallback else None
        if reference is not None:
            return compare_with_filter(state.position, reference)
        return stated_levels(state.position, self._assumed.get(state.position_source or "", UNKNOWN_SD))

    def changes(self, state: NavState) -> list[Event]:
        """An event for every role whose source has changed since the last call."""
        if self._after_gap:
            self._after_gap, self._quiet_until_ns = False, state.t_ns + SETTLE_NS
        if state.t_ns < self._quiet_until_ns:
            return []
        current = {"attitude": state.attitude_source, "position": state.position_source}
        events = [
            _event(state.t_ns, role, self._reported[role], current[role])
            for role in current
            if current[role] != self._reported[role]
        ]
        self._reported = current
        is_alone = state.altitude_source == VERTICAL
        if is_alone != self._is_vertical_alone:
            events.append(_altitude_event(state.t_ns, is_alone))
            self._is_vertical_alone = is_alone
        if state.altitude_holders != self._held_by:
            events.append(_hold_event(state.t_ns, state.altitude_holders))
            self._held_by = state.altitude_holders
        return events


def _event(t_ns: int, role: str, previous: str | None, current: str | None) -> Event:
    if current is None:
        return Event(t_ns=t_ns, level="warning", source="nav", text=f"{role}: no source; {previous} went away")
    if previous is None:
        return Event(t_ns=t_ns, level="info", source="nav", text=f"{role}: from {current}")
    return Event(t_ns=t_ns, level="warning", source="nav", text=f"{role}: from {current} instead of {previous}")


def _altitude_event(t_ns: int, is_alone: bool) -> Event:
    text = "altitude: from the vertical channel" if is_alone else "altitude: not from the vertical channel any more"
    return Event(t_ns=t_ns, level="warning" if is_alone else "info", source="nav", text=text)


def _hold_event(t_ns: int, altimeters: tuple[str, ...]) -> Event:
    if not altimeters:
        text = "altitude: not held by altimeters alone any more"
        return Event(t_ns=t_ns, level="info", source="nav", text=text)
    whose = "its heights" if len(altimeters) == 1 else "all of them"
    text = f"altitude: held by {' and '.join(altimeters)} alone; a slow drift of {whose} is not detected"
    return Event(t_ns=t_ns, level="warning", source="nav", text=text)


def solution(
    state: NavState, protection: Protection, tilted: AttitudeLevels, limits: AlertLimits, refused: frozenset[str]
) -> NavSolution:
    """The state as an output: valid if position, height, velocity and attitude are known within their limits.

    protection, tilted : protection levels of the position and of the attitude
    """
    position, attitude = state.position, state.attitude
    of_attitude = tilted.reasons(limits)
    reasons = tuple(dict.fromkeys((*_of_position(state, protection, limits), *of_attitude)))
    return NavSolution(
        t_ns=state.t_ns,
        t_valid_ns=state.t_ns if position or attitude else None,
        valid=not reasons,
        reasons=reasons,
        position_source=state.position_source,
        attitude_source=state.attitude_source,
        altitude_source=state.altitude_source,
        lat=position.lat if position else None,
        lon=position.lon if position else None,
        alt=position.alt if position else None,
        horizontal_sd=position.horizontal_sd if position else None,
        vertical_sd=position.vertical_sd if position else None,
        vel_north=position.north if position else None,
        vel_east=position.east if position else None,
        vel_down=position.down if position else None,
        roll=attitude.roll if attitude else None,
        pitch=attitude.pitch if attitude else None,
        heading=attitude.heading if attitude else None,
        hpl=protection.horizontal if position else None,
        vpl=protection.vertical if position and position.alt is not None else None,
        unchecked=protection.unchecked if position else (),
        refused=tuple(sorted(refused)),
        tilt_pl=tilted.tilt,
        heading_pl=tilted.heading,
        attitude_valid=not of_attitude,
        attitude_reasons=of_attitude,
        attitude_unchecked=tilted.unchecked,
    )


def _of_position(state: NavState, protection: Protection, limits: AlertLimits) -> tuple[Reason, ...]:
    """Reasons why position, altitude or velocity are not valid."""
    position = state.position
    is_alone = limits.compared and Reason.NOTHING_TO_COMPARE in protection.unchecked
    table = (
        (Reason.NO_POSITION, position is None),
        (Reason.NO_ALTITUDE, position is not None and position.alt is None),
        (Reason.NO_VELOCITY, position is not None and (position.north is None or position.down is None)),
        (Reason.PROTECTION_LEVEL, is_beyond(protection, limits)),
        (Reason.NOTHING_TO_COMPARE, is_alone),
    )
    return tuple(reason for reason, holds in table if holds)
