"""Flags of wrong sources: one table decides whether they are due; wrong outputs are judged either way."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from fti.hil import scenario as scenarios
from fti.hil.expected import source_flags
from fti.hil.expected.affected import Affected
from fti.hil.expected.aircraft import Aircraft, Truth
from fti.hil.expected.compared import is_compared
from fti.hil.expected.flags import told
from fti.hil.expected.required_outputs import RequiredOutput
from fti.hil.expected.source_flags import SOURCE_FLAGS
from fti.hil.tables.kinds import Fault, FaultKind
from fti.service.binding import bind_devices

MAKE: TypeAdapter[Fault] = TypeAdapter(Fault)
T = np.arange(0.0, 120.0, 0.1)
TRUTH = Truth(T, 0 * T + 200.0, 4000.0 - 30.0 * T, *[0 * T] * 4)
WHEN: dict[str, Any] = {"from_s": 20.0, "to_s": 90.0}
KEYS: dict[FaultKind, dict[str, Any]] = {
    FaultKind.GNSS_RAMP: {"devices": ("receiver",), "north_mps": 1.0},
    FaultKind.SWAPPED_COORDINATES: {"devices": ("receiver",)},
    FaultKind.UNDULATION: {"devices": ("receiver",)},
    FaultKind.ATTITUDE_OFFSET: {"devices": ("ins",), "roll_deg": 5.0},
}
SOLUTION = "/nav/nav_solution"


@pytest.fixture(scope="module")
def craft() -> Aircraft:
    scenario = scenarios.load(scenarios.find("fallbacks"))
    config = scenarios.load_config(scenario)
    return Aircraft(config, bind_devices(config), scenario)


def made(kind: FaultKind | str, **keys: Any) -> Fault:
    return MAKE.validate_python({"kind": str(kind), **WHEN, **keys})


def due(fault: Fault, craft: Aircraft) -> list[tuple[str, tuple[str, ...], float]]:
    return [(duty.place, duty.words, duty.within_s) for one in told(fault, craft, TRUTH) for duty in one.duties]


@pytest.mark.parametrize("kind", SOURCE_FLAGS, ids=str)
def test_a_row_of_the_table_makes_the_flag_due(
    kind: FaultKind, craft: Aircraft, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault, row = made(kind, **KEYS[kind]), SOURCE_FLAGS[kind]
    for is_due in (False, True):
        monkeypatch.setattr(source_flags, "SOURCE_FLAGS", {kind: replace(row, is_due=is_due)})
        flag = (SOLUTION, (f"{row.role} not from {KEYS[kind]['devices'][0]}",), row.within_s)
        assert due(fault, craft) == [flag] * is_due
        assert bool(told(fault, craft, TRUTH)[0].unknown) is not is_due


def test_the_flag_of_a_source_that_nobody_prefers_is_not_due(craft: Aircraft, monkeypatch: pytest.MonkeyPatch) -> None:
    row = replace(SOURCE_FLAGS[FaultKind.ATTITUDE_OFFSET], is_due=True)
    monkeypatch.setattr(source_flags, "SOURCE_FLAGS", {FaultKind.ATTITUDE_OFFSET: row})
    assert not due(made("attitude_offset", devices=("ahrs",), roll_deg=5.0), craft)


# ----------------------------------------------------------------------------------------- which outputs are judged


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
def test_navigation_is_judged_and_what_the_device_states_is_not(
    craft: Aircraft, kind: str, keys: dict[str, Any]
) -> None:
    affected = Affected([made(kind, devices=("receiver",), **keys)], craft, TRUTH)
    navigated, stated = output(SOLUTION, "receiver"), output("/receiver/position", "receiver")
    assert not affected.wrong(navigated)
    ((from_s, until_s),) = affected.compared(navigated)
    assert from_s == WHEN["from_s"]
    assert until_s >= WHEN["to_s"]
    assert affected.wrong(stated) == [(from_s, until_s)]
    assert not affected.compared(stated)
    other = output(SOLUTION, "ins")
    assert not affected.compared(other)


@pytest.mark.parametrize(
    ("kind", "keys"),
    [("stuck", {}), ("gnss_offset", {"up_m": 9.0}), ("bias", {"quantity": "position.lat", "value": 0.1})],
)
def test_other_faults_explain_wrong_values(craft: Aircraft, kind: str, keys: dict[str, Any]) -> None:
    affected = Affected([made(kind, devices=("receiver",), **keys)], craft, TRUTH)
    assert affected.wrong(output(SOLUTION, "receiver"))
    assert not affected.compared(output(SOLUTION, "receiver"))


def test_a_displaced_map_is_judged_where_the_ground_counts(craft: Aircraft) -> None:
    affected = Affected([MAKE.validate_python({"kind": "terrain_shift", "up_m": 9.0})], craft, TRUTH)
    for topic in ("/nav/height_above_ground/altimeter", "/nav/clearance_integrity", "/nav/filter_solution"):
        assert affected.compared(output(topic, "altimeter")) == [(0.0, TRUTH.end_s)]
        assert (0.0, TRUTH.end_s) in affected.lost(output(topic, "altimeter"))
    assert not affected.compared(output(SOLUTION, "receiver"))


def test_values_are_excused_until_their_flag_must_be_raised(craft: Aircraft, monkeypatch: pytest.MonkeyPatch) -> None:
    fault = made("swapped_coordinates", devices=("receiver",))
    assert not Affected([fault], craft, TRUTH).undetected()
    row = replace(SOURCE_FLAGS[FaultKind.SWAPPED_COORDINATES], is_due=True, within_s=4.0)
    monkeypatch.setattr(source_flags, "SOURCE_FLAGS", {FaultKind.SWAPPED_COORDINATES: row})
    assert Affected([fault], craft, TRUTH).undetected() == [(20.0, 24.0)]


def test_a_node_that_babbles_is_compared() -> None:
    assert is_compared(MAKE.validate_python({"kind": "babbling", **WHEN}))
