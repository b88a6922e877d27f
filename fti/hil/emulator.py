"""The emulator: the far end of every link of the daemon's configuration during a scenario.

Life cycle: constructed -> ``prepare`` (terrain, beams and sensors of the whole flight; seconds) -> ``run`` opens the
endpoints and sets ``ready`` -> ``start`` lets the flight begin (it may be called before) -> the flight ends, or
``stop`` is set.  Endpoints are open and answer before the flight begins, so that a daemon can connect early.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from fti.config import Config
from fti.constants import SECOND_NS
from fti.devices import read_texts
from fti.errors import MissingError
from fti.hil.device_pipeline import DevicePipeline
from fti.hil.device_streams import BabbleStream, SensorStream, StatusStream
from fti.hil.environment import Environment
from fti.hil.io_backend import IoBackend
from fti.hil.ports.counters import EndpointCounters
from fti.hil.ports.endpoints import Endpoint, SlcanEndpoint, open_endpoints, run_until
from fti.hil.ports.pty import PtyEndpoint
from fti.hil.ports.pty_delay import PtyDelay
from fti.hil.power import PowerUnit
from fti.hil.report import TransmissionReport, lateness_by_link
from fti.hil.scenario import Scenario
from fti.hil.scheduler import Scheduler, Stream
from fti.hil.sensors import SimulatedSensor, make_sensors
from fti.hil.sensors.fault_effect_check import check_fault_effects
from fti.hil.sensors.intended_values import intended_values
from fti.hil.sensors.power_unit import connect_power
from fti.hil.sensors.quantity_check import check_fault_quantities
from fti.hil.sensors.sent_rates import sent_rates
from fti.hil.tables.fault_base import LinkFault
from fti.hil.tables.fault_types import Babbling, BusOff, CanStatus
from fti.hil.tables.flights import WaypointFlight
from fti.hil.tables.jsbsim_options import JsbsimFlight
from fti.hil.truth_log import TruthLog, TruthRows
from fti.latency_histogram import LatencyHistogram
from fti.logger.session import CONFIG_ATTACHMENT
from fti.nav.integrity.approach import ApproachPath, load_airfield
from fti.terrain import demo_scene
from fti.terrain.demo_coast import demo_coast
from fti.terrain.demo_region import demo_region
from fti.terrain.terrain import Terrain

#: Time for the lines to send their backlog after the flight.
DRAIN_S = 2.0


class Emulator:
    """Emulates the devices of a configuration.

    backend : clock and ports; truth : file for the ground truth, or None; world : made from the scenario when None
    """

    def __init__(
        self,
        config: Config,
        scenario: Scenario,
        backend: IoBackend,
        *,
        truth: Path | None = None,
        world: Environment | None = None,
    ) -> None:
        self.ready = asyncio.Event()
        self.config, self.scenario, self.backend = config, scenario, backend
        self._truth, self._world = truth, world
        self._truth_rows: TruthRows | None = None
        self._sensors: list[SimulatedSensor] | None = None
        self.power = PowerUnit(())
        self._endpoints: dict[str, Endpoint] = {}
        self._started = asyncio.Event()
        self._scheduler: Scheduler | None = None
        self._start_ns: int | None = None
        self._devices: list[SensorStream] = []
        self._sent_before: dict[str, EndpointCounters] = {}

    @property
    def report(self) -> TransmissionReport:
        """Messages sent so far and their lateness.  The call takes milliseconds, mostly for the link statistics."""
        return replace(self.brief_report, link_lateness=lateness_by_link([device.meter for device in self._devices]))

    @property
    def brief_report(self) -> TransmissionReport:
        """The report without the lateness of each link; the call takes about 30 us per device."""
        late = self._scheduler.lateness if self._scheduler else LatencyHistogram().summary
        counters = {name: endpoint.counters for name, endpoint in self._endpoints.items()}
        return TransmissionReport(counters, late, rates=[device.meter.rate for device in self._devices])

    @property
    def flight_s(self) -> float | None:
        """Time of the flight [s]; None before it begins."""
        return None if self._start_ns is None else (self.backend.clock.now_ns() - self._start_ns) / SECOND_NS

    @property
    def duration_s(self) -> float | None:
        """Duration of the flight [s]; None before ``prepare``."""
        return self._world.duration if self._world else None

    @property
    def remarks(self) -> Sequence[str]:
        """Remarks on the flight, for the user before it begins; none before ``prepare``."""
        return self._world.remarks if self._world else ()

    @property
    def sensors(self) -> Sequence[SimulatedSensor]:
        """The devices; none before ``prepare``."""
        return self._sensors or ()

    @property
    def messages(self) -> dict[str, int]:
        """Number of messages that each device has sent in the flight."""
        return {device.meter.name: device.messages for device in self._devices}

    def prepare(self, progress: Callable[[str], None] = lambda _: None, until_s: float = float("inf")) -> None:
        """Load the terrain, compute the measurements of every sensor, and the truth until until_s [s].

        progress : called with each step
        """
        if self._sensors is not None:
            return
        progress(f"preparing terrain of {self.scenario.airfield}")
        self._world = self._world or make_environment(self.scenario, progress)
        self._sensors = make_sensors(self.config, self._world, self.scenario.seed, progress)
        self.power = connect_power(self._sensors, self.scenario)
        check_fault_quantities(self._sensors, self._world)
        check_fault_effects(self._sensors, self._world)
        if self._truth:
            progress("preparing truth file")
            altimeters = [device for device in self.config.device if device.altimeter]
            rates, intended = sent_rates(self._sensors), intended_values(self._sensors)
            self._truth_rows = TruthRows(self._world, altimeters, rates, intended, until_s)

    def start(self) -> None:
        """Let the flight begin as soon as the endpoints are open."""
        self._started.set()

    async def wait_for_readers(self) -> None:
        """Wait until the daemon has opened every serial line, slcan channel and UDP port."""
        await self.ready.wait()
        for endpoint in self._endpoints.values():
            await endpoint.wait_for_reader()

    async def run(
        self,
        duration_s: float | None = None,
        stop: asyncio.Event | None = None,
        on_finish: Callable[[], None] | None = None,
    ) -> TransmissionReport:
        """Open the endpoints, wait for ``start``, fly at most duration_s [s] of the flight.

        on_finish : called after the last message, before the endpoints are closed
        """
        until_s = float("inf") if duration_s is None else duration_s
        self.prepare(until_s=until_s)
        assert self._sensors is not None
        ended = stop or asyncio.Event()
        lines = [DevicePipeline(s, self.scenario, until_s, partial(self.power.is_on, s.name)) for s in self._sensors]
        self._endpoints = self._make_endpoints(lines)
        with self._truth_log() as truth:
            async with open_endpoints(self._endpoints):
                self.ready.set()
                await run_until(self._started.wait(), ended)
                await self._fly(lines, truth, until_s, ended)
                if not ended.is_set():
                    await self._drain()
                if truth is not None:
                    truth.note_end(self._sent_in_flight())
                if on_finish is not None:
                    on_finish()
        return self.report

    def _sent_in_flight(self) -> dict[str, EndpointCounters]:
        """Messages and bytes of each endpoint since the flight began, answers to the daemon included."""
        return {
            name: EndpointCounters(endpoint.counters.messages - before.messages, endpoint.counters.bytes - before.bytes)
            for name, endpoint in self._endpoints.items()
            if (before := self._sent_before.get(name))
        }

    async def _drain(self) -> None:
        """Wait until the lines have sent their backlog, at most ``DRAIN_S``: a line may have no reader."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(DRAIN_S):
                await asyncio.gather(*(endpoint.drain() for endpoint in self._endpoints.values()))

    def _make_endpoints(self, lines: list[DevicePipeline]) -> dict[str, Endpoint]:
        def respond(link: str) -> Callable[[bytes], list[bytes]]:
            on_link = [line for line in lines if line.sensor.link == link]

            def answer(data: bytes) -> list[bytes]:
                t = -1.0 if self.flight_s is None else self.flight_s
                return [message for line in on_link for message in line.respond(data, t)]

            return answer

        return {link.name: self.backend.make_endpoint(link, respond(link.name)) for link in self.config.link}

    def _truth_log(self) -> contextlib.AbstractContextManager[TruthLog | None]:
        """The truth file with the configuration and the readable files that it names, as in a session."""
        if self._truth is None or self._truth_rows is None:
            return contextlib.nullcontext()
        texts = {CONFIG_ATTACHMENT: self.config.text} if self.config.text else {}
        with contextlib.suppress(MissingError):  # the emulator does not need the daemon's approach file
            texts |= read_texts(self.config)
        real_time = self.backend.is_real_time
        return contextlib.closing(TruthLog(self._truth, self._truth_rows, real_time=real_time, texts=texts))

    def _line_faults(self) -> list[Stream]:
        buses = [link.name for link in self.config.link if link.kind == "can"]

        def on(fault: LinkFault) -> list[Endpoint]:
            return [self._endpoints[name] for name in fault.links or buses]

        def adapters(fault: LinkFault) -> list[SlcanEndpoint]:
            return [e for e in on(fault) if isinstance(e, SlcanEndpoint)]

        faults = self.scenario.fault
        babbling: list[Stream] = [BabbleStream(f, on(f)) for f in faults if isinstance(f, Babbling)]
        return babbling + [StatusStream(f, adapters(f)) for f in faults if isinstance(f, CanStatus | BusOff)]

    async def _fly(
        self,
        lines: list[DevicePipeline],
        truth: TruthLog | None,
        until_s: float,
        stop: asyncio.Event,
    ) -> None:
        clock = self.backend.clock
        self._start_ns = start_ns = clock.now_ns()
        self._sent_before = {name: replace(endpoint.counters) for name, endpoint in self._endpoints.items()}
        self._scheduler = Scheduler(
            lambda: (clock.now_ns() - start_ns) / SECOND_NS, self.backend.sleep, can_prepare=self.backend.is_real_time
        )
        self._devices = [SensorStream(line, self._endpoints[line.sensor.link], start_ns) for line in lines]
        streams: list[Stream] = [*self._devices, *self._line_faults(), *self.backend.streams(start_ns)]
        with contextlib.ExitStack() as stack:
            if truth is not None:
                streams.append(truth.stream(start_ns, clock.now_ns))
                if any(isinstance(endpoint, PtyEndpoint) for endpoint in self._endpoints.values()):
                    end_s = self._world.duration if self._world else 0.0
                    streams.append(stack.enter_context(PtyDelay(clock.now_ns, end_s, truth.note_late)))
            await self._scheduler.run(streams, stop, until_s)


#: Geoid above the ellipsoid at the demo airfield [m] (EGM96, rounded).
DEMO_UNDULATION = -31.0


def make_environment(scenario: Scenario, progress: Callable[[str], None] = lambda _: None) -> Environment:
    """The demo airfield with its terrain and the obstacles of the scenario; progress : called with each step.

    The terrain of ``demo`` is the whole demo region for JSBSim flights and where a waypoint lies beyond the strip below
    the approach.
    """
    airfield = load_airfield(demo_scene.DEMO_AIRFIELD.read_text(encoding="utf-8"), str(demo_scene.DEMO_AIRFIELD))
    return Environment(scenario, ApproachPath(airfield), _terrain(scenario), DEMO_UNDULATION, progress)


def _terrain(scenario: Scenario) -> Terrain:
    if scenario.airfield == "demo_coast":
        return demo_coast()
    terrain = demo_region() if isinstance(scenario.flight, JsbsimFlight) else demo_scene.demo_scene()
    if isinstance(scenario.flight, WaypointFlight):
        lat, lon = np.radians([(point.lat_deg, point.lon_deg) for point in scenario.flight.waypoint]).T
        if np.isnan(terrain.height(lat, lon)).any():
            terrain = demo_region()
    return terrain
