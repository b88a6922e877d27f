"""The description of fault kinds agrees with what scenarios, drivers and the score do."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from fti import config as configuration
from fti.config.keys import NO_UNIT, allowed_values
from fti.devices import bind_devices
from fti.hil import scenario as scenarios
from fti.hil.faults.applicability import drivers_of, inapplicable_reason
from fti.hil.oracle.fault_catalogue import fault_kinds
from fti.hil.oracle.fault_flags import flags_of_scenario
from fti.hil.oracle.flag_definitions import ExpectedFlag, FaultFlags
from fti.hil.oracle.flags_of_kinds import FLAGS
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.hil.scenario import Scenario
from fti.hil.tables.fault_base import DeviceFault
from fti.hil.tables.fault_types import Fault, FaultKind, LeverArm, PowerFault, WrongChecksum
from tests.helpers import ROOT

MODELS = get_args(get_args(Fault)[0])
FIELDS = [(model, name) for model in MODELS for name in model.model_fields if name != "kind"]


# ------------------------------------------------------------------------------------------------------------ keys


@pytest.mark.parametrize(("model", "name"), FIELDS, ids=lambda part: getattr(part, "__name__", part))
def test_every_key_has_a_description_and_a_unit_or_states_that_it_has_none(model: Any, name: str) -> None:
    field = model.model_fields[name]
    assert field.description
    unit = field.json_schema_extra["unit"]
    suffix = name.rpartition("_")[2]
    if suffix in ("m", "s", "hz", "v"):
        assert unit.lower() == suffix
    is_text = not re.search(r"float|int", str(field.annotation))
    assert (unit == NO_UNIT) is (is_text or name == "can_id")


def test_every_kind_is_described_once_with_all_of_its_keys() -> None:
    assert list(fault_kinds()) == [kind.value for kind in FaultKind]
    for model in MODELS:
        (name,) = get_args(model.model_fields["kind"].annotation)
        kind = fault_kinds()[name]
        assert {key.name for key in kind.keys} == model.model_fields.keys() - {"kind"}
        assert {key.name for key in kind.keys if not key.default} == {
            key for key, field in model.model_fields.items() if key != "kind" and field.is_required()
        }
        for key in kind.keys:
            if key.default not in ("", "none"):
                value = tomllib.loads(f"value = {key.default}")["value"]
                default = model.model_fields[key.name].default
                assert value == (list(default) if isinstance(default, tuple) else default)


@pytest.mark.parametrize(
    ("kind", "key", "text"),
    [
        ("bit_errors", "rate", "number > 0, <= 1"),
        ("off_track", "right_m", "number >= -20000, <= 20000"),
        ("babbling", "can_id", "whole number >= 0, < 536870912"),
        ("brown_out", "supply_v", "number >= 0, < 28"),
        ("fog", "echo_m", "2 numbers, each number > 0, <= 1e+12"),
        ("bias", "value", "number"),
        ("can_status", "flags", "list, not empty, each one of rx_fifo_full, tx_fifo_full, error_warning, "),
    ],
)
def test_limits_are_those_of_the_table(kind: str, key: str, text: str) -> None:
    (found,) = (one.limits for one in fault_kinds()[kind].keys if one.name == key)
    assert found.startswith(text)


def test_limits_of_an_optional_text() -> None:
    assert allowed_values({"anyOf": [{"type": "string"}, {"type": "null"}]}) == "text"


# -------------------------------------------------------------------------------------------- subjects and examples


def test_the_drivers_that_can_have_a_kind_are_those_that_a_scenario_accepts() -> None:
    """Over every device of every configuration; a driver that is stated may still refuse by its options."""
    configs = [configuration.load(file) for file in sorted((ROOT / "configs").glob("*.toml"))]
    bound = [one for config in configs for one in bind_devices(config)]
    for model in MODELS:
        stated = drivers_of(model)
        if issubclass(model, DeviceFault):
            fault: Any = model.model_construct(devices=(), from_s=1.0, to_s=2.0)
            accepted = {one.device.driver for one in bound if not inapplicable_reason(fault, one)}
            used = {one.device.driver for one in bound}
            possible = used - {"power_unit"} if issubclass(model, PowerFault | LeverArm) else used
            needs_options = {"ascii_line"} if issubclass(model, WrongChecksum) else set()  # {checksum} in its template
            assert accepted == (possible if stated is None else used & set(stated) - needs_options), model.__name__
        else:
            assert stated is None


def test_every_example_is_valid_together_with_the_demonstration(tmp_path: Path) -> None:
    file = tmp_path / "examples.toml"
    head = f'title = "Examples"\ndescription = ""\nconfig = "{ROOT}/configs/demo.toml"\n'
    file.write_text(head + "\n".join(kind.example for kind in fault_kinds().values()))
    scenario = scenarios.load(file)
    scenarios.load_config(scenario)
    assert [fault.kind for fault in scenario.fault] == [kind.value for kind in FaultKind]


# ------------------------------------------------------------------------------------------------------------ flags

WHEN = {"from_s": 10.0, "to_s": 40.0}
A_RANGE = {"quantity": "range.slant_range", "devices": ("autopilot",)}
OF_DEVICES: tuple[dict[str, Any], ...] = (
    {"kind": "ramp", "rate": 20.0, **A_RANGE},
    {"kind": "bias", "value": 50.0, **A_RANGE},
    {"kind": "noise", "sd": 50.0, **A_RANGE},
    {"kind": "wrong_unit", "factor": 0.3, **A_RANGE},
    {"kind": "scale", "percent": 60.0, **A_RANGE},
    {"kind": "forced", "value": 7.0, **A_RANGE},
    {"kind": "fog", "visibility_m": 20.0, "devices": ("autopilot",)},
    {"kind": "fog", "visibility_m": 20.0, "echo_m": (9.0, 5.0), "devices": ("autopilot",)},
    *({"kind": kind} for kind in ("brown_out", "bus_off", "cut", "freeze", "lost_header", "stuck", "truncated")),
    *({"kind": kind} for kind in ("babbling", "breaker", "reordered", "wrong_checksum", "wrong_label")),
    {"kind": "gnss_offset", "devices": ("ins",), "up_m": 60.0},
    {"kind": "burst", "hold_s": 9.0},
    {"kind": "invalid", "flags": ("unlocked",)},
    {"kind": "off_track", "right_m": 150.0},
    {"kind": "bit_errors", "rate": 0.1},
    {"kind": "clock_drift", "ppm": 9.0},
)
OBSTACLE: dict[str, Any] = {"kind": "obstacle", "before_threshold_m": 2000.0, "height_m": 60.0}


def truth() -> TruthSeries:
    """From 4500 m before the threshold over it at 60 m/s, up and down by 45 m, beside the track for a while.

    The roll of the turn to the track is in it.
    """
    t = np.arange(0.0, 300.0, 0.04)
    zero = 0.0 * t
    offset = np.where((t > 20.0) & (t < 30.0), 400.0, 0.0)
    roll = np.where((t > 34.0) & (t < 36.0), np.radians(15.0), 0.0)
    return TruthSeries(t, 90.0 + 45.0 * np.sin(t / 4.0), 4500.0 - 60.0 * t, offset, roll, zero, zero)


def scenario_of(config: str, *faults: dict[str, Any]) -> Scenario:
    table = {"title": "", "description": "", "config": f"{ROOT}/configs/{config}.toml", "fault": faults}
    return Scenario.model_validate(table)


def without_position(kind: str) -> Iterator[Scenario]:
    """The only device for the position is lost; the inertial unit of the filter later, or before, or not at all."""
    receiver = {"kind": kind, "devices": ("receiver",), **WHEN}
    for from_s in (20.0, 5.0, 200.0):
        unit = {"kind": "cut" if kind == "gnss_outage" else kind, "devices": ("ins",), "from_s": from_s, "to_s": 240.0}
        yield scenario_of("fallbacks", receiver, unit)


def all_on_one_bus(folder: Path) -> Scenario:
    """A device on CAN that has every role: no shipped configuration has one."""
    file = folder / "bus.toml"
    file.write_text(
        '[session]\nname = "bus"\n[[link]]\nname = "can"\nkind = "can"\ninterface = "slcan"\nchannel = "x"\n'
        '[[device]]\nname = "unit"\nlink = "can"\ndriver = "canaerospace"\n'
        '[device.altimeter]\nkind = "radar"\nrange_m = [0, 800]\n'
        '[nav]\nposition = ["unit"]\nattitude = ["unit"]\naltimeters = ["unit"]\n'
    )
    return scenario_of("demo", {"kind": "bus_off", **WHEN}).model_copy(update={"config": str(file)})


def cases(folder: Path) -> Iterator[Scenario]:
    """Shipped scenarios; then what none of them has."""
    yield from (scenarios.load(scenarios.find(name)) for name in scenarios.shipped_names())
    yield scenario_of("demo", OBSTACLE, *({**WHEN, **fault} for fault in OF_DEVICES))
    for kind in ("cut", "invalid", "breaker", "brown_out", "gnss_outage"):
        yield from without_position(kind)
    yield all_on_one_bus(folder)


def as_stated(
    expected_flag: ExpectedFlag, one: FaultFlags, craft: AircraftRoles, fault: Any
) -> tuple[str, tuple[str, ...]]:
    """Place and words of a duty with capitals in the place of the names of a configuration."""
    devices = [bound.device.name for bound in craft.devices]
    is_link, of_navigation = one.subject in links(craft), one.subject == "navigation"
    on_it = craft.devices_on_link(one.subject) if is_link else devices if of_navigation else [one.subject]

    def capital(name: str) -> str:
        if is_link and name == one.subject:
            return "LINK"
        if name in on_it:
            return "DEVICE"
        return "UNIT" if name in craft.power_units else "ALTIMETER" if name in craft.altimeters else name

    def word(text: str) -> str:
        flags = getattr(fault, "flags", ())
        head, _, last = text.rpartition(" ")
        if text in flags or text.removeprefix("slcan_") in flags:
            return "slcan_FLAG" if is_link else "FLAG"
        if text.startswith(f"{one.subject}_"):
            return text.replace(one.subject, "DEVICE")
        return f"{head} DEVICE" if last in on_it else text

    words = [*map(word, expected_flag.words)]
    if words == ["invalid"] and fault.kind == "invalid":  # FLAG stands for none or more of them
        words.append("FLAG")
    return "/".join(map(capital, expected_flag.place.split("/"))), tuple(dict.fromkeys(words))


def links(craft: AircraftRoles) -> set[str]:
    return {bound.device.link for bound in craft.devices}


def test_each_stated_flag_is_expected_of_some_fault_of_its_kind_and_no_other_is(tmp_path: Path) -> None:
    """Reality is what the score expects: of every shipped scenario, and of kinds and conditions that none has."""
    expected: dict[FaultKind, set[tuple[str, tuple[str, ...]]]] = {kind: set() for kind in FaultKind}
    for scenario in cases(tmp_path):
        config = scenarios.load_config(scenario)
        craft = AircraftRoles(config, bind_devices(config), scenario)
        for index, one in flags_of_scenario(scenario.fault, craft, truth()):
            fault = scenario.fault[index]
            expected[FaultKind(fault.kind)] |= {
                as_stated(expected_flag, one, craft, fault) for expected_flag in one.expected_flags
            }
    assert expected == {kind: {(flag.place, flag.words) for flag in FLAGS[kind]} for kind in FaultKind}


def test_a_kind_without_flags_has_a_reason() -> None:
    assert all(kind.flags or kind.no_flag for kind in fault_kinds().values())
    assert {name for name, kind in fault_kinds().items() if not kind.flags} == {
        "babbling", "clock_drift", "inertial_bias", "lever_arm", "reordered", "terrain_shift",
    }  # fmt: skip
