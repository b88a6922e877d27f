"""A short flight through real links: what arrives decodes to the truth, faults included."""

from __future__ import annotations

import asyncio
import json
from contextlib import AsyncExitStack
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from mcap.reader import make_reader

from fti import config as configuration
from fti.canframe import unpack_can
from fti.clock import FakeClock, choose_epoch_ns
from fti.config import CanLink, Config, SerialLink
from fti.devices import bind_devices
from fti.errors import ConfigError
from fti.geodesy.formulas import SEMI_MAJOR
from fti.hil.device_streams import StatusStream
from fti.hil.emulator import Emulator, make_environment
from fti.hil.environment import Environment
from fti.hil.io_backend import PortBackend
from fti.hil.tables.fault_types import Babbling, BusOff, CanStatus, Cut, Fault
from fti.hil.tables.flights import ApproachFlight
from fti.hil.tables.schema import Scenario
from fti.hil.truth_log import TOPIC
from fti.messages.measurements import Attitude, Measurement, Position, RadioHeight, Range, StaticPressure
from tests.e2e.harness import with_free_ports
from tests.helpers import ROOT, until_async
from tests.hil.worlds import flat_terrain, path, scenario
from tests.links.bench import ReceivedFrames, run_link

FLIGHT_S = 1.5
M = TypeVar("M")
DEMO = ROOT / "configs" / "demo.toml"


def demo_config(tmp_path: Path) -> Config:
    """The demonstration on free ports, without the reference profile."""
    text = with_free_ports(DEMO.read_text()).partition("[nav.approach]")[0]
    file = tmp_path / "demo.toml"
    file.write_text(text)
    return configuration.with_links(configuration.load(file), tmp_path / "links")


def make(tmp_path: Path, config: Config, *faults: Fault, duration_s: float = FLIGHT_S) -> tuple[Emulator, Environment]:
    flight: Scenario = scenario(flight=ApproachFlight(duration_s=duration_s), fault=faults)
    world = Environment(flight, path(), flat_terrain(), undulation=47.0)
    epoch_ns = choose_epoch_ns()
    truth = tmp_path / "truth.mcap"
    return Emulator(config, flight, PortBackend(tmp_path / "links", epoch_ns), truth=truth, world=world), world


async def fly(emulator: Emulator, config: Config) -> dict[str, ReceivedFrames]:
    """Fly with every link of the configuration open; returns what each heard."""
    received = {}
    flying = asyncio.create_task(emulator.run())
    await emulator.ready.wait()
    async with AsyncExitStack() as stack:
        for link in config.link:
            _, received[link.name] = await stack.enter_async_context(run_link(link))
        await emulator.wait_for_readers()
        emulator.start()
        await flying
    return received


def decoded(config: Config, received: dict[str, ReceivedFrames], name: str) -> list[Measurement]:
    bound = next(b for b in bind_devices(config) if b.device.name == name)
    decoder, link = bound.make_decoder(), received[bound.device.link]
    return [m for data, t in zip(link.frames, link.times, strict=True) for m in decoder.feed(data, t)]


async def test_every_link_of_the_demonstration_carries_the_flight(tmp_path: Path) -> None:
    config = demo_config(tmp_path)
    emulator, world = make(tmp_path, config)
    received = await fly(emulator, config)
    middle = world.state(np.array([FLIGHT_S / 2]))

    def found(device: str, kind: type[M]) -> list[M]:
        return [m for m in decoded(config, received, device) if isinstance(m, kind)]

    heights = [m.height_agl for m in found("altimeter", RadioHeight)]
    assert len(heights) == pytest.approx(25 * FLIGHT_S, abs=3)
    assert heights[0] == pytest.approx(float(middle.alt[0] - world.ground(middle)[0]), abs=10.0)
    for device in ("ins", "gnss", "autopilot"):
        lats = [p.lat for p in found(device, Position) if p.lat is not None]
        assert abs(lats[len(lats) // 2] - middle.lat[0]) * SEMI_MAJOR < 60.0 * FLIGHT_S
    for device in ("ins", "ahrs", "autopilot"):
        rolls = [a.roll for a in found(device, Attitude) if a.roll is not None]
        assert rolls[len(rolls) // 2] == pytest.approx(float(middle.roll[0]), abs=0.05)
    assert [m for m in found("autopilot", Range) if m.valid]
    words = len(received["ahrs_line"].bytes) / 4
    assert words == pytest.approx(10 * 25 * FLIGHT_S, abs=3 * 10)  # nine labels, and which equipment it is
    pressures = [m.p_static for m in found("air_data", StaticPressure)]
    assert pressures[0] == pytest.approx(float(world.atmosphere.p_static(middle.alt[0] - 47.0)), abs=150.0)


async def test_the_truth_is_a_finished_file_with_every_quantity(tmp_path: Path) -> None:
    config = demo_config(tmp_path)
    emulator, _ = make(tmp_path, config)
    emulator.start()
    ports = [Path(link.port) for link in config.link if isinstance(link, SerialLink)]
    at_the_end = list[bool]()
    report = await emulator.run(on_finish=lambda: at_the_end.extend(port.exists() for port in ports))
    assert at_the_end == [True] * len(ports), "it is over before the ports are closed"
    assert not any(port.exists() for port in ports)
    with (tmp_path / "truth.mcap").open("rb") as file:
        messages = make_reader(file, validate_crcs=True).iter_messages(topics=[TOPIC])
        rows = [(m.log_time, json.loads(m.data)) for _, _, m in messages]
    assert len(rows) == round(FLIGHT_S * 25)
    assert all(t == row["t_ns"] for t, row in rows)
    np.testing.assert_allclose(np.diff([t for t, _ in rows]), 40_000_000, atol=1)
    row = rows[0][1]
    assert row["s"] == pytest.approx(path().x_gpi + 4500.0, abs=0.1)
    assert row["deviation"] == pytest.approx(row["dh"] / row["s"], abs=1e-4)
    assert abs(row["height_agl"] - 250.0) < 10.0
    assert report.lateness.messages > 0


async def test_no_environment_is_computed_during_the_flight(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = demo_config(tmp_path)
    emulator, world = make(tmp_path, config, duration_s=0.5)
    emulator.prepare()
    for name in ("state", "ground", "range_bounds"):
        monkeypatch.delattr(Environment, name)
    emulator.start()
    assert (await emulator.run()).lateness.messages > 0
    assert not hasattr(world, "range_bounds")


async def test_a_cut_device_is_silent_and_the_others_are_not(tmp_path: Path) -> None:
    config = demo_config(tmp_path)
    cut = Cut(kind="cut", devices=("altimeter",), from_s=0.0, to_s=100.0)
    received = await fly(make(tmp_path, config, cut, duration_s=0.5)[0], config)
    assert not received["radalt_line"].frames
    assert received["ins_eth"].frames


async def test_duration_and_stop_end_the_flight(tmp_path: Path) -> None:
    config = demo_config(tmp_path)
    emulator, _ = make(tmp_path, config, duration_s=60.0)
    emulator.start()
    report = await emulator.run(duration_s=0.2)
    assert 0 < report.links["ins_eth"].messages < 100
    again, _ = make(tmp_path / "again", config, duration_s=60.0)
    stop = asyncio.Event()
    task = asyncio.create_task(again.run(stop=stop))
    await again.ready.wait()
    stop.set()
    assert (await task).lateness.messages == 0


async def test_nothing_is_sent_before_the_start(tmp_path: Path) -> None:
    config = demo_config(tmp_path)
    emulator, _ = make(tmp_path, config, duration_s=0.3)
    task = asyncio.create_task(emulator.run())
    await emulator.ready.wait()
    await asyncio.wait([task], timeout=0.1)
    assert not task.done()
    assert {p.name for p in (tmp_path / "links").iterdir()} == {link.name for link in config.link if link.kind != "udp"}
    emulator.start()
    assert (await task).lateness.messages > 0
    assert not list((tmp_path / "links").iterdir())


def test_a_driver_without_a_model_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fti.hil.sensors import MODELS

    config = demo_config(tmp_path)
    monkeypatch.delitem(MODELS, "nmea0183")
    with pytest.raises(ConfigError, match="device 'gnss': no sensor model for driver 'nmea0183'; available: "):
        make(tmp_path, config)[0].prepare()


def test_the_demo_flight_stays_over_the_demo_terrain() -> None:
    world = make_environment(scenario())
    state = world.state(np.arange(0.0, 82.0, 0.5))
    height = state.alt - world.ground(state)
    assert np.isfinite(height).all()
    assert height.min() > 3.0


async def test_errors_of_a_can_controller_are_reported_while_they_last(tmp_path: Path) -> None:
    config = demo_config(tmp_path)
    link = next(link for link in config.link if isinstance(link, CanLink))
    fault = CanStatus(kind="can_status", flags=("data_overrun", "bus_error"), from_s=0.0, to_s=60.0)
    emulator, _ = make(tmp_path, config, fault)
    stop, clock = asyncio.Event(), FakeClock(0)
    flying = asyncio.create_task(emulator.run(stop=stop))
    await emulator.ready.wait()
    async with run_link(link, clock=clock) as (opened, _):
        emulator.start()
        errors = opened.status.errors

        def has_errors() -> bool:
            clock.advance(0.1)
            return bool(errors.get("slcan_data_overrun", 0) >= 3)

        await until_async(has_errors, 20)
        assert errors["slcan_bus_error"] == errors["slcan_data_overrun"]
        assert errors["slcan_rx_fifo_full"] == 0
        stop.set()
        await flying


async def test_on_a_bus_that_is_off_only_a_babbling_node_is_received(tmp_path: Path) -> None:
    """Through a real slcan adapter: no device gets a word in, and the adapter says that its bus is in trouble."""
    config = demo_config(tmp_path)
    link = next(link for link in config.link if isinstance(link, CanLink))
    off = BusOff(kind="bus_off", links=(link.name,), from_s=0.0, to_s=60.0)
    babbling = Babbling(kind="babbling", from_s=0.0, to_s=60.0, can_id=0x7FF, rate_hz=200.0)
    emulator, _ = make(tmp_path, config, off, babbling)
    stop, clock = asyncio.Event(), FakeClock(0)
    flying = asyncio.create_task(emulator.run(stop=stop))
    await emulator.ready.wait()
    async with run_link(link, clock=clock) as (opened, received):
        emulator.start()

        def has_errors() -> bool:
            clock.advance(0.1)
            return bool(opened.status.errors.get("slcan_bus_error", 0) and len(received.frames) > 50)

        await until_async(has_errors, 20)
        assert {unpack_can(frame).can_id for frame in received.frames} == {0x7FF}
        assert opened.status.errors["slcan_error_passive"]
        stop.set()
        await flying


def test_trouble_ends(tmp_path: Path) -> None:
    fault = CanStatus(kind="can_status", flags=("bus_error",), from_s=1.0, to_s=1.5)
    stream = StatusStream(fault, [])
    instants = []
    while (due := stream.due_s()) is not None:
        instants.append(due)
        asyncio.run(stream.send())
    assert instants == [1.0, 1.25]
