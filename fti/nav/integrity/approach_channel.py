"""Approach monitoring in the pipeline: one altimeter and navigation to ClearanceIntegrity and GlideSlope."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from msgspec import structs

from fti.config import Approach, Config, Device
from fti.messages.outputs import ClearanceIntegrity, Event, GlideSlope, HeightAboveGround, IntegrityState
from fti.messages.reasons import Reason
from fti.nav.altimetry.altimeter_channel import is_monitorable
from fti.nav.integrity.assumptions import receiver_holds
from fti.nav.integrity.glide_slope import PathPosition, glide_slope, mean_deviation
from fti.nav.integrity.monitor import REPEAT_NS, ClearanceMonitor, ClearanceSample
from fti.nav.integrity.reference import ApproachReference, check_settings, fits
from fti.nav.navigation import FILTER, RADIO, VERTICAL, NavState
from fti.nav.protection import unstated_sigmas
from fti.nav.source_interpolation import PositionState

#: For a source without a stated or configured sigma.
NO_SIGMA = (None, None)
NO_SIGMAS: Mapping[str, tuple[float, float]] = MappingProxyType({})

Outputs = list[ClearanceIntegrity | GlideSlope | Event]


class IdleChannel:
    """Replaces the monitor without an approach or a matching altimeter: reports its state twice a second."""

    def __init__(self, state: IntegrityState, reason: Reason, reference: str | None) -> None:
        self._state, self._reason, self._reference = state, reason, reference
        self._reported_ns: int | None = None

    def set_protection_level(self, hpl: float | None) -> None:
        """Unused: nothing is monitored."""

    def feed(self, height: HeightAboveGround, nav: NavState) -> Outputs:
        """No output."""
        return []

    def tick(self, t_ns: int, nav: NavState) -> Outputs:
        """The state, twice a second."""
        if self._reported_ns is not None and t_ns - self._reported_ns < REPEAT_NS:
            return []
        self._reported_ns = t_ns
        reasons = (self._reason,)
        integrity = ClearanceIntegrity(
            t_ns=t_ns, t_valid_ns=None, state=self._state, reasons=reasons, valid=False, reference=self._reference
        )
        return [integrity, GlideSlope(t_ns=t_ns, t_valid_ns=None, valid=False, reasons=reasons)]


class ApproachChannel:
    """Feeds the monitor with the heights of one altimeter.

    sensor   : the name of that altimeter
    held     : altitude sources that this altimeter itself aids over known ground: with such an altitude it measures
               that ground by definition, so nothing is evaluated
    unstated : sigmas of a position that states none [m], by source
    """

    def __init__(
        self,
        reference: ApproachReference,
        settings: Approach,
        sensor: str,
        held: frozenset[str] = frozenset(),
        unstated: Mapping[str, tuple[float, float]] = NO_SIGMAS,
    ) -> None:
        self._monitor = ClearanceMonitor(reference, settings)
        self._sensor = sensor
        self._held = held
        self._unstated = unstated
        self._reported = set[tuple[str, int]]()
        self._sources: tuple[str, str] | None = None
        self._slope: GlideSlope | None = None
        self._hpl: float | None = None

    def set_protection_level(self, hpl: float | None) -> None:
        """Set the horizontal protection level of the navigated position [m]; None: unknown."""
        self._hpl = hpl

    def feed(self, height: HeightAboveGround, nav: NavState) -> Outputs:
        """Add an output of an altimeter with the navigation at its time; returns new outputs."""
        if height.sensor != self._sensor:
            return []
        self._follow_sources(nav)
        place = self._place(nav)
        held = nav.altitude_source in self._held
        sample = None if held else self._sample(height, nav, place)
        if sample is None:
            if place is not None:
                self._monitor.follow(place.s)
            reasons = height.reasons + _missing(nav) + ((Reason.NOT_INDEPENDENT,) if held else ())
            return self._with_slope(self._monitor.refuse(height.t_ns, height.t_valid_ns, reasons), place)
        return [*self._report_unstated(height.t_ns, nav), *self._with_slope(self._monitor.step(sample), place)]

    def _report_unstated(self, t_ns: int, nav: NavState) -> list[Event]:
        """Report once for each source and axis which sigma is used because none is stated."""
        position = nav.position
        if position is None:
            return []
        axes = (
            (nav.position_source, "position", position.horizontal_sd, 0),
            (nav.altitude_source, "altitude", position.vertical_sd, 1),
        )
        events = list[Event]()
        for source, what, stated, axis in axes:
            if source is None or source not in self._unstated or (source, axis) in self._reported:
                continue
            if _stated(stated, None) is not None:
                continue
            self._reported.add((source, axis))
            sd = self._unstated[source][axis]
            text = f"states no sigma of its {what}; {sd:g} m count for the approach (nav.unstated_sd)"
            events.append(Event(t_ns=t_ns, level="info", source=source, text=text))
        return events

    def tick(self, t_ns: int, nav: NavState) -> Outputs:
        """Repeat outputs that are half a second old."""
        repeated = self._monitor.tick(t_ns)
        if repeated is None or self._slope is None:
            return []
        if self._monitor.bins is None:
            return self._with_slope(repeated, self._place(nav))
        return [repeated, structs.replace(self._slope, t_ns=t_ns)]

    def _follow_sources(self, nav: NavState) -> None:
        """Restart the window when the source of position or altitude changes, because its errors do."""
        if nav.position_source is None or nav.altitude_source is None:
            return
        sources = nav.position_source, nav.altitude_source
        if self._sources not in (None, sources):
            self._monitor.restart()
        self._sources = sources

    def _place(self, nav: NavState) -> PathPosition | None:
        position = nav.position
        if position is None or position.alt is None:
            return None
        return PathPosition(*self._monitor.path.to_path_one(position.lat, position.lon), position.alt)

    def _sample(self, height: HeightAboveGround, nav: NavState, place: PathPosition | None) -> ClearanceSample | None:
        attitude, position = nav.attitude, nav.position
        if not is_monitorable(height) or height.nearest is None or height.t_valid_ns is None:
            return None
        if place is None or position is None or attitude is None:
            return None
        horizontal_sd, vertical_sd = self._sigmas(nav, position)
        return ClearanceSample(
            t_ns=height.t_ns,
            t_valid_ns=height.t_valid_ns,
            s=place.s,
            y=place.y,
            alt=place.alt,
            agl=height.nearest,
            roll=attitude.roll - self._monitor.path.bank_one(place.s),
            pitch=attitude.pitch,
            climb=-position.down if position.down is not None else None,
            vertical_sd=vertical_sd,
            horizontal_sd=horizontal_sd,
            hpl=self._hpl,
        )

    def _sigmas(self, nav: NavState, position: PositionState) -> tuple[float | None, float | None]:
        """Horizontal and vertical sigma [m]: as stated, else as configured for the kind of source.

        A stated sigma that is not a positive number counts as missing.
        """
        level, _ = self._unstated.get(nav.position_source or "", NO_SIGMA)
        _, high = self._unstated.get(nav.altitude_source or "", NO_SIGMA)
        return _stated(position.horizontal_sd, level), _stated(position.vertical_sd, high)

    def _with_slope(self, integrity: ClearanceIntegrity | None, place: PathPosition | None) -> Outputs:
        if integrity is None:
            return []
        bins = self._monitor.bins
        height = mean_deviation(bins, self._monitor.reference) if bins else None
        self._slope = glide_slope(integrity, self._monitor.path, place, height)
        return [integrity, self._slope]


def make_channel(config: Config, reference: ApproachReference | None) -> ApproachChannel | IdleChannel:
    """The channel that configuration and reference allow.

    Raises ConfigError when they contradict each other (``check_settings``).
    """
    settings = config.nav.approach
    if reference is None or settings is None:
        return IdleChannel(IntegrityState.NO_PROFILE, Reason.NO_PROFILE, None)
    check_settings(reference, settings, config.path)
    fitting = _fitting(config, reference)
    if not fitting:
        reason = idle_reason(config, reference) or Reason.NO_ALTIMETER
        return IdleChannel(IntegrityState.UNAVAILABLE, reason, reference.hash)
    return ApproachChannel(
        reference, settings, fitting[0], _altitude_sources_held(config, fitting[0]), unstated_sigmas(config)
    )


def idle_reason(config: Config, reference: ApproachReference) -> Reason | None:
    """Why no altimeter of navigation matches a reference; None: one does."""
    if _fitting(config, reference):
        return None
    header, devices = reference.header, _altimeters(config)
    if any(fits(device, header.sensor, header.assumptions) for device in devices):
        return Reason.ASSUMPTION
    return Reason.WRONG_SENSOR if devices else Reason.NO_ALTIMETER


def _altimeters(config: Config) -> list[Device]:
    return [device for name in config.nav.altimeters if (device := config.find_device(name))]


def _fitting(config: Config, reference: ApproachReference) -> list[str]:
    """The altimeters of the reference's kind that meet its assumptions, in order of preference."""
    header = reference.header
    return [
        device.name
        for device in _altimeters(config)
        if fits(device, header.sensor, header.assumptions) and receiver_holds(header.assumptions, device)
    ]


def _stated(sd: float | None, otherwise: float | None) -> float | None:
    return sd if sd is not None and 0.0 < sd < math.inf else otherwise


def _altitude_sources_held(config: Config, altimeter: str) -> frozenset[str]:
    """The altitude sources that this altimeter may aid."""
    own, radio = config.nav.filter, config.nav.radio
    held = {FILTER, VERTICAL} if own and altimeter in own.altimeters else set[str]()
    return frozenset(held | ({RADIO} if radio and radio.altimeter == altimeter else set()))


def _missing(nav: NavState) -> tuple[Reason, ...]:
    if nav.position is None:
        return (Reason.NO_POSITION,)
    return (Reason.NO_ALTITUDE,) if nav.position.alt is None else ()
