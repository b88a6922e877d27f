"""Runs inside the user-mode kernel: the emulator plays pickups on vcan0; a link listens, commands and is answered.

The frames that the link heard, and their times, are judged by ``test_pickups_on_socketcan.py``.
"""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path

from fti import config as configuration
from fti.canframe import unpack_can
from fti.clock import choose_epoch_ns
from fti.drivers import deflection_pickups
from fti.hil.emulator import Emulator
from fti.hil.environment import Environment
from fti.hil.io_backend import PortBackend
from fti.hil.tables.flights import ApproachFlight
from tests.helpers import until_async
from tests.hil.worlds import flat_terrain, path, scenario
from tests.links.bench import run_link

FLIGHT_S = 1.0
CONFIG = """
[session]
name = "bus"
directory = "out"

[[link]]
name = "sensor_bus_1"
kind = "can"
interface = "socketcan"
channel = "vcan0"
transmit = true

[[device]]
name = "pickups"
link = "sensor_bus_1"
driver = "deflection_pickups"

[[device]]
name = "air_data"
link = "sensor_bus_1"
driver = "canaerospace"
rate_hz = 10
options = { node = 1, dbc_file = "air_data.dbc" }
"""
#: One parameter: to read all of the built-in DBC takes this kernel three seconds.
AIR_DATA = """VERSION ""

NS_ :

BS_:

BU_: air_data

BO_ 326 static_pressure: 8 air_data
 SG_ node_id : 7|8@0+ (1,0) [0|255] "" Vector__XXX
 SG_ data_type M : 15|8@0+ (1,0) [0|255] "" Vector__XXX
 SG_ service_code : 23|8@0+ (1,0) [0|255] "" Vector__XXX
 SG_ message_code : 31|8@0+ (1,0) [0|255] "" Vector__XXX
 SG_ static_pressure m2 : 39|32@0- (1,0) [0|0] "hPa" Vector__XXX

SIG_VALTYPE_ 326 static_pressure : 1;
"""
REQUEST = deflection_pickups.command("insert_point", {"surface": "flaps", "raw": "900", "deg": "8"})


async def probe(folder: Path) -> dict[str, list[object]]:
    (folder / "bus.toml").write_text(CONFIG)
    (folder / "air_data.dbc").write_text(AIR_DATA)
    config = configuration.load(folder / "bus.toml")
    flight = scenario(flight=ApproachFlight(duration_s=FLIGHT_S))
    world = Environment(flight, path(), flat_terrain(200.0), undulation=47.0)
    emulator = Emulator(config, flight, PortBackend(folder / "links", choose_epoch_ns()), world=world)
    flying = asyncio.create_task(emulator.run(), name="flying")
    await emulator.ready.wait()
    async with AsyncExitStack() as stack:
        link, received = await stack.enter_async_context(run_link(config.link[0]))
        await link.send(REQUEST)
        await until_async(
            lambda: any(unpack_can(f).can_id == 129 for f in received.frames), what="the answer of the node"
        )
        emulator.start()
        await flying
        await until_async(lambda: len(received.frames) > 200, what="the flight")
    return {"frames": [frame.hex() for frame in received.frames], "times": list(received.times)}
