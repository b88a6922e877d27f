"""A flight faster than real time: emulated frames go through memory into the daemon's decode chain.

No port is opened and nothing waits (``fti.hil.memory_backend``).  Each message is one frame.  The session contains what
the daemon would record: frames, ticks, measurements, outputs, events, alarms, health and ledger.  The same scenario and
software give the same session, bit for bit.  Not modelled, in addition to what the backend leaves out: the end of
processes.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fti.clock import FakeClock
from fti.config import Config
from fti.constants import SECOND_NS
from fti.devices import bind_devices, parse_reference, read_texts
from fti.hil.emulator import Emulator, make_environment
from fti.hil.environment import Environment
from fti.hil.memory_backend import BEGIN_NS, MemoryBackend
from fti.hil.scenario import Scenario
from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import CONFIG_ATTACHMENT, SessionFolder
from fti.messages.control import NavigationReport, RecorderNote
from fti.messages.frames import TICK_LINK, TICK_PERIOD_NS, LinkState, RawFrame
from fti.messages.health import NavigationHealth
from fti.messages.notes import AlarmRecord, AlarmReportRecord
from fti.messages.outputs import Event
from fti.messages.tables import to_table
from fti.messages.topics import EVENT_TOPIC, HEALTH_TOPIC, note_message
from fti.service.navigation.decode_chain import Chain, ChainOutput
from fti.service.navigation.device_monitor import DeviceMonitor
from fti.service.navigation.terrain_areas import TerrainAreas, wanted_areas
from fti.service.navigation.terrain_loader import load_terrain
from fti.service.supervisor.alarm_board import AlarmBoard
from fti.service.supervisor.health import HealthBoard
from fti.service.supervisor.software_metadata import software_metadata

#: Ticks of the daemon before the flight begins.
LEAD_TICKS = 50
HEALTH_PERIOD_S = 0.5
SILENCE_TIMEOUT_NS = SECOND_NS
FLUSH_PERIOD_TICKS = 250
#: Measurements of each kind are recorded at this rate; outputs are recorded in full.
DECIMATE_HZ = 5.0


class TickStream:
    """The ticks of the recorder, as a stream of the scheduler."""

    def __init__(self, tick: Callable[[], None]) -> None:
        self._tick = tick
        self._k = 0

    def due_s(self) -> float | None:
        """Time of the next tick."""
        return self._k * TICK_PERIOD_NS / SECOND_NS

    async def send(self) -> None:
        """Tick."""
        self._k += 1
        self._tick()


class OfflineSession:
    """The session that the daemon would record from the frames."""

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
        settings = LogSettings(
            split_s=config.session.split_s,
            split_mb=config.session.split_mb,
            attachments=[(n, "text/plain", t.encode()) for n, t in {CONFIG_ATTACHMENT: config.text, **texts}.items()],
            metadata={"fti": metadata | software_metadata(config)},
        )
        self._raw = RawLog(folder, [RawTopic(name, kind, {}) for name, kind in self._links.items()], settings)
        self._derived = DerivedLog(folder, settings, decimate_hz=DECIMATE_HZ)
        # The clock of the alarm board may stand still: reports and health carry their own times.
        self._alarms = AlarmBoard(FakeClock(BEGIN_NS), lambda topic, payload: None, self._record_alarm, lambda: None)
        terrain = config.nav.terrain
        self._areas = TerrainAreas(terrain) if terrain and terrain.memory_mb is not None else None
        if terrain and not self._areas:
            ground = load_terrain(terrain)
            self._keep(self._chain.set_terrain(ground, None, -1, BEGIN_NS - LEAD_TICKS * TICK_PERIOD_NS))

    def receive(self, link: str, data: bytes, t_ns: int) -> None:
        """Record and decode a frame."""
        self._frames[link] += 1
        self._bytes[link] += len(data)
        self._last_ns[link] = t_ns
        frame = RawFrame(link, self._seq, t_ns, data)
        self._raw.write_frame(link, frame.seq, t_ns, data)
        self._take(frame)

    def tick(self, t_ns: int) -> None:
        """Record and process a tick; write health and flush files when they are due."""
        frame = RawFrame(TICK_LINK, self._seq, t_ns, b"")
        self._raw.write_tick(frame.seq, t_ns)
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
        products = self._chain.feed(frame)
        self._keep(products)
        for nav in wanted_areas(self._areas, (products,)):
            assert self._areas is not None
            loaded = self._areas.load(nav)
            self._keep(self._chain.set_terrain(loaded.ground, loaded.fault, frame.seq, frame.t_rx_ns))

    def _keep(self, products: ChainOutput) -> None:
        for device, measurement in products.measurements:
            self._derived.write_measurement(device, measurement)
        for note in products.notes:
            self._derived.write_note(note)
            if isinstance(note, AlarmReportRecord):
                self._alarms.handle_report(note)
        for output in products.outputs:
            self._derived.write_output(output)
            if isinstance(output, Event):
                self._raw.write_json(EVENT_TOPIC, output.t_ns, output)

    def _record_alarm(self, change: RecorderNote) -> None:
        if isinstance(change, AlarmRecord):  # the alarm board has no other notes
            self._raw.write_json(*note_message(change))

    def _publish_health(self, t_ns: int) -> None:
        """Compose health twice a second and record it once a second, as the daemon does."""
        report = NavigationReport(self._diagnosis.devices(t_ns), NavigationHealth(lag_ms=0.0))
        self._board.navigation = to_table(report)
        self._board.recorder = {"t_ns": t_ns, "links": {name: self._link(name, t_ns) for name in self._links}}
        health = self._board.compose(t_ns, ())
        self._alarms.handle_health(health)
        self._health_count += 1
        if self._health_count % 2 == 0:
            self._raw.write_json(HEALTH_TOPIC, t_ns, health)

    def _link(self, name: str, t_ns: int) -> dict[str, Any]:
        last_ns = self._last_ns.get(name)
        is_active = last_ns is not None and t_ns - last_ns < SILENCE_TIMEOUT_NS
        state = LinkState.GOOD if is_active else LinkState.SILENT
        counts = {"frames": self._frames[name], "bytes": self._bytes[name]}
        return {"kind": self._links[name], "state": state, "hint": "", **counts}


def fly(
    config: Config,
    scenario: Scenario,
    out: Path,
    *,
    world: Environment | None = None,
    until_s: float | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> Path:
    """Fly a scenario through the decode chain; returns the session folder below ``out``, with the truth file.

    world : made from the scenario when None; until_s : end of the flight [s]; progress : gets the completed share
    Raises the errors of the emulator; the files are closed properly in any case.
    """
    world = world or make_environment(scenario)
    duration_s = world.duration if until_s is None else min(until_s, world.duration)
    folder = SessionFolder.create(out, config.session.name, BEGIN_NS)
    session = OfflineSession(config, folder, {"name": config.session.name, "origin": "hil", "accelerated": "true"})
    with contextlib.closing(session):
        for k in range(-LEAD_TICKS, 0):
            session.tick(BEGIN_NS + k * TICK_PERIOD_NS)

        def tick() -> None:
            t_ns = backend.clock.now_ns()
            session.tick(t_ns)
            progress((t_ns - BEGIN_NS) / SECOND_NS / duration_s)

        backend = MemoryBackend(
            lambda link, data: session.receive(link, data, backend.clock.now_ns()), [TickStream(tick)]
        )
        emulator = Emulator(config, scenario, backend, truth=folder.next_path("truth"), world=world)
        emulator.start()
        asyncio.run(emulator.run(duration_s=duration_s))
    return folder.path
