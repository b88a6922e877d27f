"""A flight as fast as it can be computed: emulated frames go straight into the daemon's chain, in a time of their own.

Nothing is opened, nobody waits: the emulator's streams run on a clock that jumps from instant to instant, each message
is one frame, and what the daemon would record is written into a session: frames, ticks, measurements, outputs, events,
alarms, health and ledger.  The same scenario and software give the same session, bit for bit.

What only real ports have is not there: what a line takes at its baud rate, what a controller or an adapter says of
itself, what the kernel does to stamps, processes that end.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, ClassVar

from fti.clock import Clock, FakeClock
from fti.config import Config, Link
from fti.devices import bind_devices, parse_reference, read_texts
from fti.hil.emulator import Emulator, make_environment
from fti.hil.environment import Environment
from fti.hil.ports.counters import EndpointCounters
from fti.hil.ports.endpoints import Endpoint
from fti.hil.ports.serial_base import Responder
from fti.hil.scenario import Scenario
from fti.hil.scheduler import Stream
from fti.logger.derived_log import DerivedLog
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.schemas import ALARM_REPORT_TOPIC
from fti.logger.session import CONFIG_ATTACHMENT, SessionFolder
from fti.service.navigation.decode_chain import Chain, ChainOutput
from fti.service.navigation.device_monitor import DeviceMonitor
from fti.service.navigation.terrain_loader import load_terrain
from fti.service.supervisor.alarm_board import AlarmBoard
from fti.service.supervisor.health import HealthBoard
from fti.types import TICK_LINK, TICK_PERIOD_NS, Event, LinkState, RawFrame

SECOND_NS = 1_000_000_000
#: FTI time at which every such session begins: 2026-01-01, 00:00 UTC.
BEGIN_NS = 1_767_225_600 * SECOND_NS
#: The daemon has run for so many ticks before the flight begins.
LEAD_TICKS = 50
HEALTH_PERIOD_S = 0.5
SILENCE_TIMEOUT_NS = SECOND_NS
FLUSH_PERIOD_TICKS = 250
#: Measurements are kept at this rate of each kind: what comes of them is kept whole.
DECIMATE_HZ = 5.0


class MemoryEndpoint:
    """A link without a port: what is sent is received at once."""

    is_stream: ClassVar[bool] = False

    def __init__(self, receive: Callable[[bytes], None]) -> None:
        self.counters = EndpointCounters()
        self._receive = receive

    async def open(self) -> None:
        """Nothing to open."""

    async def wait_for_reader(self) -> None:
        """Somebody always listens."""

    def send(self, data: bytes) -> None:
        """Hand over."""
        self.counters.messages += 1
        self.counters.bytes += len(data)
        self._receive(data)

    async def send_all(self, data: bytes) -> None:
        """Hand over."""
        self.send(data)

    async def drain(self) -> None:
        """It is."""

    def close(self) -> None:
        """Nothing to close."""


class MemoryStreamEndpoint(MemoryEndpoint):
    """A serial line without a port."""

    is_stream: ClassVar[bool] = True


class MemoryBackend:
    """The bench of such a flight.  receive : gets each message with the name of its link"""

    is_real_time: ClassVar[bool] = False

    def __init__(self, receive: Callable[[str, bytes], None], streams: Sequence[Stream]) -> None:
        self._time = FakeClock(BEGIN_NS)
        self.clock: Clock = self._time
        self._receive, self._streams = receive, streams

    def make_endpoint(self, link: Link, respond: Responder) -> Endpoint:
        """A wire.  The chain asks nothing, so that nothing is answered."""
        kind = MemoryStreamEndpoint if link.kind == "serial" else MemoryEndpoint
        return kind(lambda data: self._receive(link.name, data))

    async def sleep(self, seconds: float) -> None:
        """The clock jumps, by a whole nanosecond at least, so that it gets there."""
        self._time.time_ns += math.ceil(seconds * SECOND_NS)

    def streams(self, start_ns: int) -> Sequence[Stream]:
        """What the daemon does by the clock."""
        return self._streams


class TickStream:
    """The ticks of the recorder, as a stream of the scheduler."""

    def __init__(self, tick: Callable[[], None]) -> None:
        self._tick = tick
        self._k = 0

    def due_s(self) -> float | None:
        """When the next tick falls."""
        return self._k * TICK_PERIOD_NS / SECOND_NS

    async def send(self) -> None:
        """Tick."""
        self._k += 1
        self._tick()


class OfflineSession:
    """What the daemon would record of the frames that it is given."""

    def __init__(self, config: Config, folder: SessionFolder, metadata: dict[str, str]) -> None:
        texts = read_texts(config)
        devices = bind_devices(config, texts)
        self._links = {link.name: link.kind for link in config.link}
        self._chain = Chain(config, devices, parse_reference(config, texts))
        self._diagnosis = DeviceMonitor(config, self._chain)
        self._board = HealthBoard({**metadata, "folder": folder.path.name, "started_ns": 0, "state": "recording"})
        self._seq = self._ticks = self._health_count = 0
        self._frames: Counter[str] = Counter()
        self._bytes: Counter[str] = Counter()
        self._last_ns: dict[str, int] = {}
        about: dict[str, Any] = {
            "split_s": config.session.split_s,
            "split_mb": config.session.split_mb,
            "attachments": [
                (n, "text/plain", t.encode()) for n, t in {CONFIG_ATTACHMENT: config.text, **texts}.items()
            ],
            "metadata": {"fti": metadata},
        }
        self._raw = RawLog(folder, [RawTopic(name, kind, {}) for name, kind in self._links.items()], **about)
        self._derived = DerivedLog(folder, decimate_hz=DECIMATE_HZ, **about)
        # Reports and health have their own times, and nobody listens to the list: its clock may stand.
        self._alarms = AlarmBoard(FakeClock(BEGIN_NS), lambda topic, payload: None, self._raw.json, lambda: None)
        if config.nav.terrain:
            ground = load_terrain(config.nav.terrain)
            self._keep(self._chain.set_terrain(ground, None, -1, BEGIN_NS - LEAD_TICKS * TICK_PERIOD_NS))

    def receive(self, link: str, data: bytes, t_ns: int) -> None:
        """A frame."""
        self._frames[link] += 1
        self._bytes[link] += len(data)
        self._last_ns[link] = t_ns
        frame = RawFrame(link, self._seq, t_ns, data)
        self._raw.frame(link, frame.seq, t_ns, data)
        self._take(frame)

    def tick(self, t_ns: int) -> None:
        """A tick, and what falls due with it."""
        frame = RawFrame(TICK_LINK, self._seq, t_ns, b"")
        self._raw.tick(frame.seq, t_ns)
        self._take(frame)
        if self._ticks % round(HEALTH_PERIOD_S * SECOND_NS / TICK_PERIOD_NS) == 0:
            self._publish_health(t_ns)
        self._ticks += 1
        if self._ticks % FLUSH_PERIOD_TICKS == 0:
            self._raw.flush()
            self._derived.flush()

    def close(self) -> None:
        """Finish the files."""
        self._raw.close()
        self._derived.close()

    def _take(self, frame: RawFrame) -> None:
        self._seq += 1
        self._diagnosis.feed(frame)
        self._keep(self._chain.feed(frame))

    def _keep(self, products: ChainOutput) -> None:
        for device, measurement in products.measurements:
            self._derived.measurement(device, measurement)
        for topic, t_ns, content in products.notes:
            self._derived.note(topic, t_ns, content)
            if topic == ALARM_REPORT_TOPIC:
                self._alarms.handle_report(content)
        for output in products.outputs:
            self._derived.output(output)
            if isinstance(output, Event):
                self._raw.json("/fti/event", output.t_ns, asdict(output))

    def _publish_health(self, t_ns: int) -> None:
        """Told twice a second, recorded once a second, as the daemon does."""
        self._board.navigation = {"devices": self._diagnosis.devices(t_ns), "navigation": {"lag_ms": 0.0}}
        self._board.recorder = {"t_ns": t_ns, "links": {name: self._link(name, t_ns) for name in self._links}}
        health = self._board.compose(t_ns, ())
        self._alarms.handle_health(health)
        self._health_count += 1
        if self._health_count % 2 == 0:
            self._raw.json("/fti/health", t_ns, health)

    def _link(self, name: str, t_ns: int) -> dict[str, Any]:
        last_ns = self._last_ns.get(name)
        heard = last_ns is not None and t_ns - last_ns < SILENCE_TIMEOUT_NS
        state = LinkState.GOOD if heard else LinkState.SILENT
        counts = {"frames": self._frames[name], "bytes": self._bytes[name]}
        return {"kind": self._links[name], "state": state, "hint": "", **counts}


def fly(
    config: Config, scenario: Scenario, out: Path, *, world: Environment | None = None, until_s: float | None = None
) -> Path:
    """Fly a scenario past the chain; returns the session folder below ``out``, which has the truth too.

    world : made from the scenario when None; until_s : the flight is cut off there [s].  Raises what the emulator
    raises; what was recorded until then is closed in good order.
    """
    world = world or make_environment(scenario)
    folder = SessionFolder.create(out, config.session.name, BEGIN_NS)
    session = OfflineSession(config, folder, {"name": config.session.name, "origin": "hil", "accelerated": "true"})
    with contextlib.closing(session):
        for k in range(-LEAD_TICKS, 0):
            session.tick(BEGIN_NS + k * TICK_PERIOD_NS)
        backend = MemoryBackend(
            lambda link, data: session.receive(link, data, backend.clock.now_ns()),
            [TickStream(lambda: session.tick(backend.clock.now_ns()))],
        )
        emulator = Emulator(config, scenario, backend, truth=folder.next_path("truth"), world=world)
        emulator.start()
        asyncio.run(emulator.run(duration_s=world.duration if until_s is None else min(until_s, world.duration)))
    return folder.path
