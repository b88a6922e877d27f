"""Faults that cannot be where a scenario has them are refused when it is read; answers pass the same faults."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from fti.config import Config
from fti.config import load as load_configuration
from fti.drivers import power_unit
from fti.errors import ConfigError
from fti.hil.device_pipeline import DevicePipeline
from fti.hil.scenario.config_check import check
from fti.hil.sensors import SimulatedSensor
from fti.hil.tables.fault_types import BitErrors, Cut, Fault, Freeze, WrongLabel
from tests.hil.faults.device_flights import START_NS, device
from tests.hil.worlds import scenario

MAKE: TypeAdapter[Fault] = TypeAdapter(Fault)
CONFIG = """
[session]
name = "bench"
directory = "data"
[[link]]
name = "laser_line"
kind = "serial"
port = "/dev/ttyUSB0"
baud = 9600
[[link]]
name = "gnss_line"
kind = "serial"
port = "/dev/ttyUSB1"
baud = 9600
[[link]]
name = "bus"
kind = "can"
interface = "udp_multicast"
channel = "239.0.0.1"
[[device]]
name = "laser"
link = "laser_line"
driver = "lightware_ascii"
[[device]]
name = "gnss"
link = "gnss_line"
driver = "nmea0183"
[[device]]
name = "air"
link = "bus"
driver = "canaerospace"
"""


@pytest.fixture
def bench(tmp_path: Path) -> Config:
    (tmp_path / "bench.toml").write_text(CONFIG)
    return load_configuration(tmp_path / "bench.toml")


def checked(bench: Config, kind: str, **keys: Any) -> None:
    check(scenario(fault=(MAKE.validate_python({"kind": kind, "from_s": 1.0, "to_s": 2.0, **keys}),)), bench)


@pytest.mark.parametrize(
    ("kind", "keys", "message"),
    [
        ("wrong_checksum", {"devices": ("laser",)}, r"\.devices: 'laser': lightware_ascii has no checksum; allowed: "
         r"arinc429, ascii_line, .*ublox_ubx"),
        ("wrong_checksum", {"devices": ("gnss", "air")}, r"'air': canaerospace has no checksum"),
        ("wrong_label", {"devices": ("laser",)}, r"'laser': lightware_ascii has no message identifier"),
        ("clock_jump", {"devices": ("air",), "by_s": 1.0}, r"canaerospace does not send its time; allowed: arinc429, "),
        ("clock_drift", {"devices": ("laser",), "ppm": 1.0}, r"'laser': lightware_ascii does not send its time"),
        ("lost_header", {"devices": ("air",)}, r"'air': canaerospace is on CAN, where every frame has its header"),
        ("cut", {"devices": ("radar",)}, r"fault\[0\]\.devices: unknown device 'radar'; .* has: laser, gnss"),
        ("bus_off", {"links": ("gnss_line",)}, r"fault\[0\]\.links: unknown CAN link 'gnss_line'; .* has: bus"),
        ("babbling", {"links": ("none",)}, r"unknown CAN link 'none'"),
        ("can_status", {"links": ("bus",), "flags": ("bus_error",)}, r"unknown slcan link 'bus'; .* has: none"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_what_can(bench: Config, kind: str, keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        checked(bench, kind, **keys)


def test_without_names_a_fault_is_of_whoever_can_have_it(bench: Config) -> None:
    for kind, keys in (("wrong_checksum", {}), ("clock_jump", {"by_s": 1.0}), ("bus_off", {}), ("cut", {})):
        checked(bench, kind, **keys)


def test_and_of_somebody_it_must_be(tmp_path: Path) -> None:
    begin = CONFIG.index('[[device]]\nname = "gnss"')
    (tmp_path / "laser.toml").write_text(CONFIG[:begin])
    with pytest.raises(ConfigError, match=r"fault\[0\]: applies to no device .*: lightware_ascii does not send"):
        checked(load_configuration(tmp_path / "laser.toml"), "clock_jump", by_s=1.0)


@pytest.mark.parametrize(
    ("quantity", "message"),
    [
        ("laser.range", "unknown measurement 'laser'; allowed: attitude, position, velocity"),
        ("range.height", "unknown number 'height' of range; allowed: slant_range, sd"),
        ("range", "unknown number '' of range"),
        ("imu_sample.gyro_b", "unknown number 'gyro_b' of imu_sample; allowed: accel_b_0, .*gyro_b_2"),
        ("range.valid", "unknown number 'valid' of range"),
    ],
)
def test_a_number_that_is_not_there_is_refused_with_what_is(quantity: str, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        MAKE.validate_python({"kind": "bias", "from_s": 1.0, "to_s": 2.0, "quantity": quantity, "value": 1.0})


# ---------------------------------------------------------------------------------------------------------- answers


def answers(*faults: Fault, at_s: float) -> list[bytes]:
    """What a polled laser answers after its first cycles."""
    line = DevicePipeline(polled(), scenario(fault=faults, seed=3))
    while (t := line.due_s()) is not None and t <= at_s:
        assert line.step(START_NS) == []
    return line.respond(b"?LDF,1\r\n", at_s)


def polled() -> SimulatedSensor:
    laser = device("lightware_ascii_polled")
    assert laser.encoder.respond(b"?LDF,1\r\n") == []
    return laser


def test_answers_pass_the_same_faults() -> None:
    (right,) = answers(at_s=2.0)
    assert right.startswith(b"ldf,1:")
    assert answers(Cut(kind="cut", from_s=1.0, to_s=3.0), at_s=2.0) == []
    assert answers(WrongLabel(kind="wrong_label", from_s=1.0, to_s=3.0), at_s=2.0) == [right.replace(b"ldf", b"zzz")]
    assert answers(BitErrors(kind="bit_errors", from_s=1.0, to_s=3.0, rate=0.2), at_s=2.0) != [right]
    assert answers(Freeze(kind="freeze", from_s=3.0, to_s=5.0), at_s=2.0) == [right]


def test_before_the_flight_nothing_is_wrong() -> None:
    line = DevicePipeline(device("power_unit"), scenario(fault=(Cut(kind="cut", from_s=0.0, to_s=99.0),)))
    question = power_unit.command("off", {"breaker": "altimeter"})
    assert len(line.respond(question, -1.0)) == 1
    assert line.respond(question, 1.0) == []
