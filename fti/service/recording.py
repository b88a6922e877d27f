"""What the recorder process does: links, numbering, buffers, ring, health, sending, and the order of the end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from itertools import compress
from typing import Any

from fti.buffers.ring import Ring
from fti.buffers.triple import TripleBuffer
from fti.clock import SystemClock, next_beat
from fti.config import altimeter_links
from fti.links import Link, open_link, with_beat, without_beat
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import Kind, Numbering, SessionFolder
from fti.service.accounts import HEALTH_PERIOD_S, Books, Unit, link_health
from fti.service.clock_report import report_clocks
from fti.service.control import Channel, Message
from fti.service.guard import guarded, keep_running
from fti.service.intake import Intake
from fti.service.orders import LinkOrder, RecorderOrder
from fti.service.reception_monitor import ReceptionMonitor
from fti.service.sending import Sender
from fti.service.snapshot import SnapshotSink
from fti.service.source import Source
from fti.service.storage_report import Dropped, StorageReport
from fti.service.writing import TEND_PERIOD_S, Writer
from fti.types import TICK_LINK

LEDGER_PERIOD_S = 1.0
#: A medium that has not opened the first file after this time is not waited for any more.
FIRST_FILE_S = 5.0
FIRST_LOOK_S = 0.005
TICK_BUFFER_BYTES = 2**16
SECOND_NS = 1_000_000_000


class Recorder:
    """The recorder.  ``run`` returns when the supervisor says stop, or is gone, and every file is closed."""

    def __init__(self, order: RecorderOrder, clock: SystemClock, channel: Channel, ring_fds: tuple[int, int]) -> None:
        self._order = order
        self._clock = clock
        self._channel = channel
        self._ring = Ring.attach(ring_fds)
        self._intake = Intake(self._ring, lambda call: asyncio.get_running_loop().call_soon(call))
        self._stop = asyncio.Event()
        self._ticks = TripleBuffer(TICK_BUFFER_BYTES)
        self._tick_index = len(order.config.link)
        self._tick = self._intake.sink(self._tick_index, self._ticks)
        self._places = order.places()
        self._log = self._make_log("raw", Numbering(order.first_number, order.given_up, self._tell_number))
        self._urgent = altimeter_links(order.config.device, order.config.nav)
        self._units = [self._make_unit(i) for i in range(len(order.config.link))]
        links = {unit.link.name: unit.link for unit in self._units}
        self._sender = Sender(links, order.sending, clock, tell=channel.send, report=self._report)
        self._books = Books(self._units, self._ticks, self._intake, clock.now_ns())
        self._snapshot = self._make_snapshot()
        self._reception = ReceptionMonitor()
        min_free_mb = order.config.session.min_free_mb
        self._writer = Writer(self._log, self._sources(), self._places, min_free_mb, self._report)
        self._storage = StorageReport(self._writer, self._dropped, self._tell)

    # ------------------------------------------------------------------------------------------------- making

    def _make_log(self, kind: Kind, numbering: Numbering) -> RawLog:
        """A log without a file: the writer opens one where it can."""
        session = self._order.config.session
        topics = [RawTopic(link.name, link.kind, _settings(link)) for link in self._order.config.link]
        return RawLog(
            None,
            topics,
            split_s=session.split_s,
            split_mb=session.split_mb,
            attachments=[(name, "text/plain", text.encode()) for name, text in self._order.attachments.items()],
            metadata={"fti": self._order.metadata},
            numbering=numbering,
            places=[place.folder for place in self._places],
            kind=kind,
        )

    def _make_unit(self, index: int) -> Unit:
        described = self._order.config.link[index]
        orders = self._order.sending.get(described.name, LinkOrder())
        received = TripleBuffer(described.buffer_bytes, on_ready=self._wake_writer)
        sent = TripleBuffer(described.buffer_bytes, on_ready=self._wake_writer)
        link = open_link(
            described,
            self._clock,
            self._intake.sink(index, received),
            on_connect=[bytes.fromhex(text) for text in orders.on_connect],
        )
        link.on_sent = self._intake.sink(self._tick_index + 1 + index, sent)
        link.urgent = described.name in self._urgent
        return Unit(link, described.kind, index, received, sent)

    def _make_snapshot(self) -> SnapshotSink | None:
        """The sink beside the log; in mode "snapshot" it decides what becomes of the frames."""
        settings = self._order.config.snapshot
        if settings is None:
            return None
        log = self._make_log("snapshot", Numbering())
        links = [unit.link.name for unit in self._units]
        sink = SnapshotSink(log, links, settings, self._present_folder, tell=self._tell, report=self._report)
        if self._order.config.session.mode == "snapshot":
            for n, unit in enumerate(self._units):
                unit.outcome, unit.sent_outcome = sink.outcomes[2 * n + 1 : 2 * n + 3]
        return sink

    def _present_folder(self) -> SessionFolder | None:
        return self._log.folder if self._writer.file else None

    def tell_refused(self, refused: Sequence[str]) -> None:
        """Tell what the machine refuses this process, though it permitted it when it was asked."""
        for text in refused:
            self._tell("error", "recorder", text)

    def _sources(self) -> list[Source]:
        """Ticks, and what is received and sent on each link; nothing is ever sent on a link that may not."""
        log = self._log
        sources, used = [Source(TICK_LINK, log.tick_channel, self._ticks)], [True]
        for unit, described in zip(self._units, self._order.config.link, strict=True):
            received, sent = log.channels(unit.link.name)
            sources.append(Source(unit.link.name, received, unit.received))
            sources.append(Source(unit.link.name, sent, unit.sent))
            used += True, described.transmit
        if self._snapshot:
            for source, keep in zip(sources, self._snapshot.keepers, strict=True):
                source.keep = keep
        if self._order.config.session.mode == "snapshot":
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
        with_beat(self._beat, self._hand_on_early)
        helpers = [self._start("health", self._watch), self._start("storage", self._tend_storage)]
        self._sender.start()
        await self._stop.wait()
        await self._finish(readers, helpers)
        loop.remove_reader(self._channel.fileno())

    def _start(self, name: str, make: Callable[[], Any]) -> asyncio.Task[None]:
        return asyncio.create_task(keep_running(name, make, self._report), name=name)

    def _beat(self) -> None:
        """Every 20 ms: a tick frame, so that silence has a time too; what has come until then goes on with it."""
        with guarded("ticks", self._report):
            now = self._clock.now_ns()
            self._notice_pause(now)
            self._tick((b"",), (now,))
            self._intake.hand_on()
            self._wake_writer()

    def _hand_on_early(self) -> None:
        """An altimeter has sent something: navigation gets it now, the file with the beat."""
        with guarded("early frames", self._report):
            self._intake.hand_on()

    def _notice_pause(self, now_ns: int) -> None:
        """A process that stood still has not waited for its medium."""
        if pause_s := self._reception.on_turn(now_ns):
            self._writer.paused(pause_s)

    def _tell_reception(self, now_ns: int, *, final: bool = False) -> None:
        links = [(unit.link.name, unit.link.status) for unit in self._units]
        for level, source, text in self._reception.events(now_ns, links, final=final):
            self._tell(level, source, text)

    async def _watch(self) -> None:
        """Health to the supervisor twice a second; ledger and clocks into the file once a second."""
        turn = 0
        while True:
            now = self._clock.now_ns()
            self._notice_pause(now)
            self._tell_reception(now)
            self._channel.send({"health": self._health(now)})
            if turn % round(LEDGER_PERIOD_S / HEALTH_PERIOD_S) == 0:
                self._writer.note("/fti/ledger", now, self._books.note(now))
                report_clocks(self._clock, self._writer.note, self._tell, self._channel.send)
            turn += 1
            await _until_beat(HEALTH_PERIOD_S)

    async def _tend_storage(self) -> None:
        """The first file, and every change of what becomes of the files."""
        await self._begin_recording()
        while True:
            self._notice_pause(self._clock.now_ns())
            self._writer.tend()
            self._storage.tell_changes()
            if self._snapshot:
                self._snapshot.tell_overflow()
            await _until_beat(TEND_PERIOD_S)

    async def _begin_recording(self) -> None:
        """Wait for the first file, or for the reason why there is none yet, and tell it."""
        deadline = self._clock.now_ns() + round(FIRST_FILE_S * SECOND_NS)
        while not (self._writer.file or self._writer.hopeless or self._clock.now_ns() > deadline):
            self._writer.tend()
            await asyncio.sleep(FIRST_LOOK_S)
        if file := self._writer.file:
            self._channel.send({"ready": True, "file": str(file)})
        else:
            self._channel.send({"ready": True, "fault": self._writer.state()[1]})

    def _on_control(self) -> None:
        for message in self._channel.receive():
            with guarded("control", self._report):
                self._obey(message)
        if self._channel.ended:
            asyncio.get_running_loop().remove_reader(self._channel.fileno())
            self._stop.set()

    def _obey(self, message: Message) -> None:
        if "stop" in message:
            self._stop.set()
        elif "note" in message:
            note = message["note"]
            self._writer.note(note["topic"], note["t_ns"], note["content"])
        elif "trigger" in message and self._snapshot:
            self._snapshot.trigger(message["trigger"], message["t_ns"])
        elif "send" in message:
            self._sender.take(message["send"])

    def _dropped(self) -> dict[str, Dropped]:
        """What was dropped of each link."""
        return {unit.link.name: Dropped.of(unit.received.stats, unit.link.status) for unit in self._units}

    def _tell_number(self, number: int, confirmed: bool) -> None:
        """The next recorder must know it, also when this one is killed before the file is there."""
        self._channel.send({"file_number": {"number": number, "confirmed": confirmed}})

    def _report(self, unit: str, error: Exception) -> None:
        self._tell("error", unit, f"{type(error).__name__}: {error}")

    def _tell(self, level: str, source: str, text: str) -> None:
        event = {"level": level, "source": source, "text": text, "t_ns": self._clock.now_ns()}
        self._channel.send({"event": event})

    # ------------------------------------------------------------------------------------------------- ending

    async def _finish(self, readers: list[asyncio.Task[None]], helpers: list[asyncio.Task[None]]) -> None:
        """Sending ended, kernel queues drained, readers stopped, buffers written, file closed, ring ended: in order."""
        await self._sender.stop()
        await asyncio.gather(*(self._drain(unit.link) for unit in self._units))
        without_beat(self._beat, self._hand_on_early)
        for task in (*readers, *helpers):
            task.cancel()
        await asyncio.gather(*readers, *helpers, return_exceptions=True)
        self._tell_reception(self._clock.now_ns(), final=True)
        self._intake.hand_on()
        await asyncio.to_thread(self._writer.stop)
        if self._snapshot:
            await asyncio.to_thread(self._snapshot.stop)
        now = self._clock.now_ns()
        self._writer.note("/fti/ledger", now, self._books.note(now, final=True))
        await asyncio.to_thread(self._writer.finish)
        self._ring.end()
        self._channel.send({"health": self._health(now)})
        self._channel.send({"stopped": self._describe_end(now)})

    def _describe_end(self, now: int) -> dict[str, Any]:
        """See ``fti.service.session_result``."""
        unsafe = [burst for source in self._writer.sources for burst in source.unsafe]
        return {
            "ledger": self._books.note(now, final=True),
            "ledger_recorded": self._writer.notes_recorded,
            "fault": self._writer.fault,
            "unsafe_frames": sum(len(frames) for _, _, frames, _ in unsafe),
            "unsafe_bytes": sum(payload for *_, payload in unsafe),
        }

    async def _drain(self, link: Link) -> None:
        with guarded(link.name, self._report):
            await link.drain()

    # ------------------------------------------------------------------------------------------------- telling

    def _health(self, now: int) -> dict[str, Any]:
        return {
            "t_ns": now,
            "links": {unit.link.name: link_health(unit, now) for unit in self._units},
            "storage": self._storage.health(),
            "snapshot": self._snapshot.health() if self._snapshot else None,
            "next_seq": self._intake.seq,
        }


async def _until_beat(period_s: float) -> None:
    """Until the next multiple of a period."""
    now = asyncio.get_running_loop().time()
    await asyncio.sleep(next_beat(now, period_s) - now)


def _settings(link: Any) -> dict[str, str]:
    """What the channel metadata says of a link: everything that the configuration says."""
    return {key: str(value) for key, value in link.model_dump().items() if key not in ("name", "kind")}
