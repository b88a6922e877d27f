"""The flight computer on a nominal approach, one flight with a test for each of its outputs; and one flight in fog."""

import math
import os
import sys
from pathlib import Path

import pytest

from fti.hil import scenario as scenarios
from fti.hil.tables.fault_types import Fog

HERE = Path(__file__).parent
FLIGHT_S = 25.0
#: All sensors have sent, and the position has converged to the receiver's [s].
SETTLED_S = 2.0
COMMAND = [
    *(sys.executable, HERE / "flight_computer.py"),
    *("--autopilot", "{emulator.autopilot_eth.port}"),
    *("--gnss", "{emulator.gnss_line.path}"),
    *("--out", "{recorder.result_eth.port}"),
    *("--bias", os.environ.get("FLIGHT_COMPUTER_BIAS", "")),  # alt=20: does test_navigation notice?
]
ANGLE = math.radians(1.5)


@pytest.fixture(scope="module")
def flight(fti_bench_factory):
    with fti_bench_factory("nominal") as bench:
        bench.recorder.start(HERE / "outputs.toml")
        bench.emulator.start("nominal", config=HERE / "sensors.toml", duration_s=FLIGHT_S)
        bench.unit.start(COMMAND, ready_text="ready")
        yield bench.emulator.fly()


@pytest.mark.parametrize("topic", ["position", "velocity", "attitude", "radio_height", "reading", "device_status"])
def test_results_come_ten_times_a_second(flight, topic):
    results = flight.topic(f"/computer/{topic}", from_s=SETTLED_S)
    results.assert_rate(9.0, 11.0)
    results.assert_longest_gap(0.5)


@pytest.mark.parametrize(
    ("topic", "quantity", "limit"),
    [
        ("position", "lat", 8.0),  # metres along the ground, as lon
        ("position", "lon", 8.0),
        ("position", "alt", 6.0),
        ("velocity", "north", 1.0),
        ("velocity", "east", 1.0),
        ("velocity", "down", 1.0),
        ("attitude", "roll", ANGLE),
        ("attitude", "pitch", ANGLE),
        ("attitude", "heading", ANGLE),
    ],
)
def test_navigation(flight, topic, quantity, limit):
    flight.topic(f"/computer/{topic}", from_s=SETTLED_S).assert_error(quantity, limit)


def test_height_above_ground(flight):
    height = flight.topic("/computer/radio_height", from_s=SETTLED_S)
    height.assert_valid_share(0.99)
    height.assert_error("height_agl", 10.0, share=0.97)  # one beam, tilted with the aircraft, over hilly ground
    flight.topic("/computer/device_status", from_s=SETTLED_S).assert_no_flag("critical")


def test_height_above_glide_path(flight):
    height = flight.topic("/computer/reading", where={"name": "dh"}, from_s=SETTLED_S)
    height.assert_error("value", 6.0, truth="dh")


def test_fog_is_reported(fti_emulator, fti_recorder, fti_unit):
    """The laser sees nothing in fog: the computer must report it within half a second, and only in fog."""
    nominal = scenarios.load(scenarios.find("nominal"))
    fog = Fog(kind="fog", devices=("autopilot",), from_s=4.0, to_s=8.0, visibility_m=50.0)
    fti_recorder.start(HERE / "outputs.toml")
    fti_emulator.start(nominal.model_copy(update={"fault": (fog,)}), config=HERE / "sensors.toml", duration_s=12.0)
    fti_unit.start(COMMAND, ready_text="ready")
    status = fti_emulator.fly().topic("/computer/device_status", from_s=SETTLED_S)
    status.assert_flag("critical", fault=0, raised_within_s=0.5, cleared_within_s=0.5)
