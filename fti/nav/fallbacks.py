"""Fallbacks for missing devices, in order: the filter, the radio fix; for the altitude only the vertical channel.

Each exists if it is configured (``[nav.filter]``, ``[nav.radio]``), receives every measurement, and gives outputs at
its own rate, whether they are used or not.  Positions from the ground (``[nav.terrain_position]``) aid the filter: they
are used before the radio fix.  Drifts over the ground (``[nav.scan_drift]``) aid it, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from fti.config import Config
from fti.messages.measurements import BeamRange, Measurement
from fti.messages.outputs import Event, HeightAboveGround, Output
from fti.messages.refusals import CarriedRefusal
from fti.nav.confirmation import Confirmation, Size
from fti.nav.ground_drift import GroundDriftAiding
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.navigation import FILTER, RADIO, VERTICAL, NavState
from fti.nav.plausibility.source import UnconfirmedSource
from fti.nav.protection import FilterReference
from fti.nav.radio_positioning import RadioPosition
from fti.nav.source_interpolation import AttitudeState, PositionState
from fti.nav.terrain_methods import TerrainObserver
from fti.nav.terrain_positioning import TerrainPosition
from fti.nav.terrain_reference import Ground
from fti.nav.vertical.vertical_channel import VerticalState

#: Ticks of 20 ms between outputs.
FILTER_TICKS, VERTICAL_TICKS, FIX_TICKS = 10, 10, 25


class Fallbacks:
    """All configured fallbacks.  observer : of the filter and of the position from the ground"""

    def __init__(self, config: Config, observer: TerrainObserver | None = None) -> None:
        nav, devices = config.nav, {device.name: device for device in config.device}
        ground = nav.terrain_position
        map_sd, scans = ground.map_sd_m if ground else None, nav.scan_drift
        self._aided = AidedNavigation(nav.filter, devices, map_sd, scans) if nav.filter else None
        self._observer = observer
        self._ground = TerrainPosition(ground, devices, self._aided, observer) if ground and self._aided else None
        self._drift = GroundDriftAiding(scans, devices, self._aided) if scans and self._aided else None
        self._radio = RadioPosition(nav.radio, devices) if nav.radio else None
        self._ticks = 0

    def set_terrain(self, ground: Ground | None) -> None:
        """Set the known ground."""
        for part in (self._aided, self._ground, self._radio, self._observer):
            if part:
                part.set_terrain(ground)

    def handlers(self, device: str, kind: type[Measurement]) -> list[Callable[[Any, int], None]]:
        """Handlers of measurements of a kind of a device; they take a measurement and its time of validity."""
        parts = (self._aided, self._drift, self._radio, self._observer)
        return [partial(part.feed, device) for part in parts if part and part.accepts(device, kind)]

    def feed_unconfirmed(self, device: str, m: Measurement, unconfirmed: UnconfirmedSource, t_ns: int) -> None:
        """Take a measurement of an unconfirmed source: it aids a provisional filter only."""
        if self._aided:
            self._aided.feed_unconfirmed(device, m, unconfirmed, t_ns)

    def feed_height(self, height: HeightAboveGround, nav: NavState) -> None:
        """Take an output of an altimeter."""
        aids_altitude = self._aided is not None and self._aided.feed_height(height, nav)
        if self._ground and not aids_altitude:
            self._ground.feed_height(height, nav)
        if self._radio:
            self._radio.feed_height(height, nav)
        if self._observer:
            self._observer.feed_height(height, nav)

    def takes_beams(self, device: str, kind: type[Measurement]) -> bool:
        """Whether measurements of a kind of a device are beams for the position from the ground."""
        return self._ground is not None and self._ground.accepts(device, kind)

    def feed_beam(self, beam: BeamRange, t_ns: int, state_at: Callable[[int], NavState]) -> None:
        """Take a range of a multi-beam altimeter, valid at t_ns.  state_at : navigation at a time"""
        if self._ground:
            self._ground.feed_beam(beam, t_ns, state_at)

    def is_excluded(self, altimeter: str) -> bool:
        """Whether the filter excludes an altimeter from aiding."""
        return self._aided is not None and self._aided.is_excluded(altimeter)

    def tick(self, t_ns: int, nav: NavState, find_suspects: Callable[[], frozenset[str]]) -> list[Output | Event]:
        """Outputs that are due at a tick.  nav : the state then;  find_suspects : receivers that their tests suspect"""
        self._ticks += 1
        if self._aided:
            self._aided.set_nav_state(nav)
        out: list[Output | Event] = []
        if self._aided and self._ground:
            out += self._ground.tick(t_ns)
            self._aided.set_ground_contradicting(self._ground.is_contradicting)
        if self._drift:
            out += self._drift.tick(t_ns)
        if self._aided and self._ticks % FILTER_TICKS == 0:
            self._aided.set_suspects(find_suspects())
            out += [*self._aided.events(t_ns), self._aided.solution(t_ns), *self._aided.provisional_solutions(t_ns)]
        if self._aided and self._ticks % VERTICAL_TICKS == 0:
            out.append(self._aided.vertical_solution(t_ns))
        if self._radio and self._ticks % FIX_TICKS == 0:
            self._radio.refuse(self.refused)
            out.append(self._radio.solution(t_ns))
        if self._observer:
            self._observer.tick(t_ns)
        return out

    def position(self, t_ns: int) -> tuple[PositionState, str] | None:
        """A position and its source."""
        if self._aided and (position := self._aided.position(t_ns)):
            return position, FILTER
        if self._radio and (position := self._radio.position(t_ns)):
            return position, RADIO
        return None

    def attitude(self, t_ns: int) -> AttitudeState | None:
        """Of the filter."""
        return self._aided.attitude(t_ns) if self._aided else None

    def altitude(self, t_ns: int) -> VerticalState | None:
        """Of the vertical channel."""
        return self._aided.altitude(t_ns) if self._aided else None

    def filter_reference(self, t_ns: int) -> FilterReference | None:
        """The filter and its protection levels; None if it has no position."""
        return self._aided.filter_reference(t_ns) if self._aided else None

    @property
    def refused(self) -> frozenset[str]:
        """Receivers that the filter excludes."""
        return self._aided.refused if self._aided else frozenset()

    @property
    def refused_heights(self) -> frozenset[str]:
        """Receivers whose heights the filter excludes."""
        return self._aided.refused_heights if self._aided else frozenset()

    def readmit(self, device: str, t_ns: int) -> None:
        """Let a receiver aid the filter again on the operator's command."""
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

    def confirm(self, confirmation: Confirmation, t_ns: int) -> None:
        """An independent source agrees with a receiver that does not aid the filter."""
        if self._aided:
            self._aided.confirm(confirmation, t_ns)

    def fix(self, t_ns: int) -> PositionState | None:
        """By radio."""
        return self._radio.position(t_ns) if self._radio else None

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> None:
        """Start with refusals from before this process."""
        if self._aided:
            self._aided.restore(refusals, t_ns)

    def altitude_holders(self, source: str | None) -> tuple[str, ...]:
        """Altimeters that alone bound the altitude of the filter, of the vertical channel or of the fix."""
        if self._aided and source in {FILTER, VERTICAL}:
            return self._aided.vertical_holders if source == VERTICAL else self._aided.filter_holders
        return self._radio.altitude_holders if self._radio and source == RADIO else ()
