"""The live pipeline: measurements and ticks in, outputs and events out.

Pure and deterministic: its only time is that of stamps and ticks, and it takes its inputs in the order of ``seq``.
Stamps of different links may be out of order by milliseconds; every history is ordered by ``t_valid_ns``.

    t_valid_ns : by the known clock of the device (``fti.nav.device_time.device_times``), else t_rx_ns - latency

Rates: HeightAboveGround per sample; HeightBelowAircraft per sample of the chosen altimeter; NavSolution every second
tick (25 Hz), extrapolated to the time of the tick; fallbacks by ``fti.nav.fallbacks``; ClearanceIntegrity and
GlideSlope per update of the monitor.  Outputs without new values are repeated at 2 Hz.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from fti.config import Config
from fti.constants import SECOND_NS
from fti.messages.measurements import Attitude, Measurement, Position, RadioHeight, Range, Velocity
from fti.messages.outputs import Event, FilterSolution, HeightAboveGround, Output
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal
from fti.nav.altimetry.agreement import AgreementCheck
from fti.nav.altimetry.altimeter_channel import AltimeterChannel
from fti.nav.altimetry.ground_check import GroundCheck
from fti.nav.altimetry.refusals import RefusalEvents
from fti.nav.altimetry.selection import HeightSelector
from fti.nav.attitude_protection import AttitudeProtection
from fti.nav.confirmation import ConfirmationMonitor, Size
from fti.nav.integrity.approach_channel import make_channel
from fti.nav.integrity.reference import ApproachReference
from fti.nav.navigation import Navigation, NavState, solution
from fti.nav.plausibility.monitor import PlausibilityMonitor
from fti.nav.protection import Protection, extrapolate_levels, unstated_sigmas
from fti.nav.source_interpolation import NavSource
from fti.nav.terrain_reference import Ground

if TYPE_CHECKING:
    from fti.nav.fallbacks import Fallbacks
    from fti.nav.terrain_methods import TerrainObserver

#: Ticks of 20 ms between outputs; protection levels change in seconds.
SOLUTION_TICKS, PROTECTION_TICKS = 2, 10
#: Takes a measurement and its time of validity; returns immediate outputs.
MeasurementHandler = Callable[[Any, int], list[Output | Event] | None]


class Pipeline:
    """Joins the measurements of all devices.

    reference : the published approach, or None;  observer : of the filter and of the position from the ground
    """

    def __init__(
        self, config: Config, reference: ApproachReference | None, observer: TerrainObserver | None = None
    ) -> None:
        devices = {device.name: device for device in config.device}
        self._latency_ns = {name: round(device.latency_ms * 1e6) for name, device in devices.items()}
        roles = config.nav
        self._sources = {name: NavSource(devices[name]) for name in dict.fromkeys((*roles.attitude, *roles.position))}
        unchecked = Reason.TERRAIN_LOADING if roles.terrain else Reason.NO_TERRAIN
        self._altimeters = {
            name: AltimeterChannel(devices[name], unchecked, roles.wheels_b) for name in roles.altimeters
        }
        limits = {name: channel.limits for name, channel in self._altimeters.items()}
        self._agreement, self._ground_check = AgreementCheck(limits), GroundCheck(limits)
        self._refusals = RefusalEvents()
        self._selector = HeightSelector(roles.altimeters)
        self._fallbacks = _fallbacks(config, observer)
        self._navigation = Navigation(
            [self._sources[name] for name in roles.attitude],
            [self._sources[name] for name in roles.position],
            self._fallbacks,
            unstated_sigmas(config),
        )
        self._limits = roles.alert_limits
        self._protection = Protection(None, None)
        self._protection_state = NavState(0, None, None, None, None, None)  # the state that the levels belong to
        self._attitude_protection = AttitudeProtection(config, self._sources)
        self._plausibility = PlausibilityMonitor(config)
        self._confirmation = ConfirmationMonitor(config, unstated_sigmas(config))
        self._approach = make_channel(config, reference)
        self._ticks = 0
        self._handlers: dict[tuple[str, type[Measurement]], tuple[MeasurementHandler, ...]] = {}

    def set_terrain(self, ground: Ground | None) -> None:
        """Set the known ground; None: there is none."""
        for channel in self._altimeters.values():
            channel.set_terrain(ground)
        if self._fallbacks:
            self._fallbacks.set_terrain(ground)

    def feed(self, device: str, m: Measurement) -> list[Output | Event]:
        """Take one measurement of a device; without a time of validity, its arrival is used."""
        handlers = self._handlers.get((device, type(m)))
        if handlers is None:
            handlers = self._handlers[device, type(m)] = self._find_handlers(device, type(m))
        if not handlers:  # half of all measurements
            return []
        t_valid_ns = m.stamp.t_valid_ns
        if t_valid_ns is None:
            t_valid_ns = m.stamp.t_rx_ns - self._latency_ns.get(device, 0)
        out: list[Output | Event] = []
        for handle in handlers:
            out += handle(m, t_valid_ns) or ()
        return out

    def readmit(self, device: str, t_ns: int) -> list[Event]:
        """Readmit a source of position, confirmed by the operator, that contradicts itself or others.  Raises KeyError.

        The filter reports it with its next output.
        """
        events = [*self._plausibility.readmit(device, t_ns), *self._navigation.readmit(device, t_ns)]
        if self._fallbacks:
            self._fallbacks.readmit(device, t_ns)
        return events

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Refusals of sources in force; the next pipeline starts with them (``restore``)."""
        filtered = self._fallbacks.refusals if self._fallbacks else []
        return [*self._plausibility.refusals, *self._navigation.refusals, *filtered]

    def restore(self, refusals: Sequence[CarriedRefusal], t_ns: int) -> list[Event]:
        """Start with refusals of another process.  The filter reports its own with its next output."""
        if self._fallbacks:
            self._fallbacks.restore(refusals, t_ns)
        return [*self._plausibility.restore(refusals, t_ns), *self._navigation.restore(refusals, t_ns)]

    def _find_handlers(self, device: str, kind: type[Measurement]) -> tuple[MeasurementHandler, ...]:
        """Handlers of measurements of this kind of a device, in order; cached, because most have none."""
        if issubclass(kind, (RadioHeight, Range)):
            channel = self._altimeters.get(device)
            return (partial(self._feed_altimeter, channel),) if channel else ()
        if self._fallbacks and self._fallbacks.takes_beams(device, kind):
            return (partial(self._fallbacks.feed_beam, state_at=self._navigation.at),)
        source, handlers = self._sources.get(device), list[MeasurementHandler]()
        if self._fallbacks:
            handlers += self._fallbacks.handlers(device, kind)
        if self._plausibility.watches_signals(device, kind):
            handlers.append(partial(self._plausibility.feed_signals, device))
        if self._plausibility.watches_ranges(device, kind):
            handlers.append(partial(self._plausibility.feed_ranges, device))
        if source and issubclass(kind, Attitude):
            handlers.append(source.push_attitude)
        elif source and issubclass(kind, Position):
            handlers.append(source.push_position)
        elif source and issubclass(kind, Velocity):
            handlers.append(source.push_velocity)
        if handlers and self._plausibility.accepts(device, kind):
            return (partial(self._feed_tested, device, tuple(handlers)),)
        return tuple(handlers)

    def _feed_tested(
        self, device: str, handlers: tuple[MeasurementHandler, ...], m: Measurement, t_valid_ns: int
    ) -> list[Output | Event]:
        """Pass the parts of a measurement that the tests of one source admit to all handlers."""
        out: list[Output | Event] = []
        passed = self._plausibility.check(device, m, t_valid_ns)
        if self._confirmation.is_useful:
            self._confirmation.feed(device, m, passed, t_valid_ns)
        if self._fallbacks and (unconfirmed := self._plausibility.find_unconfirmed(device)):
            self._fallbacks.feed_unconfirmed(device, m, unconfirmed, t_valid_ns)
        for admitted in passed:
            for handle in handlers:
                out += handle(admitted, t_valid_ns) or ()
        out += self._plausibility.drain_events()
        return out

    def _confirm(self, nav: NavState) -> list[Event]:
        """Readmit receivers with a lasting contradiction with which an independent source agrees."""
        if not self._confirmation.is_useful:
            return []
        filtered = self._fallbacks
        sizes = {name: Size(size) for name, size in self._plausibility.contradiction_sizes.items()}
        sizes |= filtered.contradiction_sizes if filtered else {}
        refused = {refusal.source: refusal.is_standing for refusal in self._plausibility.refusals}
        sizes = {name: size for name, size in sizes.items() if refused.get(name, True)}
        reference = filtered.filter_reference(nav.t_ns) if filtered and sizes else None
        fix = filtered.fix(nav.t_ns) if filtered and sizes and self._confirmation.has_dme_fix else None
        events = list[Event]()
        for confirmation in self._confirmation.update(nav.t_ns, sizes, nav.attitude, reference, fix):
            if confirmation.is_against_filter and confirmation.device in refused:
                continue
            events += self._plausibility.confirm(confirmation.device, nav.t_ns)
            if filtered:
                filtered.confirm(confirmation, nav.t_ns)
        return events

    def _feed_altimeter(
        self, channel: AltimeterChannel, m: RadioHeight | Range, t_valid_ns: int
    ) -> list[Output | Event]:
        nav = self._navigation.at(t_valid_ns)
        height = channel.feed(channel.read(m, t_valid_ns), nav)
        events = self._ground_check.update(height)
        since_ns = channel.since_ns
        against = self._agreement.update(height, since_ns)
        height = channel.widen(height)
        if against:
            height = replace(height, valid=False, reasons=(*height.reasons, *against))
        if events:
            for name, each in self._altimeters.items():
                each.set_ground_contradicted(name in self._ground_check.contradicted)
        events += self._refusals.update(height, since_ns)
        if self._fallbacks:
            self._fallbacks.feed_height(height, nav)
        if self._is_excluded(height):  # after the filter has taken it: its agreement ends the exclusion
            height = replace(height, valid=False, reasons=(*height.reasons, Reason.EXCLUDED))
        return [height, *events, *self._selector.feed(height), *self._approach.feed(height, nav)]

    def _is_excluded(self, height: HeightAboveGround) -> bool:
        """Whether the filter excludes the altimeter; not if another altimeter confirms it against the ground.

        Then the altitude or the ground, which the filter uses to test altimeters, is wrong.
        """
        if self._fallbacks is None or Reason.GROUND_CONTRADICTED in height.unchecked:
            return False
        return self._fallbacks.is_excluded(height.sensor)

    def reset_after_gap(self) -> None:
        """Measurements before the next one are missing, but the devices were not silent."""
        self._navigation.reset_after_gap()

    def tick(self, t_ns: int) -> list[Output | Event]:
        """Outputs of a tick: stale values, the solution, and repetitions."""
        tested = self._plausibility.tick(t_ns)
        nav = self._navigation.at(t_ns)
        out: list[Output | Event] = [*tested, *self._navigation.changes(nav)]
        for channel in self._altimeters.values():
            for height in channel.tick(t_ns, nav):
                out += [height, *self._selector.feed(height), *self._approach.feed(height, nav)]
        out += self._approach.tick(t_ns, nav)
        self._ticks += 1
        if self._ticks % PROTECTION_TICKS == 0:
            out += [*self._navigation.compare(nav), *self._confirm(nav)]
        if self._ticks % PROTECTION_TICKS == 0 or nav.position_source != self._protection_state.position_source:
            self._protection, self._protection_state = self._navigation.protection(nav), nav
        if self._ticks % SOLUTION_TICKS == 0:
            protection = self._protect(nav)
            self._approach.set_protection_level(None if protection.assumed else protection.horizontal)
            tilted = self._attitude_protection.at(t_ns, nav.attitude, nav.attitude_source)
            out.append(solution(nav, protection, tilted, self._limits, self._navigation.refused))
        if self._fallbacks:
            fallback = self._fallbacks.tick(t_ns, nav, self._plausibility.find_suspects)
            for output in fallback:
                if isinstance(output, FilterSolution):
                    self._plausibility.feed_filter(output)
                    self._attitude_protection.feed_filter(output)
            out += fallback
        return out

    def _protect(self, nav: NavState) -> Protection:
        """Protection levels of a state: those of the last comparison, enlarged by steps since."""
        last, current = self._protection_state.position, nav.position
        if last is None or current is None:
            return self._protection
        return extrapolate_levels(self._protection, last, current, (nav.t_ns - self._protection_state.t_ns) / SECOND_NS)


def _fallbacks(config: Config, observer: TerrainObserver | None) -> Fallbacks | None:
    if config.nav.filter is None and config.nav.radio is None:
        return None
    from fti.nav.fallbacks import Fallbacks  # noqa: PLC0415 - numba: not needed without them

    return Fallbacks(config, observer)
