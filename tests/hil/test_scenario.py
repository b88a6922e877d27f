"""Scenario files: the shipped ones load, errors are reported in one sentence."""

from __future__ import annotations

import math
from pathlib import Path
from typing import get_args

import pytest

from fti.errors import ConfigError, MissingError
from fti.hil import scenario as scenarios
from fti.hil.scenario import Scenario
from fti.hil.sensors import MODELS
from fti.hil.tables.fault_types import CanStatus, Invalid, StatusFlag
from fti.links.slcan_status import FLAGS
from tests.helpers import ROOT

MINIMAL = 'title = "t"\ndescription = "d"\nconfig = "demo.toml"\n'


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "s.toml"
    file.write_text(MINIMAL + text)
    return file


@pytest.mark.parametrize("name", scenarios.shipped_names())
def test_shipped_scenarios_load_with_their_configuration(name: str) -> None:
    scenario = scenarios.load(scenarios.find(name))
    config = scenarios.load_config(scenario)
    assert scenario.description.strip()
    assert all(device.driver in MODELS for device in config.device)
    assert {device.link for device in config.device} == {link.name for link in config.link}


def test_the_five_of_the_issue_are_there() -> None:
    assert {"nominal", "obstacle", "off_track", "altimeter_failure", "silence"} <= set(scenarios.shipped_names())


def test_a_scenario_is_found_by_name_and_by_path(tmp_path: Path) -> None:
    file = written(tmp_path, "")
    assert scenarios.find(str(file)) == file
    assert scenarios.find("nominal").is_file()
    with pytest.raises(MissingError, match=r"unknown scenario 'nomnal'; allowed: a file, or one of .*nominal"):
        scenarios.find("nomnal")


def test_the_configuration_is_beside_the_file(tmp_path: Path) -> None:
    assert scenarios.load(written(tmp_path, "")).config == str(tmp_path / "demo.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[flight]\nspeed = 60\n", r"flight.speed: there is no such key; allowed here: .*speed_mps"),
        ('[[fault]]\nkind = "can_status"\nflags = []\nfrom_s = 0\nto_s = 5\n', r"fault\[0\].*flags"),
        ('[[fault]]\nkind = "can_status"\nflags = ["dull"]\nfrom_s = 0\nto_s = 5\n', r"fault\[0\].*'rx_fifo_full'"),
        ('[[fault]]\nkind = "cut"\nfrom_s = 5\nto_s = 5\n', r"fault\[0\].to_s = 5.0: must be after from_s"),
        (
            '[[fault]]\nkind = "attitude_offset"\nfrom_s = 0\nto_s = 5\n',
            r"fault\[0\].*one of roll_deg, pitch_deg, heading_deg must not be 0",
        ),
        (
            '[[fault]]\nkind = "inertial_bias"\ngyro_degph = [0, 0, 0]\nfrom_s = 0\nto_s = 5\n',
            r"one of gyro_degph, accel_mg must not be 0",
        ),
        ('[[fault]]\nkind = "terrain_shift"\n', r"one of north_m, east_m, up_m must not be 0"),
        ('[[fault]]\nkind = "latency"\nby_s = 0\nfrom_s = 0\nto_s = 5\n', r"fault\[0\].*by_s"),
        ('[[fault]]\nkind = "undulation"\nstated = "none"\nfrom_s = 0\nto_s = 5\n', r"fault\[0\].*'zero'"),
        ("[flight]\nduration_s = 0\n", r"flight.duration_s = 0"),
        (
            '[[fault]]\nkind = "frozen"\nfrom_s = 0\nto_s = 5\n',
            r"s.toml: fault\[0\].kind: unknown kind 'frozen'; did you mean 'freeze'\?; "
            r"fti hil --faults lists them \(line \d+\)$",
        ),
        (
            '[[fault]]\nkind = "explosion"\n',
            r"fault\[0\].kind: unknown kind 'explosion'; fti hil --faults lists them \(",
        ),
        ("[[fault]]\nfrom_s = 0\n", r"fault\[0\].kind: missing; it must be given"),
        ('[[fault]]\nkind = "cut"\nfrom_s = 5\nto_ss = 6\n', r"^[^\n]*fault\[0\].to_ss: [^\n]*'to_s'\? \(line \d+\)$"),
        ('[flight]\nkind = "aproach"\n', r"flight.kind: unknown kind 'aproach'; did you mean 'approach'\?; allowed: "),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        scenarios.load(written(tmp_path, text))


def expecting(tmp_path: Path, channel: str) -> Scenario:
    config = f'config = "{ROOT / "configs" / "demo.toml"}"\n'
    file = tmp_path / "typo.toml"
    file.write_text(f'title = "t"\ndescription = "d"\n{config}[[expect]]\nchannel = "{channel}"\nat_s = 1\nvalue = 1\n')
    return scenarios.load(file)


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        ("/nav/glide_slope.dotz", "unknown field 'dotz'; allowed: t_ns, .*dots"),
        ("/nav/glideslope.dots", "unknown topic 'glideslope' of /nav; allowed: height_above_ground, "),
        ("/nav/height_above_ground/ins.raw", "must end with one of nav.altimeters: altimeter, autopilot"),
        ("/nav/height_above_ground.raw", "must end with one of nav.altimeters"),
        ("/nav/provisional_solution/ins.hpl", "must end with one of nav.filter.gnss: "),
        ("/laser/range.slant_range", "unknown topic /laser; allowed: nav, fti, altimeter"),
        ("/gnss/position/gga.lat", "unknown part 'gga'; allowed: none"),
    ],
)
def test_what_is_expected_of_no_channel_is_named_with_the_file(tmp_path: Path, channel: str, message: str) -> None:
    with pytest.raises(ConfigError, match=rf"typo.toml: expect\[0\].channel = '{channel}': {message}"):
        scenarios.load_config(expecting(tmp_path, channel))


@pytest.mark.parametrize(
    "channel",
    [
        "/nav/glide_slope.dots",
        "/nav/height_above_ground/altimeter.raw",
        "/gnss/position.horizontal_sd",
        "/fti/clock.t_ns",
    ],
)
def test_what_is_expected_of_a_channel_may_stand_there(tmp_path: Path, channel: str) -> None:
    assert scenarios.load_config(expecting(tmp_path, channel))


def test_a_fault_of_a_device_that_is_not_there_is_named() -> None:
    scenario = scenarios.load(scenarios.find("nominal"))
    fault = Invalid(kind="invalid", devices=("radar",), from_s=1.0, to_s=2.0)
    with pytest.raises(ConfigError, match=r"fault\[0\].devices: unknown device 'radar'; .* has: altimeter"):
        scenarios.load_config(scenario.model_copy(update={"fault": (fault,)}))


def test_a_fault_of_an_adapter_that_is_not_there_is_named() -> None:
    scenario = scenarios.load(scenarios.find("nominal"))
    fault = CanStatus(kind="can_status", flags=("bus_error",), links=("gnss",), from_s=1.0, to_s=2.0)
    with pytest.raises(ConfigError, match=r"fault\[0\].links: unknown slcan link 'gnss'; .* has: air_can"):
        scenarios.load_config(scenario.model_copy(update={"fault": (fault,)}))


def test_the_flags_of_a_fault_are_those_of_the_status() -> None:
    assert {f"slcan_{flag}" for flag in get_args(StatusFlag)} == set(FLAGS.values())


def test_wind_from_the_east_blows_to_the_west(tmp_path: Path) -> None:
    wind_n = scenarios.load(written(tmp_path, "[air]\nwind_mps = 5\nwind_from_deg = 90\n")).air.wind_n
    assert wind_n == pytest.approx((0.0, -5.0), abs=1e-9)
    assert math.hypot(*wind_n) == pytest.approx(5.0)
