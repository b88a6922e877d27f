"""What the recorder process does: links, numbering, buffers, ring, health, sending, and the order of the end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from itertools import compress
from typing import Any

from fti.buffers.ring import Ring
from fti.buffers.triple_buffer import TripleBuffer
from fti.clock import SystemClock, next_beat
from fti.config import altimeter_links
from fti.links import Link, add_beat_callbacks, open_link, remove_beat_callbacks
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import Kind, Numbering, SessionFolder
from fti.service.control_channel import ControlChannel, ControlMessage
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
from fti.types import TICK_LINK

LEDGER_PERIOD_S = 1.0
#: A medium that has not opened the first file after this time is not waited for any more.
FIRST_FILE_S = 5.0
FIRST_FILE_POLL_S = 0.005
TICK_BUFFER_BYTES = 2**16
SECOND_NS = 1_000_000_000


class RecorderProcess:
    """The recorder.  ``run`` returns when the supervisor says stop, or is gone, and every file is closed."""

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
        self._tick_index = len(startup.config.link)
        self._tick = self._sequencer.sink(self._tick_index, self._ticks)
        self._places = startup.places()
        self._log = self._make_log(
            "raw", Numbering(startup.first_number, startup.skipped_numbers, self._send_file_number)
        )
        self._urgent = altimeter_links(startup.config.device, startup.config.nav)
        self._units = [self._make_link(i) for i in range(len(startup.config.link))]
        links = {unit.link.name: unit.link for unit in self._units}
        self._sender = Transmitter(links, startup.sending, clock, tell=channel.send, report=self._report)
        self._ledger = LinkLedger(self._units, self._ticks, self._sequencer, clock.now_ns())
        self._snapshot = self._make_snapshot()
        self._reception = ReceptionMonitor()
        min_free_mb = startup.config.session.min_free_mb
        self._writer = LogWriter(self._log, self._sources(), self._places, min_free_mb, self._report)
        self._storage = StorageMonitor(self._writer, self._dropped, self._send_event)

    # ------------------------------------------------------------------------------------------------- making

    def _make_log(self, kind: Kind, numbering: Numbering) -> RawLog:
        """A log without a file: the writer opens one where it can."""
        session = self._startup.config.session
        topics = [RawTopic(link.name, link.kind, _settings(link)) for link in self._startup.config.link]
        return RawLog(
            None,
            topics,
            split_s=session.split_s,
            split_mb=session.split_mb,
            attachments=[(name, "text/plain", text.encode()) for name, text in self._startup.attachments.items()],
            metadata={"fti": self._startup.metadata},
            numbering=numbering,
            places=[place.folder for place in self._places],
            kind=kind,
        )

    def _make_link(self, index: int) -> BufferedLink:
        described = self._startup.config.link[index]
        orders = self._startup.sending.get(described.name, LinkStartup())
        received = TripleBuffer(described.buffer_bytes, on_ready=self._wake_writer)
        sent = TripleBuffer(described.buffer_bytes, on_ready=self._wake_writer)
        link = open_link(
            described,
            self._clock,
            self._sequencer.sink(index, received),
            on_connect=[bytes.fromhex(text) for text in orders.on_connect],
        )
        link.on_sent = self._sequencer.sink(self._tick_index + 1 + index, sent)
        link.urgent = described.name in self._urgent
        return BufferedLink(link, described.kind, index, received, sent)

    def _make_snapshot(self) -> SnapshotSink | None:
        """The sink beside the log; in mode "snapshot" it decides what becomes of the frames."""
        settings = self._startup.config.snapshot
        if settings is None:
            return None
        log = self._make_log("snapshot", Numbering())
        links = [unit.link.name for unit in self._units]
        sink = SnapshotSink(log, links, settings, self._present_folder, tell=self._send_event, report=self._report)
        if self._startup.config.session.mode == "snapshot":
            for n, unit in enumerate(self._units):
                unit.outcome, unit.sent_outcome = sink.outcomes[2 * n + 1 : 2 * n + 3]
        return sink

    def _present_folder(self) -> SessionFolder | None:
        return self._log.folder if self._writer.file else None

    def report_refused(self, refused: Sequence[str]) -> None:
        """Tell what the machine refuses this process, though it permitted it when it was asked."""
        for text in refused:
            self._send_event("error", "recorder", text)

    def _sources(self) -> list[LogSource]:
        """Ticks, and what is received and sent on each link; nothing is ever sent on a link that may not."""
        log = self._log
        sources, used = [LogSource(TICK_LINK, log.tick_channel, self._ticks)], [True]
        for unit, described in zip(self._units, self._startup.config.link, strict=True):
            received, sent = log.channels(unit.link.name)
            sources.append(LogSource(unit.link.name, received, unit.received))
            sources.append(LogSource(unit.link.name, sent, unit.sent))
            used += True, described.transmit
        if self._snapshot:
            for source, keep in zip(sources, self._snapshot.consumers, strict=True):
                source.keep = keep
        if self._startup.config.session.mode == "snapshot":
            for source in sources[1:]:
                source.channel = None
        return list(compress(sources, used))

    def _wake_writer(self) -> None:
        self._writer.wake()

    # ------------------------------------------------------------------------------------------------ running

    async def run(self) -> None:
        """Record until told to stop."""
        loop = asyncio.get_running_loop()
        loop.add_reader(self._channel.fileno(), self._on_control)
        self._writer.start()
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
        """Every 20 ms: a tick frame, so that silence has a time too; what has come until then goes on with it."""
        with catch_failures("ticks", self._report):
            now = self._clock.now_ns()
            self._notice_pause(now)
            self._tick((b"",), (now,))
            self._sequencer.flush()
            self._wake_writer()

    def _flush_early(self) -> None:
        """An altimeter has sent something: navigation gets it now, the file with the beat."""
        with catch_failures("early frames", self._report):
            self._sequencer.flush()

    def _notice_pause(self, now_ns: int) -> None:
        """A process that stood still has not waited for its medium."""
        if pause_s := self._reception.on_turn(now_ns):
            self._writer.paused(pause_s)

    def _report_reception(self, now_ns: int, *, final: bool = False) -> None:
        links = [(unit.link.name, unit.link.status) for unit in self._units]
        for level, source, text in self._reception.events(now_ns, links, final=final):
            self._send_event(level, source, text)

    async def _watch(self) -> None:
        """Health to the supervisor twice a second; ledger and clocks into the file once a second."""
        turn = 0
        while True:
            now = self._clock.now_ns()
            self._notice_pause(now)
            self._report_reception(now)
            self._channel.send({"health": self._health(now)})
            if turn % round(LEDGER_PERIOD_S / HEALTH_PERIOD_S) == 0:
                self._writer.note("/fti/ledger", now, self._ledger.note(now))
                report_clocks(self._clock, self._writer.note, self._send_event, self._channel.send)
            turn += 1
            await _until_beat(HEALTH_PERIOD_S)

    async def _poll_storage(self) -> None:
        """The first file, and every change of what becomes of the files."""
        await self._begin_recording()
        while True:
            self._notice_pause(self._clock.now_ns())
            self._writer.poll_storage()
            self._storage.report_changes()
            if self._snapshot:
                self._snapshot.report_overflow()
            await _until_beat(STORAGE_POLL_PERIOD_S)

    async def _begin_recording(self) -> None:
        """Wait for the first file, or for the reason why there is none yet, and tell it."""
        deadline = self._clock.now_ns() + round(FIRST_FILE_S * SECOND_NS)
        while not (self._writer.file or self._writer.hopeless or self._clock.now_ns() > deadline):
            self._writer.poll_storage()
            await asyncio.sleep(FIRST_FILE_POLL_S)
        if file := self._writer.file:
            self._channel.send({"ready": True, "file": str(file)})
        else:
            self._channel.send({"ready": True, "fault": self._writer.state()[1]})

    def _on_control(self) -> None:
        for message in self._channel.receive():
            with catch_failures("control", self._report):
                self._handle_message(message)
        if self._channel.ended:
            asyncio.get_running_loop().remove_reader(self._channel.fileno())
            self._stop.set()

    def _handle_message(self, message: ControlMessage) -> None:
        if "stop" in message:
            self._stop.set()
        elif "note" in message:
            note = message["note"]
            self._writer.note(note["topic"], note["t_ns"], note["content"])
        elif "trigger" in message and self._snapshot:
            self._snapshot.trigger(message["trigger"], message["t_ns"])
        elif "send" in message:
            self._sender.handle_command(message["send"])

    def _dropped(self) -> dict[str, Dropped]:
        """What was dropped of each link."""
        return {unit.link.name: Dropped.of(unit.received.stats, unit.link.status) for unit in self._units}

    def _send_file_number(self, number: int, confirmed: bool) -> None:
        """The next recorder must know it, also when this one is killed before the file is there."""
        self._channel.send({"file_number": {"number": number, "confirmed": confirmed}})

    def _report(self, unit: str, error: Exception) -> None:
        self._send_event("error", unit, f"{type(error).__name__}: {error}")

    def _send_event(self, level: str, source: str, text: str) -> None:
        event = {"level": level, "source": source, "text": text, "t_ns": self._clock.now_ns()}
        self._channel.send({"event": event})

    # ------------------------------------------------------------------------------------------------- ending

    async def _finish(self, readers: list[asyncio.Task[None]], helpers: list[asyncio.Task[None]]) -> None:
        """Sending ended, kernel queues drained, readers stopped, buffers written, file closed, ring ended: in order."""
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
        self._writer.note("/fti/ledger", now, self._ledger.note(now, final=True))
        await asyncio.to_thread(self._writer.finish)
        self._ring.end()
        self._channel.send({"health": self._health(now)})
        self._channel.send({"stopped": self._describe_end(now)})

    def _describe_end(self, now: int) -> dict[str, Any]:
        """See ``fti.service.supervisor.session_result``."""
        unsafe = [burst for source in self._writer.sources for burst in source.unsafe]
        return {
            "ledger": self._ledger.note(now, final=True),
            "ledger_recorded": self._writer.notes_recorded,
            "fault": self._writer.fault,
            "unsafe_frames": sum(len(frames) for _, _, frames, _ in unsafe),
            "unsafe_bytes": sum(payload for *_, payload in unsafe),
        }

    async def _drain(self, link: Link) -> None:
        with catch_failures(link.name, self._report):
            await link.drain()

    # ------------------------------------------------------------------------------------------------- telling

    def _health(self, now: int) -> dict[str, Any]:
        return {
            "t_ns": now,
            "links": {unit.link.name: link_health(unit, now) for unit in self._units},
            "storage": self._storage.health(),
            "snapshot": self._snapshot.health() if self._snapshot else None,
            "next_seq": self._sequencer.seq,
        }


async def _until_beat(period_s: float) -> None:
    """Until the next multiple of a period."""
    now = asyncio.get_running_loop().time()
    await asyncio.sleep(next_beat(now, period_s) - now)


def _settings(link: Any) -> dict[str, str]:
    """What the channel metadata says of a link: everything that the configuration says."""
    return {key: str(value) for key, value in link.model_dump().items() if key not in ("name", "kind")}
