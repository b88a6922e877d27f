"""The recorder process: links, numbering, buffers, ring, health, sending, and the shutdown sequence."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from itertools import compress
from typing import Any

from fti.buffers.ring import EntryKind, Ring
from fti.buffers.triple_buffer import TripleBuffer
from fti.clock import SystemClock, next_beat
from fti.config import altimeter_links
from fti.constants import SECOND_NS
from fti.links import Link, add_beat_callbacks, open_link, remove_beat_callbacks
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import Kind, Numbering, SessionFolder
from fti.messages import control
from fti.messages.frames import TICK_LINK
from fti.messages.health import HealthRecord
from fti.messages.notes import AlarmRecord
from fti.messages.outputs import Event
from fti.messages.tables import to_table
from fti.messages.topics import EVENT_TOPIC, note_message
from fti.service.control_channel import ControlChannel
from fti.service.fault_guard import catch_failures, keep_running
from fti.service.recorder.clock_monitor import report_clocks
from fti.service.recorder.frame_sequencer import FrameSequencer
from fti.service.recorder.link_ledger import HEALTH_PERIOD_S, BufferedLink, LinkLedger, link_health
from fti.service.recorder.log_source import LogSource
from fti.service.recorder.log_writer import STORAGE_POLL_PERIOD_S, LogWriter
from fti.service.recorder.reception_monitor import ReceptionMonitor
from fti.service.recorder.snapshot.sink import SnapshotSink
from fti.service.recorder.storage_monitor import Dropped, StorageMonitor
from fti.service.recorder.transmitter import Transmitter
from fti.service.startup import LinkStartup, RecorderStartup

LEDGER_PERIOD_S = 1.0
#: Maximum wait for the first file.
FIRST_FILE_S = 5.0
FIRST_FILE_POLL_S = 0.005
TICK_BUFFER_BYTES = 2**16


class RecorderProcess:
    """The recorder.  ``run`` returns after the supervisor has sent stop or has ended, and every file is closed."""

    def __init__(
        self, startup: RecorderStartup, clock: SystemClock, channel: ControlChannel, ring_fds: tuple[int, int]
    ) -> None:
        self._startup = startup
        self._clock = clock
        self._channel = channel
        self._ring = Ring.attach(ring_fds)
        self._sequencer = FrameSequencer(self._ring, lambda call: asyncio.get_running_loop().call_soon(call))
        self._stop = asyncio.Event()
        self._ticks = TripleBuffer(TICK_BUFFER_BYTES)
        self._tick = self._sequencer.sink(EntryKind.TICK, 0, self._ticks)
        self._targets = startup.targets()
        self._log = self._make_log(
            "raw", Numbering(startup.first_number, startup.skipped_numbers, self._send_file_number)
        )
        self._urgent = altimeter_links(startup.config.device, startup.config.nav)
        self._units = [self._make_link(i) for i in range(len(startup.config.link))]
        links = {unit.link.name: unit.link for unit in self._units}
        self._sender = Transmitter(links, startup.sending, clock, send_reply=channel.send, report=self._report)
        self._ledger = LinkLedger(self._units, self._ticks, self._sequencer, clock.now_ns())
        self._snapshot = self._make_snapshot()
        self._reception = ReceptionMonitor()
        min_free_mb = startup.config.session.min_free_mb
        self._sources = self._make_sources()
        self._writer = LogWriter(self._log, self._sources, self._targets, min_free_mb, self._report)
        self._storage = StorageMonitor(self._log, self._writer, self._dropped, self._send_event)

    # ------------------------------------------------------------------------------------------------- setup

    def _make_log(self, kind: Kind, numbering: Numbering) -> RawLog:
        """A log without a file; the writer opens one."""
        session = self._startup.config.session
        topics = [RawTopic(link.name, link.kind, _settings(link)) for link in self._startup.config.link]
        return RawLog(
            None,
            topics,
            LogSettings(
                split_s=session.split_s,
                split_mb=session.split_mb,
                attachments=[(name, "text/plain", text.encode()) for name, text in self._startup.attachments.items()],
                metadata={"fti": self._startup.metadata},
                folders=[target.folder for target in self._targets],
            ),
            numbering=numbering,
            kind=kind,
        )

    def _make_link(self, index: int) -> BufferedLink:
        described = self._startup.config.link[index]
        commands = self._startup.sending.get(described.name, LinkStartup())
        received = TripleBuffer(described.buffer_bytes, on_ready=self._wake_writer)
        sent = TripleBuffer(described.buffer_bytes, on_ready=self._wake_writer)
        link = open_link(
            described,
            self._clock,
            self._sequencer.sink(EntryKind.RECEIVED, index, received),
            on_connect=[bytes.fromhex(text) for text in commands.on_connect],
        )
        link.on_sent = self._sequencer.sink(EntryKind.SENT, index, sent)
        link.urgent = described.name in self._urgent
        return BufferedLink(link, described.kind, index, received, sent)

    def _make_snapshot(self) -> SnapshotSink | None:
        """The snapshot sink; in mode "snapshot" it decides which frames are recorded."""
        settings = self._startup.config.snapshot
        if settings is None:
            return None
        log = self._make_log("snapshot", Numbering())
        links = [unit.link.name for unit in self._units]
        sink = SnapshotSink(
            log, links, settings, self._present_folder, report_event=self._send_event, report=self._report
        )
        if self._startup.config.session.mode == "snapshot":
            for n, unit in enumerate(self._units):
                unit.outcome, unit.sent_outcome = sink.outcomes[2 * n + 1 : 2 * n + 3]
        return sink

    def _present_folder(self) -> SessionFolder | None:
        return self._log.folder if self._writer.file else None

    def report_refused(self, refused: Sequence[str]) -> None:
        """Report real-time settings that failed here, although the check at the start succeeded."""
        for text in refused:
            self._send_event("error", "recorder", text)

    def _make_sources(self) -> list[LogSource]:
        """Ticks, and received and sent frames of each link; sent frames only where a link may transmit."""
        log = self._log
        sources, used = [LogSource(TICK_LINK, log.tick_channel, self._ticks)], [True]
        for unit, described in zip(self._units, self._startup.config.link, strict=True):
            received, sent = log.channels(unit.link.name)
            sources.append(LogSource(unit.link.name, received, unit.received))
            sources.append(LogSource(unit.link.name, sent, unit.sent))
            used += True, described.transmit
        if self._snapshot:
            for source, consumer in zip(sources, self._snapshot.consumers, strict=True):
                source.on_written = consumer
        if self._startup.config.session.mode == "snapshot":
            for source in sources[1:]:
                source.channel = None
        return list(compress(sources, used))

    def _wake_writer(self) -> None:
        self._writer.wake()

    # ------------------------------------------------------------------------------------------------ running

    async def run(self) -> None:
        """Record until stopped."""
        loop = asyncio.get_running_loop()
        loop.add_reader(self._channel.fileno(), self._on_control)
        if self._snapshot:
            self._snapshot.start()
        readers = [self._start(unit.link.name, unit.link.run) for unit in self._units]
        add_beat_callbacks(self._beat, self._flush_early)
        helpers = [self._start("health", self._watch), self._start("storage", self._poll_storage)]
        self._sender.start()
        await self._stop.wait()
        await self._finish(readers, helpers)
        loop.remove_reader(self._channel.fileno())

    def _start(self, name: str, make: Callable[[], Any]) -> asyncio.Task[None]:
        return asyncio.create_task(keep_running(name, make, self._report), name=name)

    def _beat(self) -> None:
        """Every 20 ms: add a tick frame, so that timeouts are reproducible, and pass on the pending frames."""
        with catch_failures("ticks", self._report):
            now = self._clock.now_ns()
            self._notice_pause(now)
            self._tick((b"",), (now,))
            self._sequencer.flush()
            self._wake_writer()

    def _flush_early(self) -> None:
        """An altimeter has sent a frame: pass it on now, without waiting for the beat."""
        with catch_failures("early frames", self._report):
            self._sequencer.flush()

    def _notice_pause(self, now_ns: int) -> None:
        """Report a standstill of this process to the writer, which must not count it as a slow medium."""
        if pause_s := self._reception.on_cycle(now_ns):
            self._writer.on_process_paused(pause_s)

    def _report_reception(self, now_ns: int, *, final: bool = False) -> None:
        links = [(unit.link.name, unit.link.status) for unit in self._units]
        for level, source, text in self._reception.events(now_ns, links, final=final):
            self._send_event(level, source, text)

    async def _watch(self) -> None:
        """Send health twice a second; record ledger and clocks once a second."""
        cycle = 0
        while True:
            now = self._clock.now_ns()
            self._notice_pause(now)
            self._report_reception(now)
            self._channel.send(self._health(now))
            if cycle % round(LEDGER_PERIOD_S / HEALTH_PERIOD_S) == 0:
                self._writer.add_note(*note_message(self._ledger.read(now)))
                report_clocks(self._clock, self._writer.add_note, self._send_event, self._channel.send)
            cycle += 1
            await _until_beat(HEALTH_PERIOD_S)

    async def _poll_storage(self) -> None:
        """Open the first file, then watch the storage and report changes."""
        await self._begin_recording()
        while True:
            self._notice_pause(self._clock.now_ns())
            self._writer.poll_storage()
            self._storage.report_changes()
            if self._snapshot:
                self._snapshot.report_overflow()
            await _until_beat(STORAGE_POLL_PERIOD_S)

    async def _begin_recording(self) -> None:
        """Wait for the first file, or for the reason why there is none, and report it."""
        deadline = self._clock.now_ns() + round(FIRST_FILE_S * SECOND_NS)
        while not (self._writer.file or self._writer.has_failed_everywhere or self._clock.now_ns() > deadline):
            self._writer.poll_storage()
            await asyncio.sleep(FIRST_FILE_POLL_S)
        self._channel.send(control.Ready(None if self._writer.file else self._writer.state()[1]))

    def _on_control(self) -> None:
        for message in self._channel.receive(lambda error: self._report("control", error)):
            with catch_failures("control", self._report):
                self._handle_message(message)
        if self._channel.has_ended:
            asyncio.get_running_loop().remove_reader(self._channel.fileno())
            self._stop.set()

    def _handle_message(self, message: control.ToRecorder) -> None:
        match message:
            case control.Stop():
                self._stop.set()
            case control.EventNote(event, who):
                self._writer.add_note(EVENT_TOPIC, event.t_ns, {**to_table(event), "who": who})
            case AlarmRecord() | HealthRecord():
                self._writer.add_note(*note_message(message))
            case control.SnapshotTrigger(text, t_ns) if self._snapshot:
                self._snapshot.trigger(text, t_ns)
            case control.SendBytes():
                self._sender.handle_command(message)

    def _dropped(self) -> dict[str, Dropped]:
        return {unit.link.name: Dropped.of(unit.received.stats, unit.link.status) for unit in self._units}

    def _send_file_number(self, number: int, confirmed: bool) -> None:
        """Report a file number; the next recorder needs it even if this one is killed before it creates the file."""
        self._channel.send(control.FileNumber(number, confirmed))

    def _report(self, unit: str, error: Exception) -> None:
        self._send_event("error", unit, f"{type(error).__name__}: {error}")

    def _send_event(self, level: str, source: str, text: str) -> None:
        self._channel.send(Event(t_ns=self._clock.now_ns(), level=level, source=source, text=text))

    # ------------------------------------------------------------------------------------------------- ending

    async def _finish(self, readers: list[asyncio.Task[None]], helpers: list[asyncio.Task[None]]) -> None:
        """Shutdown: stop sending, drain kernel queues, stop readers, write buffers, close file, end ring."""
        await self._sender.stop()
        await asyncio.gather(*(self._drain(unit.link) for unit in self._units))
        remove_beat_callbacks(self._beat, self._flush_early)
        for task in (*readers, *helpers):
            task.cancel()
        await asyncio.gather(*readers, *helpers, return_exceptions=True)
        self._report_reception(self._clock.now_ns(), final=True)
        self._sequencer.flush()
        await asyncio.to_thread(self._writer.stop)
        if self._snapshot:
            await asyncio.to_thread(self._snapshot.stop)
        now = self._clock.now_ns()
        self._writer.add_note(*note_message(self._ledger.read(now, final=True)))
        await asyncio.to_thread(self._writer.finish)
        self._ring.end()
        self._channel.send(self._health(now))
        self._channel.send(self._describe_end(now))

    def _describe_end(self, now: int) -> control.RecorderEnd:
        possibly_lost = [batch for source in self._sources for batch in source.possibly_lost]
        return control.RecorderEnd(
            ledger=self._ledger.read(now, final=True),
            ledger_recorded=self._writer.notes_recorded,
            fault=self._writer.fault,
            unsafe_frames=sum(len(frames) for _, _, frames, _ in possibly_lost),
            unsafe_bytes=sum(payload for *_, payload in possibly_lost),
        )

    async def _drain(self, link: Link) -> None:
        with catch_failures(link.name, self._report):
            await link.drain()

    # ------------------------------------------------------------------------------------------------- reporting

    def _health(self, now: int) -> control.RecorderReport:
        return control.RecorderReport(
            t_ns=now,
            links={unit.link.name: link_health(unit, now) for unit in self._units},
            storage=self._storage.health(),
            snapshot=self._snapshot.health() if self._snapshot else None,
            next_seq=self._sequencer.flush(),
        )


async def _until_beat(period_s: float) -> None:
    """Wait until the next multiple of a period."""
    now = asyncio.get_running_loop().time()
    await asyncio.sleep(next_beat(now, period_s) - now)


def _settings(link: Any) -> dict[str, str]:
    """Channel metadata of a link: all its configuration keys."""
    return {key: str(value) for key, value in link.model_dump().items() if key not in ("name", "kind")}
