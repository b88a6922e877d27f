"""What a configuration promises, and when faults explain that it is missing or wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from fti.devices import bind_devices, parse_reference, read_texts
from fti.hil import scenario as scenarios
from fti.hil.oracle.output_effects import OutputEffects, interval_mask
from fti.hil.oracle.required_outputs import RequiredOutput, required_outputs
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.hil.tables.fault_types import Fault

SCENARIO = scenarios.load(scenarios.find("nominal"))
CONFIG = scenarios.load_config(SCENARIO)
REFERENCE = parse_reference(CONFIG, read_texts(CONFIG))
SENT = {"altimeter": {"radio_height": 25.0}, "gnss": {"position": 5.0}, "autopilot": {"range": 25.0, "attitude": 50.0}}
T = np.arange(0.0, 120.0, 0.04)
FLAT = TruthSeries(T, *[0.0 * T] * 6)


def promised() -> dict[str, RequiredOutput]:
    return {output.topic: output for output in required_outputs(CONFIG, REFERENCE, SENT)}


def affected(**fault: Any) -> OutputEffects:
    faults = [TypeAdapter[Any](Fault).validate_python({"from_s": 30.0, "to_s": 40.0, **fault})]
    return OutputEffects(faults, AircraftRoles(CONFIG, bind_devices(CONFIG), SCENARIO), FLAT)


def test_every_role_of_the_demonstration_promises_its_topics() -> None:
    assert set(promised()) == {
        "/nav/nav_solution",
        "/nav/location",
        "/nav/filter_solution",
        "/nav/vertical_solution",
        "/nav/height_above_ground/altimeter",
        "/nav/height_above_ground/autopilot",
        "/nav/height_below_aircraft",
        "/nav/clearance_integrity",
        "/nav/glide_slope",
        "/nav/source_validity/autopilot",
        "/nav/source_validity/gnss",
        "/altimeter/radio_height",
        "/gnss/position",
        "/autopilot/range",
        "/autopilot/attitude",
    }


def test_heights_come_as_often_as_their_device_measures() -> None:
    min_hz, max_hz = promised()["/nav/height_above_ground/altimeter"].rate_hz
    assert min_hz < 25.0 < max_hz < 50.0
    old = {o.topic: o for o in required_outputs(CONFIG, REFERENCE, {})}
    assert old["/nav/height_above_ground/altimeter"].rate_hz[0] == 0.0


def test_the_monitor_is_checked_with_the_radar_altimeter() -> None:
    """The reference of the demonstration was made for it."""
    assert "altimeter" in promised()["/nav/clearance_integrity"].devices
    assert "autopilot" in promised()["/nav/clearance_integrity"].devices  # for its position, behind others


@pytest.mark.parametrize(
    ("fault", "topic", "lost", "wrong"),
    [
        ({"kind": "cut", "devices": ("altimeter",)}, "/nav/height_above_ground/altimeter", True, False),
        ({"kind": "cut", "devices": ("altimeter",)}, "/nav/height_above_ground/autopilot", False, False),
        ({"kind": "cut", "devices": ("altimeter",)}, "/nav/clearance_integrity", True, False),
        ({"kind": "cut", "devices": ("ins",)}, "/nav/nav_solution", False, False),  # others take over
        ({"kind": "cut"}, "/nav/nav_solution", True, False),
        ({"kind": "cut", "devices": ("ahrs",)}, "/nav/nav_solution", False, False),
        ({"kind": "stuck", "devices": ("altimeter",)}, "/nav/height_above_ground/altimeter", True, True),
        ({"kind": "stuck", "devices": ("ins",)}, "/nav/nav_solution", False, False),  # it must be noticed
        ({"kind": "stuck", "devices": ("gnss",)}, "/nav/nav_solution", True, False),  # the filter is without satellites
        ({"kind": "stuck", "devices": ("gnss",)}, "/nav/filter_solution", True, False),
        ({"kind": "stuck", "devices": ("gnss",)}, "/gnss/position", True, True),
        ({"kind": "stuck", "devices": ("gnss",)}, "/autopilot/attitude", False, False),
        ({"kind": "gnss_degraded", "horizontal_m": 5, "vertical_m": 7}, "/nav/nav_solution", False, False),
        ({"kind": "bus_off"}, "/gnss/position", False, False),
    ],
)
def test_a_fault_explains_what_depends_on_its_device(fault: Any, topic: str, lost: bool, wrong: bool) -> None:
    output, effects = promised()[topic], affected(**fault)
    during = np.array([35.0])
    assert interval_mask(during, effects.loss_intervals(output)).item() is lost
    assert interval_mask(during, effects.error_intervals(output)).item() is wrong


def test_a_change_of_sources_takes_a_moment() -> None:
    """The inertial system is 0.5 s old at most; then the satellite receiver takes over."""
    lost = affected(kind="cut", devices=("ins",)).loss_intervals(promised()["/nav/nav_solution"])
    assert interval_mask(np.array([30.6, 40.5]), lost).all()
    assert not interval_mask(np.array([32.0, 39.9]), lost).any()


def test_a_fault_acts_neither_before_it_nor_long_after() -> None:
    output = promised()["/nav/nav_solution"]
    effects = affected(kind="stuck", devices=("ins",))
    assert not interval_mask(np.array([29.9, 60.0]), effects.truth_checked_intervals(output)).any()
    filtered = promised()["/nav/filter_solution"]
    assert interval_mask(np.array([60.0]), effects.truth_checked_intervals(filtered)).all()  # a filter remembers
    short = replace(filtered, memory_s=0.0)
    assert not interval_mask(np.array([60.0]), effects.truth_checked_intervals(short)).any()


def test_the_filter_may_exclude_an_altimeter_for_a_minute_after_a_wrong_value() -> None:
    assert CONFIG.nav.filter is not None
    aids = CONFIG.nav.filter.altimeters
    later = np.array([90.0])
    for name in CONFIG.nav.altimeters:
        fault = {"kind": "stuck", "devices": (name,)}
        height = promised()[f"/nav/height_above_ground/{name}"]
        assert interval_mask(later, affected(**fault).loss_intervals(height)).item() is (name in aids)
        assert not interval_mask(later, affected(**fault).error_intervals(height)).any()


def test_a_second_source_counts_while_the_first_is_gone() -> None:
    """The place is that of the satellite receiver while the inertial system is cut off."""
    cut = {"kind": "cut", "devices": ("ins",), "from_s": 30.0, "to_s": 40.0}
    stuck = {"kind": "stuck", "devices": ("gnss",), "from_s": 33.0, "to_s": 36.0}
    faults = [TypeAdapter[Any](Fault).validate_python(one) for one in (cut, stuck)]
    effects = OutputEffects(faults, AircraftRoles(CONFIG, bind_devices(CONFIG), SCENARIO), FLAT)
    assert interval_mask(np.array([34.0]), effects.truth_checked_intervals(promised()["/nav/nav_solution"])).all()
