"""The decode chain: raw frames in, measurements and outputs out.  Live navigation and reprocessing both run it.

It is deterministic: frame timestamps and ticks are its only clock, and it takes frames in order of ``seq``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import msgspec

from fti.alarms.condition import ConditionReport
from fti.config import Config
from fti.devices import BoundDevice
from fti.drivers import Counters, Decoder, StatefulDecoder
from fti.messages.frames import ALL_SOURCES, TICK_LINK, RawFrame
from fti.messages.measurements import Measurement
from fti.messages.notes import ClockEstimate, ElevationSource, NavigationNote, ReadmissionRecord, TerrainRecord
from fti.messages.outputs import Event, Output
from fti.messages.refusals import CarriedRefusal
from fti.nav.alarm_conditions import OutputConditions
from fti.nav.device_time.device_times import DeviceTimes
from fti.nav.integrity.reference import ApproachReference
from fti.nav.pipeline import Pipeline
from fti.nav.sensor_mounting import Mountings
from fti.nav.terrain_reference import Ground
from fti.service.fault_guard import Guard

if TYPE_CHECKING:
    from fti.nav.terrain_methods import TerrainObserver

#: Reasons for skipping the bytes that a decoder held: frames were missing, or the decoder failed.
GAP, FAILURE = "gap", "failure"


class ChainOutput(msgspec.Struct):
    """The results of some frames, in order."""

    measurements: list[tuple[str, Measurement]] = msgspec.field(default_factory=list)
    outputs: list[Output | Event] = msgspec.field(default_factory=list)
    notes: list[NavigationNote] = msgspec.field(default_factory=list)


@dataclass(slots=True)
class DeviceDecoder:
    """A device with its decoder, and its message count."""

    bound: BoundDevice
    decoder: Decoder
    messages: int = 0
    last_ns: int | None = None
    name: str = field(init=False)  # of the device

    def __post_init__(self) -> None:
        self.name = self.bound.device.name

    def reset(self, reason: str) -> None:
        """Replace the decoder; bytes that it held count as skipped for the reason."""
        before = self.decoder
        self.decoder = self.bound.make_decoder()
        _carry_over_counters(self.decoder.counters, before.counters, reason)
        if isinstance(self.decoder, StatefulDecoder):
            self.decoder.copy_state(before)


class MeasurementChain:
    """Decoders of all links, mounting and clocks of the devices: the decode chain without navigation."""

    def __init__(self, config: Config, devices: Sequence[BoundDevice]) -> None:
        self.device_decoders = [DeviceDecoder(bound, bound.make_decoder()) for bound in devices]
        self._on_link: dict[str, list[DeviceDecoder]] = {}
        for device_decoder in self.device_decoders:
            self._on_link.setdefault(device_decoder.bound.device.link, []).append(device_decoder)
        self._config = config
        self._times, self._mountings = DeviceTimes(config.device), Mountings(config.device)

    def reset_clocks(self) -> None:
        """Discard what is known of the device clocks."""
        self._times = DeviceTimes(self._config.device)

    def feed(self, frame: RawFrame) -> ChainOutput:
        """Decode the next frame; returns its measurements, and an event for each failure."""
        products = ChainOutput()
        self._feed_decoders(frame, products)
        return products

    def _feed_decoders(self, frame: RawFrame, products: ChainOutput) -> None:
        for device_decoder in self._on_link.get(frame.link, ()):
            if found := self._decode(device_decoder, frame, products):
                self._use(device_decoder.name, found, frame, products)

    def _use(self, device: str, found: list[Measurement], frame: RawFrame, products: ChainOutput) -> None:
        guard = _EventGuard("pipeline", frame, products)
        waiting = iter(found)
        done = False
        while not done:
            with guard:  # once for all; after a failure once more for the remaining ones
                for measurement in waiting:
                    stamped = self._times.stamp(device, self._mountings.turn(device, measurement))
                    products.measurements.append((device, stamped))
                    self._navigate(device, stamped, products)
                done = True

    def _navigate(self, device: str, measurement: Measurement, products: ChainOutput) -> None:
        """Nothing: without navigation."""

    def _decode(self, device_decoder: DeviceDecoder, frame: RawFrame, products: ChainOutput) -> list[Measurement]:
        found: list[Measurement] = []
        is_decoded = False
        with _EventGuard(device_decoder.name, frame, products):
            found = device_decoder.decoder.feed(frame.data, frame.t_rx_ns)
            is_decoded = True
        if not is_decoded:  # a decoder must not fail; if one does, only that one is reset
            device_decoder.reset(FAILURE)
        if found:
            device_decoder.messages += len(found)
            device_decoder.last_ns = frame.t_rx_ns
        return found


class Chain(MeasurementChain):
    """Decoders of all links and the navigation pipeline behind them.  observer : see ``Pipeline``"""

    def __init__(
        self,
        config: Config,
        devices: Sequence[BoundDevice],
        reference: ApproachReference | None,
        observer: TerrainObserver | None = None,
    ) -> None:
        super().__init__(config, devices)
        self._reference, self._observer = reference, observer
        self._pipeline, self._conditions = Pipeline(config, reference, observer), OutputConditions(config)
        self._terrain: tuple[Ground | None] | None = None  # not set yet

    def reset_after_gap(self) -> None:
        """Reset decoders and pipeline: frames are missing before the next one."""
        for device_decoder in self.device_decoders:
            device_decoder.reset(GAP)
        self._pipeline.reset_after_gap()

    def set_terrain(self, ground: Ground | None, fault: str | None, after_seq: int, t_ns: int) -> ChainOutput:
        """Set the terrain after frame ``after_seq`` at t_ns.  ground : None if not available; ``fault`` : the reason"""
        products = ChainOutput()
        self._terrain = (ground,)
        self._pipeline.set_terrain(ground)
        about: dict[str, Any] = {"fault": fault or ""}
        if ground:
            identity = {"sha256": ground.digest, "checksums": ground.checksums}
            about = {
                "name": ground.name,
                "files": ground.files,
                **_sources_of(ground),
                **_square_of(ground),
                **identity,
            }
        products.notes.append(TerrainRecord(t_ns=t_ns, after_seq=after_seq, **about))
        products.notes.append(self._conditions.report_terrain(t_ns, fault).as_record())
        level, text = ("info", ground.name) if ground else ("error", f"there is none: {fault}")
        products.outputs.append(Event(t_ns=t_ns, level=level, source="terrain", text=text))
        return products

    def readmit(self, source: str, after_seq: int, t_ns: int) -> ChainOutput:
        """Readmit a source, or all, after frame ``after_seq`` at t_ns.  Raises KeyError."""
        products = ChainOutput()
        if source == ALL_SOURCES:
            products.notes += map(ConditionReport.as_record, self._conditions.end_all(t_ns))
            products.outputs.append(self._reset_navigation(t_ns))
        else:
            products.outputs += self._pipeline.readmit(source, t_ns)
        products.notes.append(ReadmissionRecord(t_ns=t_ns, after_seq=after_seq, source=source))
        return products

    def _reset_navigation(self, t_ns: int) -> Event:
        """Discard all earlier measurements, the state of the filter, all refusals, and the device clocks."""
        self.reset_clocks()
        self._pipeline = Pipeline(self._config, self._reference, self._observer)
        self._conditions = OutputConditions(self._config)
        if self._terrain:
            self._pipeline.set_terrain(*self._terrain)
        text = "restarts: the operator readmits all sources"
        return Event(t_ns=t_ns, level="info", source="nav", text=text)

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """The active refusals of sources."""
        return self._pipeline.refusals

    def restore(self, refusals: Sequence[CarriedRefusal], t_ns: int) -> ChainOutput:
        """Restore the refusals of the previous process, at the time of the first frame."""
        return ChainOutput(outputs=[*self._pipeline.restore(refusals, t_ns)])

    def feed(self, frame: RawFrame) -> ChainOutput:
        """Process the next frame; returns its results."""
        products = ChainOutput()
        if frame.link == TICK_LINK:
            with _EventGuard("pipeline", frame, products):
                products.outputs += self._pipeline.tick(frame.t_rx_ns)
            with _EventGuard("device clocks", frame, products):
                self._publish_device_clocks(frame.t_rx_ns, products)
        self._feed_decoders(frame, products)
        if products.outputs:  # most frames have none
            self._report_conditions(frame, products)
        return products

    def _report_conditions(self, frame: RawFrame, products: ChainOutput) -> None:
        with _EventGuard("alarm conditions", frame, products):
            products.notes += map(ConditionReport.as_record, self._conditions.feed(products.outputs))

    def _navigate(self, device: str, measurement: Measurement, products: ChainOutput) -> None:
        products.outputs += self._pipeline.feed(device, measurement)

    def clocks_of(self, device: str, t_ns: int) -> list[ClockEstimate]:
        """The clocks of a device at a time."""
        return self._times.clocks_of(device, t_ns)

    def _publish_device_clocks(self, t_ns: int, products: ChainOutput) -> None:
        if note := self._times.tick(t_ns):
            products.notes.append(note)
            products.outputs += self._times.drain_events(t_ns)


def _sources_of(ground: Ground) -> dict[str, tuple[ElevationSource, ...]]:
    """Datum, date and sigma of the heights of each file; a scene has none."""
    sources = tuple(
        ElevationSource(file=each.path, vertical=each.vertical, date=each.date, sd=each.sd_m or ground.sd)
        for each in ground.terrain.sources
    )
    return {"sources": sources} if sources else {}


def _square_of(ground: Ground) -> dict[str, float]:
    """The square of a terrain that is a part of what is configured."""
    if ground.radius_m is None:
        return {}
    return {"lat": ground.terrain.frame.lat0, "lon": ground.terrain.frame.lon0, "radius": ground.radius_m}


class _EventGuard(Guard):
    """Turns a failure into an event at the time of the frame, so that reprocessing repeats it."""

    __slots__ = ("_frame", "_products", "_unit")

    def __init__(self, unit: str, frame: RawFrame, products: ChainOutput) -> None:
        self._unit, self._frame, self._products = unit, frame, products

    def report(self, error: Exception) -> None:
        text = f"failed at seq {self._frame.seq} and goes on: {type(error).__name__}: {error}"
        event = Event(t_ns=self._frame.t_rx_ns, level="error", source=self._unit, text=text)
        self._products.outputs.append(event)


def _carry_over_counters(counters: Counters, before: Counters, reason: str) -> None:
    """Continue the counts of the previous decoder; bytes that it neither framed nor skipped count as skipped."""
    counters.bytes_in, counters.framed = before.bytes_in, before.framed
    counters.messages.update(before.messages)
    counters.skipped.update(before.skipped)
    counters.lost.update(before.lost)
    if rest := before.bytes_in - before.framed - before.skipped.total():
        counters.skipped[reason] += rest
