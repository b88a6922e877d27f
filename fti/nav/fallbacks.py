"""What takes the place of devices, in order: the filter, the fix by radio; for an altitude alone the vertical channel.

Each is there when it is configured (``[nav.filter]``, ``[nav.radio]``), sees every measurement, and says at its own
rate what it has found, needed or not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from fti.config import Config
from fti.nav.carried_refusal import CarriedRefusal
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.navigation import FILTER, RADIO, VERTICAL, NavState
from fti.nav.plausibility.source import UnconfirmedSource
from fti.nav.protection import FilterReference
from fti.nav.radio_positioning import RadioPosition
from fti.nav.source_interpolation import AttitudeState, PositionState
from fti.nav.terrain_reference import Ground
from fti.nav.vertical.vertical_channel import VerticalState
from fti.nav.witnesses import Confirmation, Size
from fti.types import Event, HeightAboveGround, Measurement, Output

#: Ticks of 20 ms between outputs.
FILTER_TICKS, VERTICAL_TICKS, FIX_TICKS = 10, 10, 25


class Fallbacks:
    """All that are configured."""

    def __init__(self, config: Config) -> None:
        nav, devices = config.nav, {device.name: device for device in config.device}
        self._aided = AidedNavigation(nav.filter, devices) if nav.filter else None
        self._radio = RadioPosition(nav.radio, devices) if nav.radio else None
        self._ticks = 0

    def set_terrain(self, ground: Ground | None) -> None:
        """The known ground is there from now on."""
        for part in (self._aided, self._radio):
            if part:
                part.set_terrain(ground)

    def handlers(self, device: str, kind: type[Measurement]) -> list[Callable[[Any, int], None]]:
        """What takes measurements of a kind of a device, each with the time at which it was true."""
        parts = [part for part in (self._aided, self._radio) if part and part.wants(device, kind)]
        return [partial(part.feed, device) for part in parts]

    def feed_unconfirmed(self, device: str, m: Measurement, what: UnconfirmedSource, t_ns: int) -> None:
        """Take a measurement of a source that is unconfirmed: it aids a provisional filter alone."""
        if self._aided:
            self._aided.feed_unconfirmed(device, m, what, t_ns)

    def feed_height(self, height: HeightAboveGround, nav: NavState) -> None:
        """Take an output of an altimeter."""
        for part in (self._aided, self._radio):
            if part:
                part.feed_height(height, nav)

    def is_excluded(self, altimeter: str) -> bool:
        """Whether the filter excludes an altimeter from aiding."""
        return self._aided is not None and self._aided.is_excluded(altimeter)

    def set_suspects(self, devices: frozenset[str]) -> None:
        """Receivers that tests of one source suspect from now on."""
        if self._aided:
            self._aided.set_suspects(devices)

    def tick(self, t_ns: int, nav: NavState) -> list[Output | Event]:
        """What is due at a tick.  nav : what is known then"""
        self._ticks += 1
        if self._aided:
            self._aided.note(nav)
        out: list[Output | Event] = []
        if self._aided and self._ticks % FILTER_TICKS == 0:
            out += [*self._aided.events(t_ns), self._aided.solution(t_ns), *self._aided.provisional_solutions(t_ns)]
        if self._aided and self._ticks % VERTICAL_TICKS == 0:
            out.append(self._aided.vertical_solution(t_ns))
        if self._radio and self._ticks % FIX_TICKS == 0:
            self._radio.refuse(self.refused)
            out.append(self._radio.solution(t_ns))
        return out

    def position(self, t_ns: int) -> tuple[PositionState, str] | None:
        """A position and whose it is."""
        if self._aided and (found := self._aided.position(t_ns)):
            return found, FILTER
        if self._radio and (found := self._radio.position(t_ns)):
            return found, RADIO
        return None

    def attitude(self, t_ns: int) -> AttitudeState | None:
        """Of the filter."""
        return self._aided.attitude(t_ns) if self._aided else None

    def altitude(self, t_ns: int) -> VerticalState | None:
        """Of the vertical channel."""
        return self._aided.altitude(t_ns) if self._aided else None

    def compared(self, t_ns: int) -> FilterReference | None:
        """The filter and its protection levels; None where it has no position."""
        return self._aided.compared(t_ns) if self._aided else None

    @property
    def refused(self) -> frozenset[str]:
        """Receivers that the filter excludes."""
        return self._aided.refused if self._aided else frozenset()

    @property
    def refused_heights(self) -> frozenset[str]:
        """Receivers whose heights the filter excludes."""
        return self._aided.refused_heights if self._aided else frozenset()

    def readmit(self, device: str, t_ns: int) -> None:
        """Let a receiver aid the filter again because the operator commands it."""
        if self._aided:
            self._aided.readmit(device, t_ns)

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Of the filter, in force."""
        return self._aided.refusals if self._aided else []

    @property
    def contradiction_sizes(self) -> dict[str, Size]:
        """Contradictions of receivers that do not aid the filter, by device."""
        return self._aided.contradiction_sizes if self._aided else {}

    def confirm(self, found: Confirmation, t_ns: int) -> None:
        """An independent source agrees with a receiver that does not aid the filter."""
        if self._aided:
            self._aided.confirm(found, t_ns)

    def fix(self, t_ns: int) -> PositionState | None:
        """By radio."""
        return self._radio.position(t_ns) if self._radio else None

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> None:
        """Begin with refusals of before this process."""
        if self._aided:
            self._aided.restore(refusals, t_ns)

    def altitude_holders(self, source: str | None) -> tuple[str, ...]:
        """Altimeters that alone hold the altitude of the filter, of the vertical channel or of the fix."""
        if self._aided and source in {FILTER, VERTICAL}:
            return self._aided.vertical_holders if source == VERTICAL else self._aided.filter_holders
        return self._radio.altitude_holders if self._radio and source == RADIO else ()
