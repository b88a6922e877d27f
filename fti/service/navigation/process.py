"""The navigation process: ring -> decode chain -> derived file and bus, strictly in order of ``seq``."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from msgspec import UNSET, structs

from fti.buffers.ring import EntryKind, Ring
from fti.buffers.ring_reader import RingFrame, RingReader
from fti.bus.client import Publisher
from fti.bus.message import encode_with_age
from fti.clock import SystemClock
from fti.config import Config
from fti.devices import bind_devices, parse_reference
from fti.latency_histogram import LatencyHistogram
from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.messages.control import (
    DeviceAnswer,
    Hurry,
    NavigationReport,
    Readmit,
    Ready,
    Refusals,
    TerrainLoading,
)
from fti.messages.frames import TICK_LINK, RawFrame
from fti.messages.health import NavigationHealth, OutputDelay
from fti.messages.measurements import Ack
from fti.messages.notes import AlarmReportRecord, GapRecord
from fti.messages.outputs import Event, HeightAboveGround, HeightBelowAircraft, NavSolution, Output
from fti.messages.topics import OUTPUT_MAX_AGE_MS, output_topic
from fti.service.control_channel import ControlChannel
from fti.service.navigation.backlog import BacklogPolicy, SkipReporter
from fti.service.navigation.decode_chain import Chain, ChainOutput
from fti.service.navigation.derived_writer import DerivedWriter
from fti.service.navigation.device_monitor import DeviceMonitor
from fti.service.navigation.terrain_areas import TerrainAreaLoader
from fti.service.navigation.terrain_loader import TerrainLoader
from fti.service.startup import NavigationStartup

#: Name of the process on the bus and in health.
PROCESS = "navigation"
#: Timeout for the wake-up by the recorder, which comes at least 50 times a second unless the recorder has stopped.
IDLE_S = 0.1
#: Small, so that lateness is detected soon.
READ_LIMIT = 200
HEALTH_PERIOD_S = 0.5
#: Maximum wait for the end of the ring after the end of the supervisor; the recorder ends the ring.
ORPHAN_S = 10.0


PERIOD_NS = 5_000_000_000


class OutputLatency:
    """Latency percentiles over the last complete period."""

    def __init__(self, now_ns: int) -> None:
        self._current = LatencyHistogram()
        self._since_ns = now_ns
        self._published: OutputDelay | None = None

    def add(self, stamp_ns: int, out_ns: int) -> None:
        """Add one latency.  stamp_ns : timestamp of a frame; out_ns : publication of its last output [ns]"""
        self._current.add((out_ns - stamp_ns) / 1e9)

    def percentiles(self, now_ns: int) -> OutputDelay | None:
        """None without outputs, and before the end of the first period."""
        if now_ns - self._since_ns >= PERIOD_NS:
            late = self._current.summary
            percentiles = OutputDelay(p50_ms=late.p50_ms, p99_ms=late.p99_ms, max_ms=late.max_ms)
            self._published = percentiles if late.messages else None
            self._current, self._since_ns = LatencyHistogram(), now_ns
        return self._published


class NavigationProcess:
    """Consumes the ring until its end mark."""

    def __init__(self, startup: NavigationStartup, clock: SystemClock, channel: ControlChannel, ring: Ring) -> None:
        config = startup.config
        self._clock = clock
        self._channel = channel
        self._ring = ring
        self._reader = RingReader(self._ring)
        self._links = [link.name for link in config.link]
        self._devices = bind_devices(config, startup.texts)
        self._config = config
        self._chain = Chain(config, self._devices, parse_reference(config, startup.texts))
        self._loading = _terrain_loader(config, startup.without_terrain)
        self._device_monitor = DeviceMonitor(config, self._chain)
        self._max_age_ms = {device.name: device.max_age_ms for device in config.device}
        self._derived = self._open_derived(startup)
        self._bus = Publisher(Path(startup.bus), PROCESS)
        self._backlog, self._skips = BacklogPolicy(), SkipReporter()
        resumed = self._ring.reader_state()
        self._last_seq = resumed.next_seq - 1
        self._resumed = resumed.position > 0
        self._last_ns = clock.now_ns()
        self._latency = OutputLatency(self._last_ns)
        self._must_finish = False
        self._reported_fault: str | None = None
        self._restored = startup.refusals
        self._refusals = list(self._restored)

    def _open_derived(self, startup: NavigationStartup) -> DerivedWriter:
        session, targets = startup.config.session, startup.targets()
        log = DerivedLog(
            None,
            LogSettings(
                split_s=session.split_s,
                split_mb=session.split_mb,
                attachments=[(name, "text/plain", text.encode()) for name, text in startup.attachments.items()],
                metadata={"fti": startup.metadata},
                folders=[target.folder for target in targets],
            ),
        )
        return DerivedWriter(log, targets, session.min_free_mb, self._report)

    def run(self) -> None:
        """Process frames until the ring has ended and is empty."""
        self._derived.start()
        if isinstance(self._loading, TerrainLoader):
            self._channel.send(TerrainLoading(True))
            self._loading.start()
        self._channel.send(Ready())
        try:
            self._consume()
        finally:
            self._derived.close()
            self._publish_skips(self._skips.flush(self._clock.now_ns()))
            self._send_health()
            self._bus.close()

    def _consume(self) -> None:
        health_due = time.monotonic()
        orphaned: float | None = None
        while not self._must_finish:
            self._take_terrain()
            frames = self._reader.read(READ_LIMIT)
            for frame in frames:
                self._process_frame(frame)
            self._skip_backlog(frames)
            now = time.monotonic()
            if now >= health_due:
                health_due = now + HEALTH_PERIOD_S
                self._send_health()
            self._handle_messages()
            if frames:
                continue
            if self._reader.is_finished:
                return
            if self._channel.has_ended:
                orphaned = orphaned or now + ORPHAN_S
                if now > orphaned:
                    return
            self._backlog.on_idle(self._clock.now_ns())
            self._reader.wait(IDLE_S)
        self._reader.commit()

    def _skip_backlog(self, frames: Sequence[RingFrame]) -> None:
        """Skip the backlog if the policy requires it; record the gap.  frames : the frames read last

        The age of the last tick among them is the age of the backlog: only ticks enter the ring without delay.
        """
        now = self._clock.now_ns()
        ticks = [frame.t_rx_ns for frame in frames if frame.kind is EntryKind.TICK]
        if ticks and not self._ring.has_ended and self._backlog.must_skip(now - ticks[-1]):
            self._reader.skip()
        missed = self._reader.next_seq - 1 - self._last_seq
        if missed:
            self._backlog.on_overrun()
            self._skips.add(missed, now - self._last_ns)
            self._publish_skips(self._skips.take_event(now))
            self._note_gap(self._reader.next_seq, now)
            self._last_seq += missed
            self._last_ns = now

    def _take_terrain(self) -> None:
        """Set the terrain from the next frame on, when loading has ended."""
        if self._loading and (result := self._loading.take()):
            self._channel.send(TerrainLoading(False))
            self._deliver(self._chain.set_terrain(result.ground, result.fault, self._last_seq, self._last_ns))

    def _follow_with_terrain(self, nav: NavSolution) -> None:
        if isinstance(self._loading, TerrainAreaLoader) and self._loading.follow(nav):
            self._channel.send(TerrainLoading(True))

    def _process_frame(self, entry: RingFrame) -> None:
        kind, index, seq, t_rx_ns, data = entry
        if self._resumed or seq != self._last_seq + 1:
            self._note_gap(seq, t_rx_ns)
        self._last_seq = seq
        self._last_ns = t_rx_ns
        if kind is EntryKind.SENT:
            return
        frame = RawFrame(TICK_LINK if kind is EntryKind.TICK else self._links[index], seq, t_rx_ns, data)
        self._device_monitor.feed(frame)
        products = self._chain.feed(frame)
        self._deliver(products)
        if products.outputs:
            self._latency.add(t_rx_ns, self._clock.now_ns())

    def _deliver(self, products: ChainOutput) -> None:
        for device, measurement in products.measurements:
            self._derived.measurement(device, measurement)
            if isinstance(measurement, Ack):
                self._send_ack(device, measurement)
        for note in products.notes:
            self._derived.note(note)
            if isinstance(note, AlarmReportRecord):
                self._channel.send(note, is_kept=True)
        for output in products.outputs:
            self._derived.output(output)
            self._publish(output)
            if isinstance(output, NavSolution):
                self._follow_with_terrain(output)
        if any(isinstance(output, Event) for output in products.outputs):  # each refusal is an event
            self._send_refusals()

    def _send_refusals(self) -> None:
        """Send changed refusals to the supervisor; a restarted process begins with them."""
        refusals = self._chain.refusals
        if refusals != self._refusals:
            self._refusals = refusals
            self._channel.send(Refusals(tuple(refusals)))

    def _send_ack(self, device: str, ack: Ack) -> None:
        """Send the answer of a device to the supervisor, which knows the command."""
        t_ns, command = ack.stamp.t_rx_ns, ack.command
        self._channel.send(
            DeviceAnswer(device=device, t_ns=t_ns, command=command, accepted=ack.accepted, detail=ack.detail)
        )

    def _publish(self, output: Output | Event) -> None:
        if isinstance(output, Event):
            self._channel.send(output)
        else:
            max_age = OUTPUT_MAX_AGE_MS
            if isinstance(output, HeightAboveGround | HeightBelowAircraft):
                max_age = self._max_age_ms.get(output.sensor, OUTPUT_MAX_AGE_MS)
            payload = encode_with_age(structs.asdict(output), output.t_ns, self._clock.now_ns(), max_age)
            self._bus.publish(output_topic(output), payload)

    def _note_gap(self, seq: int, t_ns: int) -> None:
        """Record a gap of the ring or a restart in the file, so that reprocessing repeats it."""
        gap = GapRecord(
            t_ns=t_ns,
            kind="restart" if self._resumed else "ring",
            after_seq=self._last_seq,
            before_seq=seq,
            refusals=self._restored if self._resumed else UNSET,
        )
        self._chain.reset_after_gap()
        if self._resumed:
            self._deliver(self._chain.restore(self._restored, t_ns))
        self._resumed = False
        self._derived.note(gap)

    def _handle_messages(self) -> None:
        for message in self._channel.receive(lambda error: self._report("control", error)):
            if isinstance(message, Hurry):
                self._must_finish = True
            elif isinstance(message, Readmit):
                self._deliver(self._chain.readmit(message.source, self._last_seq, self._last_ns))

    def _publish_skips(self, event: Event | None) -> None:
        if event:
            self._publish(event)

    def _send_health(self) -> None:
        now = self._clock.now_ns()
        self._publish_skips(self._skips.take_event(now))
        fault = self._derived.fault
        if fault != self._reported_fault and (fault is None or self._reported_fault is None):
            text = f"stopped: {fault}" if fault else "goes on"
            self._send_event("error" if fault else "warning", "derived file", text)
            self._reported_fault = fault
        navigation = NavigationHealth(
            lag_ms=max(0.0, (now - self._last_ns) / 1e6),
            output_delay=self._latency.percentiles(now),
            ring_lost_frames=self._reader.lost_frames,
            last_seq=self._last_seq,
            terrain=self._loading.state if self._loading else None,
            is_terrain_loading=bool(self._loading and not self._loading.is_done),
            derived_lost=self._derived.lost,
            bus_lost=self._bus.lost,
            derived_fault=fault,
        )
        self._channel.send(NavigationReport(self._device_monitor.devices(now), navigation))

    def _report(self, unit: str, error: Exception) -> None:
        self._send_event("error", unit, f"{type(error).__name__}: {error}")

    def _send_event(self, level: str, source: str, text: str) -> None:
        self._channel.send(Event(t_ns=self._clock.now_ns(), level=level, source=source, text=text))


def _terrain_loader(config: Config, without: str | None) -> TerrainLoader | TerrainAreaLoader | None:
    settings = config.nav.terrain
    if settings is None:
        return None
    return (
        TerrainLoader(config, without) if settings.memory_mb is None else TerrainAreaLoader(config, settings, without)
    )
