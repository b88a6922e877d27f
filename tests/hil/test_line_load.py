"""Lines that cannot carry what their devices send are known before the flight."""

from __future__ import annotations

from pathlib import Path

import pytest

from fti import config as configuration
from fti.config import Config
from fti.hil.environment import Environment
from fti.hil.line_load import overloads
from fti.hil.sensors import SimulatedSensor, make_sensors
from tests.hil.worlds import flat_terrain, path, scenario

TEXT = """
[session]
name = "slow"
directory = "out"

[[link]]
name = "line"
kind = "serial"
port = "/dev/x"
baud = {baud}

[[link]]
name = "bus"
kind = "can"
interface = "slcan"
channel = "/dev/y"
bitrate = {bitrate}

[[device]]
name = "altimeter"
link = "line"
driver = "freeflight_ra4500"
rate_hz = 25

[[device]]
name = "air_data"
link = "bus"
driver = "canaerospace"
rate_hz = 10
"""


def made(tmp_path: Path, baud: int, bitrate: int) -> tuple[Config, list[SimulatedSensor]]:
    file = tmp_path / "slow.toml"
    file.write_text(TEXT.format(baud=baud, bitrate=bitrate))
    config = configuration.load(file)
    world = Environment(scenario(), path(), flat_terrain(), undulation=47.0)
    return config, make_sensors(config, world, 1, lambda _: None)


def test_lines_that_carry_it_are_not_mentioned(tmp_path: Path) -> None:
    assert overloads(*made(tmp_path, 57600, 500_000)) == []


def test_one_that_does_not_is_reported_with_both_rates(tmp_path: Path) -> None:
    """RA-4500: 25 frames a second of nine bytes, more where a byte is stuffed; 1200 baud carry 120 bytes."""
    (warning,) = overloads(*made(tmp_path, 1200, 500_000))
    assert warning.startswith("line: 1200 baud carry 120 bytes a second, its devices send 2")
    assert 225 <= int(warning.split("send ")[1].split(";")[0]) <= 300
    (warning,) = overloads(*made(tmp_path, 57600, 10_000))
    assert warning.startswith("bus: its devices send ")
    assert warning.endswith(" of the capacity of the bus; the oldest messages will be dropped")


def test_asking_changes_nothing_for_the_flight(tmp_path: Path) -> None:
    config, sensors = made(tmp_path, 57600, 500_000)
    _, untouched = made(tmp_path, 57600, 500_000)
    overloads(config, sensors)
    for sensor, other in zip(sensors, untouched, strict=True):
        assert [m for k in range(5) for v in sensor.measure(k, 0) for m in sensor.encoder.encode(v)] == [
            m for k in range(5) for v in other.measure(k, 0) for m in other.encoder.encode(v)
        ]


@pytest.mark.parametrize("baud", [1200, 57600])
def test_the_answer_is_the_same_twice(tmp_path: Path, baud: int) -> None:
    config, sensors = made(tmp_path, baud, 500_000)
    assert overloads(config, sensors) == overloads(config, sensors)
