"""Flags of faulty sources: a table has the expected ones; outputs are compared with the truth in any case."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from fti.devices import bind_devices
from fti.hil import scenario as scenarios
from fti.hil.oracle.fault_flags import flags_of_fault
from fti.hil.oracle.output_effects import OutputEffects
from fti.hil.oracle.required_outputs import RequiredOutput
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.hil.oracle.source_flags import SOURCE_FLAGS
from fti.hil.oracle.truth_checked_faults import is_truth_checked
from fti.hil.tables.fault_types import Fault, FaultKind

MAKE: TypeAdapter[Fault] = TypeAdapter(Fault)
T = np.arange(0.0, 120.0, 0.1)
TRUTH = TruthSeries(T, 0 * T + 200.0, 4000.0 - 30.0 * T, *[0 * T] * 4)
WHEN: dict[str, Any] = {"from_s": 45.0, "to_s": 90.0}
KEYS: dict[FaultKind, dict[str, Any]] = {
    FaultKind.ATTITUDE_OFFSET: {"devices": ("ins",), "roll_deg": -3.0},
    FaultKind.STUCK: {"devices": ("receiver",)},
    FaultKind.CLOCK_JUMP: {"devices": ("receiver",), "by_s": -2.0},
    FaultKind.GNSS_RAMP: {"devices": ("receiver",), "north_mps": 1.0},
    FaultKind.SWAPPED_COORDINATES: {"devices": ("receiver",)},
    FaultKind.UNDULATION: {"devices": ("receiver",)},
}
SOLUTION = "/nav/nav_solution"


@pytest.fixture(scope="module")
def craft() -> AircraftRoles:
    scenario = scenarios.load(scenarios.find("fallbacks"))
    config = scenarios.load_config(scenario)
    return AircraftRoles(config, bind_devices(config), scenario)


def make_fault(kind: FaultKind | str, **keys: Any) -> Fault:
    return MAKE.validate_python({"kind": str(kind), **WHEN, **keys})


def due(fault: Fault, craft: AircraftRoles) -> list[tuple[str, tuple[str, ...], float]]:
    return [
        (expected_flag.place, expected_flag.words, expected_flag.within_s)
        for one in flags_of_fault(fault, craft, TRUTH)
        for expected_flag in one.expected_flags
    ]


@pytest.mark.parametrize("kind", SOURCE_FLAGS, ids=str)
def test_a_wrong_source_must_be_refused(kind: FaultKind, craft: AircraftRoles) -> None:
    fault, role = make_fault(kind, **KEYS[kind]), "attitude" if kind == "attitude_offset" else "position"
    (device,) = KEYS[kind]["devices"]
    assert (SOLUTION, (f"{role} not from {device}",), SOURCE_FLAGS[kind].within_s) in due(fault, craft)
    assert not [
        flag for flag in due(make_fault(kind, **KEYS[kind] | {"devices": ("ahrs",)}), craft) if flag[0] == SOLUTION
    ]


@pytest.mark.parametrize(
    ("kind", "keys"),
    [
        ("gnss_ramp", {"north_mps": 0.7, "east_mps": 0.7}), ("gnss_ramp", {"up_mps": 3.0}),
        ("gnss_ramp", {"north_mps": 3.0, "from_s": 30.0}), ("clock_jump", {"by_s": 0.4}),
        ("attitude_offset", {"devices": ("ins",), "roll_deg": 2.0, "heading_deg": 10.0}),
    ],
)  # fmt: skip
def test_a_fault_below_what_can_be_seen_raises_nothing(craft: AircraftRoles, kind: str, keys: dict[str, Any]) -> None:
    fault = make_fault(kind, **{"devices": ("receiver",)} | keys)
    assert not [flag for flag in due(fault, craft) if flag[0] == SOLUTION]


# ----------------------------------------------------------------------------------------- which outputs are checked


def output(topic: str, *devices: str) -> RequiredOutput:
    return RequiredOutput(topic, devices, (1.0, 30.0), 1.0, 1.0, (devices,) if topic.startswith("/nav") else ())


@pytest.mark.parametrize(
    ("kind", "keys"),
    [
        ("gnss_ramp", {"up_mps": 1.0}), ("swapped_coordinates", {}), ("undulation", {}), ("latency", {"by_s": 1.0}),
        ("lever_arm", {"down_m": 1.0}), ("clock_drift", {"ppm": 9.0}), ("bit_errors", {"rate": 0.1}), ("reordered", {}),
        ("bias", {"quantity": "attitude.roll", "value": 0.1}), ("attitude_offset", {"roll_deg": 1.0}),
        ("inertial_bias", {"accel_mg": (1.0, 0.0, 0.0)}), ("scale", {"quantity": "position.alt", "percent": 1.0}),
    ],
)  # fmt: skip
def test_navigation_is_checked_and_the_device_is_not(craft: AircraftRoles, kind: str, keys: dict[str, Any]) -> None:
    affected = OutputEffects([make_fault(kind, devices=("receiver",), **keys)], craft, TRUTH)
    navigated, stated = output(SOLUTION, "receiver"), output("/receiver/position", "receiver")
    assert not affected.error_intervals(navigated)
    ((from_s, until_s),) = affected.truth_checked_intervals(navigated)
    assert from_s == WHEN["from_s"]
    assert until_s >= WHEN["to_s"]
    assert affected.error_intervals(stated) == [(from_s, until_s)]
    assert not affected.truth_checked_intervals(stated)
    other = output(SOLUTION, "ins")
    assert not affected.truth_checked_intervals(other)


@pytest.mark.parametrize(
    ("kind", "keys"),
    [("stuck", {}), ("gnss_offset", {"up_m": 9.0}), ("clock_jump", {"by_s": 1.0})],
)
def test_on_a_source_they_explain_nothing_and_on_an_altimeter_they_do(
    craft: AircraftRoles, kind: str, keys: dict[str, Any]
) -> None:
    affected = OutputEffects([make_fault(kind, devices=("receiver",), **keys)], craft, TRUTH)
    assert not affected.error_intervals(output(SOLUTION, "receiver"))
    assert affected.truth_checked_intervals(output(SOLUTION, "receiver"))
    if kind == "gnss_offset":
        return
    affected = OutputEffects([make_fault(kind, devices=("altimeter",), **keys)], craft, TRUTH)
    assert affected.error_intervals(output(SOLUTION, "altimeter"))
    assert not affected.truth_checked_intervals(output(SOLUTION, "altimeter"))


@pytest.mark.parametrize(("kind", "keys"), [("bias", {"quantity": "position.lat", "value": 0.1})])
def test_other_faults_explain_wrong_values(craft: AircraftRoles, kind: str, keys: dict[str, Any]) -> None:
    affected = OutputEffects([make_fault(kind, devices=("receiver",), **keys)], craft, TRUTH)
    assert affected.error_intervals(output(SOLUTION, "receiver"))
    assert not affected.truth_checked_intervals(output(SOLUTION, "receiver"))


def test_a_displaced_map_is_checked_where_the_ground_counts(craft: AircraftRoles) -> None:
    affected = OutputEffects([MAKE.validate_python({"kind": "terrain_shift", "up_m": 9.0})], craft, TRUTH)
    for topic in ("/nav/height_above_ground/altimeter", "/nav/clearance_integrity", "/nav/filter_solution"):
        assert affected.truth_checked_intervals(output(topic, "altimeter")) == [(0.0, TRUTH.end_s)]
        assert (0.0, TRUTH.end_s) in affected.loss_intervals(output(topic, "altimeter"))
    assert not affected.truth_checked_intervals(output(SOLUTION, "receiver"))


def test_until_its_flag_must_be_raised_a_fault_is_undetected(craft: AircraftRoles) -> None:
    fault = make_fault("swapped_coordinates", devices=("receiver",))
    begin, within_s = WHEN["from_s"], SOURCE_FLAGS[FaultKind.SWAPPED_COORDINATES].within_s
    assert OutputEffects([fault], craft, TRUTH).undetected_intervals() == [(begin, begin + within_s)]
    assert not OutputEffects(
        [make_fault("latency", devices=("receiver",), by_s=1.0)], craft, TRUTH
    ).undetected_intervals()


def test_a_node_that_babbles_is_compared() -> None:
    assert is_truth_checked(MAKE.validate_python({"kind": "babbling", **WHEN}))
