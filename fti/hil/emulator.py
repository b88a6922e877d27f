"""The emulator: the far end of every link of the daemon's configuration, flown through a scenario.

Life: made -> ``prepare`` (terrain, beams and sensors of the whole flight; seconds) -> ``run`` opens the endpoints and
sets ``ready`` -> ``start`` lets the flight begin (it may be called before) -> the flight ends, or ``stop`` is set.
Endpoints exist, and answer, before the flight begins: a daemon can connect to a device that does not talk yet.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from pathlib import Path

from fti.config import Config
from fti.hil.bench import Bench
from fti.hil.faults.kinds import CanStatus
from fti.hil.faults.values import DeviceFaults
from fti.hil.lateness import Histogram, Meter
from fti.hil.ports.endpoints import Endpoint, SlcanEndpoint, opened, until
from fti.hil.power import PowerUnit
from fti.hil.report import Report, lateness_by_link
from fti.hil.scenario import Scenario
from fti.hil.scheduler import Scheduler, Stream
from fti.hil.sensors import Sensor, make_sensors
from fti.hil.sensors.power_unit import distribute
from fti.hil.streams import SensorStream, StatusStream
from fti.hil.truth import TruthLog
from fti.hil.world import World
from fti.nav.approach import ApproachPath, load_airfield
from fti.terrain import scenes

SECOND_NS = 1_000_000_000


class Emulator:
    """Plays the devices of a configuration.

    bench : where the devices stand; truth : file for the truth, or None; world : made from the scenario when None
    """

    def __init__(
        self,
        config: Config,
        scenario: Scenario,
        bench: Bench,
        *,
        truth: Path | None = None,
        world: World | None = None,
    ) -> None:
        self.ready = asyncio.Event()
        self._config, self._scenario, self._bench = config, scenario, bench
        self._truth, self._world = truth, world
        self._sensors: list[Sensor] | None = None
        self.power = PowerUnit(())
        self._endpoints: dict[str, Endpoint] = {}
        self._started = asyncio.Event()
        self._scheduler: Scheduler | None = None
        self._meters: list[Meter] = []

    @property
    def report(self) -> Report:
        """What was sent so far and how late, at any time; it costs less than a millisecond."""
        late = self._scheduler.lateness if self._scheduler else Histogram().lateness
        sent = {name: endpoint.sent for name, endpoint in self._endpoints.items()}
        return Report(sent, late, lateness_by_link(self._meters), [meter.rate for meter in self._meters])

    def prepare(self, progress: Callable[[str], None] = lambda _: None) -> None:
        """Make the terrain and compute what every sensor will measure.  progress : told each step."""
        if self._sensors is not None:
            return
        progress(f"terrain of {self._scenario.airfield}")
        self._world = self._world or make_world(self._scenario)
        self._sensors = make_sensors(self._config, self._world, self._scenario.seed, progress)
        self.power = distribute(self._sensors, self._scenario)

    def start(self) -> None:
        """Let the flight begin (as soon as the endpoints are there)."""
        self._started.set()

    async def attended(self) -> None:
        """Wait until the daemon has opened every serial line, slcan channel and UDP port."""
        await self.ready.wait()
        for endpoint in self._endpoints.values():
            await endpoint.reader_ready()

    async def run(self, duration_s: float | None = None, stop: asyncio.Event | None = None) -> Report:
        """Open the endpoints, wait for ``start``, fly; at most duration_s [s] of the flight."""
        self.prepare()
        assert self._sensors is not None
        ended = stop or asyncio.Event()
        self._endpoints = self._make_endpoints(self._sensors)
        with self._truth_log() as truth:
            async with opened(self._endpoints):
                self.ready.set()
                await until(self._started.wait(), ended)
                await self._fly(self._sensors, truth, duration_s, ended)
        return self.report

    def _make_endpoints(self, sensors: list[Sensor]) -> dict[str, Endpoint]:
        def respond(link: str) -> Callable[[bytes], list[bytes]]:
            there = [s for s in sensors if s.link == link]
            return lambda data: [a for s in there if self.power.is_on(s.name) for a in s.encoder.respond(data)]

        return {link.name: self._bench.make_endpoint(link, respond(link.name)) for link in self._config.link}

    def _truth_log(self) -> contextlib.AbstractContextManager[TruthLog | None]:
        if self._truth is None:
            return contextlib.nullcontext()
        assert self._world is not None
        return contextlib.closing(TruthLog(self._truth, self._world))

    def _status_faults(self) -> list[Stream]:
        def adapters(fault: CanStatus) -> list[SlcanEndpoint]:
            named = fault.links or self._endpoints
            return [e for name, e in self._endpoints.items() if name in named and isinstance(e, SlcanEndpoint)]

        return [StatusStream(f, adapters(f)) for f in self._scenario.fault if isinstance(f, CanStatus)]

    async def _fly(
        self,
        sensors: list[Sensor],
        truth: TruthLog | None,
        duration_s: float | None,
        stop: asyncio.Event,
    ) -> None:
        clock = self._bench.clock
        start_ns = clock.now_ns()
        self._scheduler = Scheduler(lambda: (clock.now_ns() - start_ns) / SECOND_NS, self._bench.sleep)
        devices = [
            SensorStream(s, DeviceFaults(s.name, self._scenario.fault), self._endpoints[s.link], start_ns, self.power)
            for s in sensors
        ]
        self._meters = [device.meter for device in devices]
        streams: list[Stream] = [*devices, *self._status_faults(), *self._bench.streams(start_ns)]
        if truth is not None:
            streams.append(truth.stream(start_ns, clock.now_ns))
        await self._scheduler.run(streams, stop, float("inf") if duration_s is None else duration_s)


#: Geoid above the ellipsoid at the demo airfield [m] (EGM96, rounded).
DEMO_UNDULATION = -31.0


def make_world(scenario: Scenario) -> World:
    """The demo airfield and its ground, with what the scenario puts on it."""
    airfield = load_airfield(scenes.DEMO_AIRFIELD.read_text(encoding="utf-8"), str(scenes.DEMO_AIRFIELD))
    return World(scenario, ApproachPath(airfield), scenes.demo_scene(), undulation=DEMO_UNDULATION)
