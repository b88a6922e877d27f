"""Two sensor buses of the research aircraft, emulated: pickups and air data share them, and the nodes take commands."""

from __future__ import annotations

import asyncio
import math
from contextlib import AsyncExitStack
from pathlib import Path

import numpy as np
import pytest

from fti import config as configuration
from fti.canframe import unpack_can
from fti.config import Config
from fti.devices import bind_devices
from fti.drivers import deflection_pickups
from fti.drivers.deflection_pickups.table import CalibrationTable
from fti.hil.sensors.deflections import deflections, flap_angle_deg, raw_counts
from fti.messages.measurements import (
    Ack,
    Calibration,
    DmeRange,
    Measurement,
    Reading,
    StaticPressure,
    SurfaceDeflection,
)
from tests.helpers import ROOT, until_async
from tests.hil.test_emulator import decoded, fly, make
from tests.hil.test_sensors import environment, sensor
from tests.links.bench import run_link

FLIGHT_S = 1.5
BUSES = """
[session]
name = "buses"
directory = "out"

[[link]]
name = "sensor_bus_1"
kind = "can"
interface = "slcan"
channel = "bus_1"
bitrate = 500000
transmit = true

[[link]]
name = "sensor_bus_2"
kind = "can"
interface = "slcan"
channel = "bus_2"
bitrate = 500000

[[device]]
name = "pickups_1"
link = "sensor_bus_1"
driver = "deflection_pickups"
rate_hz = 10
options = { nodes = ["left_wing", "flaps", "pilot_controls"], calibration_file = "pickups.csv" }

[[device]]
name = "vessel"
link = "sensor_bus_1"
driver = "dbc"
options = { dbc_file = "nmea2000.dbc" }

[[device]]
name = "pickups_2"
link = "sensor_bus_2"
driver = "deflection_pickups"
rate_hz = 10
options = { nodes = ["tail", "right_wing"], calibration_file = "pickups.csv" }

[[device]]
name = "air_data"
link = "sensor_bus_2"
driver = "canaerospace"
rate_hz = 10
options = { node = 1 }
"""


@pytest.fixture
def config(tmp_path: Path) -> Config:
    (tmp_path / "pickups.csv").write_text((ROOT / "configs/calibrations/da42_pickups.csv").read_text())
    (tmp_path / "nmea2000.dbc").write_text((ROOT / "configs/dbc/nmea2000.dbc").read_text())
    (tmp_path / "buses.toml").write_text(BUSES)
    return configuration.with_links(configuration.load(tmp_path / "buses.toml"), tmp_path / "links")


async def test_pickups_and_air_data_share_their_buses(tmp_path: Path, config: Config) -> None:
    emulator, world = make(tmp_path, config, duration_s=FLIGHT_S)
    received = await fly(emulator, config)
    truth = deflections(world.state(np.array([0.0, FLIGHT_S])))

    def found(device: str, kind: type[Measurement]) -> list[Measurement]:
        return [m for m in decoded(config, received, device) if isinstance(m, kind)]

    for device, count in (("pickups_1", 6), ("pickups_2", 4)):
        surfaces = [m for m in found(device, SurfaceDeflection) if isinstance(m, SurfaceDeflection)]
        assert len({m.surface for m in surfaces}) == count
        assert len(surfaces) == pytest.approx(count * 10 * FLIGHT_S, abs=count)
        assert all(m.raw is not None and m.valid for m in surfaces)
        for m in surfaces:
            assert m.deflection == pytest.approx(truth[m.surface].mean(), abs=math.radians(2.0))
    assert not found("air_data", SurfaceDeflection)
    assert len(found("air_data", StaticPressure)) == pytest.approx(10 * FLIGHT_S, abs=1)
    assert len(found("air_data", DmeRange)) == pytest.approx(4 * 10 * FLIGHT_S, abs=4)
    assert [m for m in found("vessel", Reading) if isinstance(m, Reading) and m.name == "water_depth.depth"]


async def test_a_command_goes_over_the_bus_to_the_node_and_its_answer_comes_back(
    tmp_path: Path, config: Config
) -> None:
    emulator, _ = make(tmp_path, config)
    bound = next(b for b in bind_devices(config) if b.device.name == "pickups_1")
    decoder = bound.make_decoder()
    args = {"surface": "flaps", "raw": "900", "deg": "5"}
    request = deflection_pickups.command("insert_point", args, deflection_pickups.Options(nodes=("flaps",)))
    stop = asyncio.Event()
    flying = asyncio.create_task(emulator.run(stop=stop))
    await emulator.ready.wait()
    async with AsyncExitStack() as stack:
        links = [await stack.enter_async_context(run_link(link)) for link in config.link]
        await emulator.wait_for_readers()
        opened, received = links[0]
        await opened.send(request)
        await until_async(lambda: any(unpack_can(f).can_id == 129 for f in received.frames), what="the answer")
    stop.set()
    await flying
    measurements = [m for data, t in zip(received.frames, received.times, strict=True) for m in decoder.feed(data, t)]
    ack = next(m for m in measurements if isinstance(m, Ack))
    calibration = next(m for m in measurements if isinstance(m, Calibration))
    assert (ack.command, ack.accepted, ack.detail) == ("insert_point", True, "flaps: raw 900 = 5.00 deg")
    assert [p.deflection for p in calibration.points if p.raw == 900] == pytest.approx([math.radians(5)])


# ---------------------------------------------------------------------------------------------------- the models


def test_deflections_fit_the_flight() -> None:
    """A roll to the right: right aileron up (-), left down (+), stick to the right; flaps go down in two steps."""
    t = np.arange(0.0, 60.0, 0.1)
    state = environment().state(t)
    angles = deflections(state)
    right = state.omega_nb_b[:, 0] > 0.002
    assert right.any()
    assert (angles["right_aileron"][right] < 0).all()
    assert (angles["left_aileron"][right] > 0).all()
    assert (angles["stick_aileron"][right] > 0).all()
    slow = state.aoa - state.aoa.mean()
    assert np.corrcoef(slow, angles["elevator"])[0, 1] < -0.5
    np.testing.assert_allclose(flap_angle_deg(np.array([0.0, 10.0, 20.0, 35.5, 60.0])), [0.0, 20.0, 20.0, 42.0, 42.0])


def test_beyond_its_table_a_pickup_goes_on_counting() -> None:
    table = CalibrationTable(((1000, 0), (3000, 2000)))
    counts = raw_counts(table, np.radians([-1.0, 0.0, 10.0, 20.0, 21.0]), np.zeros(5))
    assert counts.tolist() == [900, 1000, 2000, 3000, 3100]


def test_dme_ranges_are_slant_ranges_with_an_error_of_a_tenth_of_a_mile() -> None:
    """The first station stands 2500 m behind the threshold, which is 4500 m ahead at the start."""
    result = sensor("canaerospace", rate_hz=2)
    samples = [m for k in range(len(result.t)) for m in result.measure(k, 0) if isinstance(m, DmeRange)]
    assert {m.station for m in samples} == {"dme_1", "dme_2", "dme_3", "dme_4"}
    state = environment().state(result.t)
    expected = np.hypot(7000.0 - 60.0 * result.t, state.alt - 500.0)
    errors = np.array([m.slant_range for m in samples if m.station == "dme_1"]) - expected
    assert abs(errors.mean()) < 300.0  # three sigma of the slow part
    assert np.diff(errors).std() / math.sqrt(2.0) == pytest.approx(15.0, rel=0.3)
