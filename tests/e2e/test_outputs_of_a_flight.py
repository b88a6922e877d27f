"""A demonstration flight whose outputs go to gpsd, to mavutil and to a receiver of GDL 90 at once."""

from __future__ import annotations

import math
import socket
import subprocess
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import orjson
import pytest
from pymavlink import mavutil

from fti.geodesy.formulas import SEMI_MAJOR
from fti.logger.reading.recording import Recording
from fti.messages.topics import FileKind
from tests.e2e.flights import demo_config
from tests.e2e.harness import END_S, FTI, START_S, free_udp_port
from tests.helpers import until
from tests.publish.gdl90_receiver import Ahrs, GeometricAltitude, Heartbeat, Message, Ownship, decode
from tests.publish.gpsd import connected, served_by_gpsd

pytestmark = pytest.mark.e2e

#: The session ends during the flight.
SESSION_S, FLIGHT_S = 10, 60
PUBLISH = """
[publish]
aircraft = "D-TEST"

[publish.nmea]
tcp_port = {nmea}

[publish.mavlink]
udp = ["127.0.0.1:{mavlink}"]
system = 42

[publish.gdl90]
udp = ["127.0.0.1:{gdl90}"]
"""
SCENARIO = """
title = "Outputs"
description = "The begin of an approach."
config = "{config}"

[flight]
kind = "approach"
duration_s = {duration}
"""
#: Errors of the emulated inertial system are a few metres, and the aircraft flies 2.4 m from row to row of the truth.
NEAR_M = 30.0
#: Resolution of NMEA and MAVLink; of GDL 90 in latitude and longitude together.
FINE_M, GDL90_M = 0.03, 1.8
FOOT = 0.3048


class Flight:
    """Rows of the truth, and the valid solutions of the recording."""

    def __init__(self, session: Path) -> None:
        self._truth = self._rows(session, "truth", "/truth/state")
        self._valid = [row for row in self._rows(session, "derived", "/nav/nav_solution") if row["valid"]]

    @staticmethod
    def _rows(session: Path, kind: FileKind, topic: str) -> list[dict[str, Any]]:
        (path,) = session.glob(f"*_{kind}_000.mcap")
        return [orjson.loads(data) for *_, data in Recording.open(path).messages(topic, kind=kind)]

    def assert_position(self, lat_deg: float, lon_deg: float, within_m: float) -> None:
        """It is that of a valid solution, and the aircraft was near."""
        assert miss_m(self._valid, lat_deg, lon_deg) < within_m
        assert miss_m(self._truth, lat_deg, lon_deg) < NEAR_M

    def assert_altitude(self, alt: float, within_m: float) -> None:
        """It is above the ellipsoid, as that of a valid solution, and the aircraft was near [m]."""
        assert min(abs(row["alt"] - alt) for row in self._valid) < within_m
        assert min(abs(row["alt"] - alt) for row in self._truth) < NEAR_M


def miss_m(rows: list[dict[str, Any]], lat_deg: float, lon_deg: float) -> float:
    """Horizontal distance of a position from the nearest row [m]."""
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    nearest = min(math.hypot(row["lat"] - lat, (row["lon"] - lon) * math.cos(lat)) for row in rows)
    return float(nearest * SEMI_MAJOR)


def collect(next_one: Callable[[], Any], found: list[Any], is_over: threading.Event) -> threading.Thread:
    """Read in a thread until it is over, or nothing comes any more."""

    def read() -> None:
        while not is_over.is_set():
            try:
                if (one := next_one()) is not None:
                    found.append(one)
            except (OSError, ValueError):
                return

    thread = threading.Thread(target=read)
    thread.start()
    return thread


def test_three_programs_see_the_flight(tmp_path: Path) -> None:
    ports = {name: free_udp_port() for name in ("nmea", "mavlink", "gdl90")}
    config = demo_config(tmp_path / "config")
    config.write_text(config.read_text() + PUBLISH.format(**ports))
    scenario = tmp_path / "outputs.toml"
    scenario.write_text(SCENARIO.format(config=config, duration=FLIGHT_S))
    command = ["demo", "--headless", "--scenario", str(scenario), "--duration", str(SESSION_S)]
    folders = ["--out", str(tmp_path / "out"), "--run-dir", str(tmp_path / "run")]
    fixes, received, messages = list[dict[str, Any]](), list[Any](), list[Message]()
    is_over = threading.Event()
    with (
        closing(mavutil.mavlink_connection(f"udpin:127.0.0.1:{ports['mavlink']}")) as station,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tablet,
        (tmp_path / "demo.txt").open("w") as log,
        subprocess.Popen([*FTI, *command, *folders], stdout=log, stderr=subprocess.STDOUT) as demo,
    ):
        tablet.bind(("127.0.0.1", ports["gdl90"]))
        tablet.settimeout(0.5)
        threads = [
            collect(lambda: station.recv_match(blocking=True, timeout=0.5), received, is_over),
            collect(lambda: decoded(tablet), messages, is_over),
        ]
        try:
            until(lambda: connected(ports["nmea"]), START_S, "the server of sentences").close()
            with served_by_gpsd(ports["nmea"]) as report:
                threads.append(collect(report, fixes, is_over))
                assert demo.wait(END_S) == 0
                is_over.set()
        finally:
            is_over.set()
            demo.kill()
            for thread in threads:
                thread.join()
    (session,) = (tmp_path / "out").glob("demo_*")
    flight = Flight(session)
    assert_gpsd(fixes, flight)
    assert_mavlink(received, flight)
    assert_gdl90(messages, flight)
    assert "receives no data" not in (tmp_path / "demo.txt").read_text()


def decoded(tablet: socket.socket) -> Message | None:
    try:
        return decode(tablet.recv(2048))
    except TimeoutError:
        return None


def assert_gpsd(fixes: list[dict[str, Any]], flight: Flight) -> None:
    seen = [fix for fix in fixes if fix["class"] == "TPV" and fix.get("mode") == 3 and "track" in fix]
    assert len(seen) > 10
    for fix in seen:
        flight.assert_position(fix["lat"], fix["lon"], FINE_M)
        flight.assert_altitude(fix["altHAE"], FINE_M)
        assert abs(fix["speed"] - 60.0) < 10.0


def assert_mavlink(received: list[Any], flight: Flight) -> None:
    kinds: dict[str, list[Any]] = {}
    for one in received:
        assert one.get_srcSystem() == 42
        kinds.setdefault(one.get_type(), []).append(one)
    assert len(kinds["HEARTBEAT"]) >= SESSION_S
    assert len(kinds["GLOBAL_POSITION_INT"]) > 5 * (SESSION_S - 5)
    for position in kinds["GLOBAL_POSITION_INT"]:
        flight.assert_position(position.lat / 1e7, position.lon / 1e7, FINE_M)
    assert {one.text for one in kinds["STATUSTEXT"]} >= {"position valid"}
    assert any(one.text.startswith("clearance integrity: ") for one in kinds["STATUSTEXT"])
    assert kinds["ATTITUDE"]
    heights = [one.current_distance / 100 for one in kinds["DISTANCE_SENSOR"]]
    assert heights
    assert all(10.0 < height < 600.0 for height in heights)
    healthy = [one.onboard_control_sensors_health & 0x20 for one in kinds["SYS_STATUS"]]
    assert not healthy[0]  # before the flight there is no position
    assert any(healthy)


def assert_gdl90(messages: list[Message], flight: Flight) -> None:
    beats = [one for one in messages if isinstance(one, Heartbeat)]
    reports = [one for one in messages if isinstance(one, Ownship)]
    assert len(beats) == pytest.approx(len(reports), abs=1)
    assert len(beats) >= SESSION_S
    assert not beats[0].position_valid
    seen = [report for report in reports if report.lat is not None and report.lon is not None]
    assert len(seen) >= SESSION_S - 6
    for report in seen:
        assert report.lat is not None
        assert report.lon is not None
        flight.assert_position(report.lat, report.lon, GDL90_M)
        assert report.callsign == "DTEST"
    altitudes = [one.altitude_ft * FOOT for one in messages if isinstance(one, GeometricAltitude)]
    assert altitudes
    for altitude in altitudes:
        flight.assert_altitude(altitude, 2.5 * FOOT + FINE_M)
    assert any(one.roll_deg is not None for one in messages if isinstance(one, Ahrs))
