"""Other people's software at the emulator's ports: what was not written here must understand what is played here.

One emulator flies for all of them.  Each test opens a port as its software's user would, asks the device where the
device wants to be asked, and compares what the software says with the truth of the flight.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import can
import cantools
import ixcom.data
import pynmeagps
import pytest
import pyubx2
import serial
from ixcom.parser import MessageSearcher
from novatel_edie import oem
from pymavlink import mavutil

from fti.drivers.imar_ixcom.options import NUMBERS
from fti.geodesy.atmosphere import pressure_altitude
from fti.geodesy.formulas import SEMI_MAJOR
from fti.hil.emulator import DEMO_UNDULATION
from fti.logger.reading.recording import Recording
from tests.e2e.flights import emulator, emulator_log
from tests.e2e.harness import START_S, free_udp_port
from tests.helpers import ROOT, until

pytestmark = pytest.mark.e2e

#: Slow, so that every test finds the aircraft in the air on a busy machine too.
SCENARIO = """
title = "For others"
description = "A slow approach."
config = "bench.toml"

[flight]
speed_mps = 15
duration_s = 240
"""
CONFIG = """
[session]
name = "others"
"""
LINE = """
[[link]]
name = "{name}"
kind = "serial"
port = "/dev/none"
baud = 115200
transmit = true

[[device]]
name = "{name}_device"
link = "{name}"
driver = "{driver}"
"""
REST = """
[[link]]
name = "autopilot"
kind = "udp"
bind = "127.0.0.1:{port}"

[[device]]
name = "autopilot_device"
link = "autopilot"
driver = "mavlink"

[[link]]
name = "bus"
kind = "can"
interface = "slcan"
channel = "/dev/none"
bitrate = 500000

[[device]]
name = "air_data"
link = "bus"
driver = "dbc"
options = {{ dbc_file = "{dbc}" }}
"""
LINES = {
    "nmea": "nmea0183",
    "daemon": "nmea0183",
    "ubx": "ublox_ubx",
    "novatel": "novatel_oem6",
    "ins": "imar_ixcom",
}
DBC = ROOT / "configs" / "dbc" / "air_data_unit.dbc"
#: Position errors of the emulated receivers are a few metres, and the aircraft goes on while we look.
NEAR_M = 30.0
READ_S = 60.0


class Bench:
    """The ports of the flying emulator, and where the aircraft has been."""

    def __init__(self, links: Path, truth: Path, mavlink_port: int) -> None:
        self.links, self.truth, self.mavlink_port = links, truth, mavlink_port

    def rows(self) -> list[dict[str, float]]:
        """The truth so far."""
        return [json.loads(data) for *_, data in Recording.open(self.truth).messages("/truth/state", kind="truth")]

    def miss(self, lat_deg: float, lon_deg: float, alt: float) -> float:
        """Distance of a position from the nearest true one [m]; alt above the ellipsoid [m]."""
        lat, lon = math.radians(lat_deg), math.radians(lon_deg)
        return min(
            math.hypot(
                (row["lat"] - lat) * SEMI_MAJOR, (row["lon"] - lon) * SEMI_MAJOR * math.cos(lat), row["alt"] - alt
            )
            for row in self.rows()
        )

    def line(self, name: str) -> serial.Serial:
        """A serial line, opened as everybody does."""
        return serial.Serial(str(self.links / name), 115200, timeout=1.0)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """The emulator with a device of each protocol, in flight."""
    folder = tmp_path_factory.mktemp("others")
    links, truth, port = folder / "links", folder / "others_truth_000.mcap", free_udp_port()
    config = folder / "bench.toml"
    text = CONFIG + "".join(LINE.format(name=name, driver=driver) for name, driver in LINES.items())
    config.write_text(text + REST.format(port=port, dbc=DBC))
    (folder / "others.toml").write_text(SCENARIO)
    with emulator(str(folder / "others.toml"), config, links, "--truth", str(truth)) as played:
        until(lambda: (links / "bus").is_symlink() or played.poll() is not None, START_S, "the ports")
        assert played.poll() is None, emulator_log(config).read_text()
        until(lambda: truth.is_file() and truth.stat().st_size > 0, START_S, "the flight")
        yield Bench(links, truth, port)


def read(take: Callable[[], Any], wanted: Callable[[Any], bool], count: int = 5) -> list[Any]:
    """The first ``count`` things that the software says and that are wanted."""
    found: list[Any] = []
    deadline = time.monotonic() + READ_S
    while len(found) < count:
        assert time.monotonic() < deadline, f"only {len(found)} of {count} in {READ_S:g} s"
        thing = take()
        if thing is not None and wanted(thing):
            found.append(thing)
    return found


def test_pynmeagps_reads_the_receiver(bench: Bench) -> None:
    with bench.line("nmea") as line:
        reader = pynmeagps.NMEAReader(line, validate=pynmeagps.VALCKSUM, quitonerror=pynmeagps.ERR_RAISE)
        line.readline()  # perhaps the end of a sentence only
        fixes = read(lambda: reader.read()[1], lambda m: m.msgID == "GGA")
    for fix in fixes:
        assert fix.quality > 0
        assert bench.miss(fix.lat, fix.lon, fix.alt + fix.sep) < NEAR_M


def test_pyubx2_configures_and_reads_the_receiver(bench: Bench) -> None:
    with bench.line("ubx") as line:
        reader = pyubx2.UBXReader(line, protfilter=pyubx2.UBX_PROTOCOL, quitonerror=pyubx2.ERR_RAISE)
        rate = pyubx2.UBXMessage("CFG", "CFG-MSG", pyubx2.SET, msgClass=0x01, msgID=0x07, rateUART1=1, rateUSB=1)
        line.write(rate.serialize())
        (ack,) = read(lambda: reader.read()[1], lambda m: m.identity.startswith("ACK"), 1)
        fixes = read(lambda: reader.read()[1], lambda m: m.identity == "NAV-PVT")
    assert (ack.identity, ack.clsID, ack.msgID) == ("ACK-ACK", 0x06, 0x01)
    for fix in fixes:
        assert fix.fixType == 3
        assert bench.miss(fix.lat, fix.lon, fix.height / 1000.0) < NEAR_M


def test_novatel_edie_reads_what_was_requested_of_the_receiver(bench: Bench) -> None:
    parser = oem.Parser()
    with bench.line("novatel") as line:
        line.write(b"LOG BESTPOSB ONTIME 0.2\r\n")

        def take() -> Any:
            parser.write(line.read(max(line.in_waiting, 1)))
            return next((m for m in parser if getattr(m, "name", "") == "BESTPOS"), None)

        fixes = read(take, lambda m: True)
    for fix in fixes:
        assert fix.solution_status.name == "SOL_COMPUTED"
        assert bench.miss(fix.latitude, fix.longitude, fix.orthometric_height + fix.undulation) < NEAR_M


def test_ixcom_reads_the_inertial_system(bench: Bench) -> None:
    frames: list[bytes] = []
    searcher = MessageSearcher(ignore_c_ext=True)
    searcher.add_callback(lambda data: frames.append(bytes(data)))
    with bench.line("ins") as line:

        def take() -> Any:
            searcher.process_bytes(line.read(max(line.in_waiting, 1)))
            return next((frame for frame in iter(lambda: frames.pop(0) if frames else None, None)), None)

        found = read(take, lambda frame: frame[1] == NUMBERS["INSSOL"])
    for frame in found:
        message = ixcom.data.getMessageWithID(NUMBERS["INSSOL"])
        message.from_bytes(frame)
        lat, lon = math.degrees(message.data["lat"]), math.degrees(message.data["lon"])
        assert bench.miss(lat, lon, message.data["alt"]) < NEAR_M


def test_mavutil_receives_the_autopilot(bench: Bench) -> None:
    with closing(mavutil.mavlink_connection(f"udpin:127.0.0.1:{bench.mavlink_port}")) as link:
        assert link.wait_heartbeat(timeout=READ_S) is not None
        positions = read(
            lambda: link.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=1.0), lambda m: True
        )
        attitude = link.recv_match(type="ATTITUDE", blocking=True, timeout=READ_S)
        assert link.mav_loss == 0
    heights = [row["alt"] for row in bench.rows()]
    for m in positions:
        alt = min(heights, key=lambda h: abs(h - m.alt / 1000.0))  # above mean sea level: the place decides
        assert bench.miss(m.lat / 1e7, m.lon / 1e7, alt) < NEAR_M
    assert abs(attitude.roll) < math.radians(60.0)


def test_python_can_and_cantools_read_the_bus(bench: Bench) -> None:
    """The static pressure is that of the flown heights in the standard atmosphere."""
    database = cantools.database.can.Database()
    database.add_dbc_file(DBC)
    fast = database.get_message_by_name("air_data_fast")
    channel = str(bench.links / "bus")
    with can.Bus(interface="slcan", channel=channel, bitrate=500000, ignore_config=True, sleep_after_open=0.0) as bus:
        frames = read(lambda: bus.recv(1.0), lambda frame: frame.arbitration_id == fast.frame_id, 20)
    values: list[dict[str, Any]] = [fast.decode_simple(frame.data) for frame in frames]
    heights = [row["alt"] - DEMO_UNDULATION for row in bench.rows()]
    for value in values:
        height = float(pressure_altitude(100.0 * value["static_pressure"]))
        assert min(abs(height - h) for h in heights) < NEAR_M
        assert 0.0 < value["impact_pressure"] < 50.0


def test_gpsd_serves_the_receiver(bench: Bench) -> None:
    daemon = shutil.which("gpsd", path=f"{os.environ['PATH']}:/usr/sbin")
    if daemon is None:
        pytest.skip("gpsd (Debian: gpsd) is not installed")
    port = free_udp_port()
    command = [daemon, "-N", "-n", "-b", "-S", str(port), str((bench.links / "daemon").resolve())]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as served:
        try:
            client = until(lambda: connected(port), what="gpsd")
            with client, client.makefile("rw") as talk:
                talk.write('?WATCH={"enable":true,"json":true};\n')
                talk.flush()
                reports = (json.loads(line) for line in talk)
                fixes = read(
                    lambda: next(reports), lambda r: r["class"] == "TPV" and r.get("mode") == 3 and "altHAE" in r
                )
        finally:
            served.terminate()
    for fix in fixes:
        assert bench.miss(fix["lat"], fix["lon"], fix["altHAE"]) < NEAR_M


def connected(port: int) -> socket.socket | None:
    """A connection to gpsd, when it listens."""
    try:
        return socket.create_connection(("127.0.0.1", port), timeout=READ_S)
    except OSError:
        return None
