"""Every kind of fault has stated what the daemon must say of it."""

from __future__ import annotations

import typing
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from fti.devices import bind_devices
from fti.hil import scenario as scenarios
from fti.hil.oracle.device_flags import RULES
from fti.hil.oracle.fault_flags import flags_of_fault
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.hil.tables import fault_types
from fti.hil.tables.fault_base import DeviceFault
from fti.hil.tables.fault_types import BitErrors, FaultKind, Truncated

WHEN: dict[str, Any] = {"devices": ("air_data",), "from_s": 20.0, "to_s": 26.0}
BAD_BITS = BitErrors(kind="bit_errors", rate=0.01, **WHEN)
OF_DEVICES = [
    kind
    for group in (fault_types.ValueFault, fault_types.ClockFault, fault_types.ByteFault, fault_types.PowerFault)
    for kind in typing.get_args(group)
    if issubclass(kind, DeviceFault)
]


@pytest.mark.parametrize("kind", OF_DEVICES, ids=lambda kind: kind.__name__)
def test_one_rule_is_for_each_kind_of_a_device(kind: type) -> None:
    matching = [rule for classes, rule in RULES if issubclass(kind, classes)]
    assert matching, "the daemon must say something of it, or nobody knows it yet: state which"


def test_all_kinds_are_of_the_world_of_a_device_or_of_a_line() -> None:
    stated = {typing.get_args(kind.model_fields["kind"].annotation)[0] for kind in OF_DEVICES}
    others = {"obstacle", "off_track", "terrain_shift", "babbling", "bus_off", "can_status"}
    assert stated | others == {kind.value for kind in FaultKind}


@pytest.mark.parametrize(("fault", "due"), [(Truncated(kind="truncated", **WHEN), True), (BAD_BITS, False)])
def test_of_what_is_damaged_on_a_bus_a_frame_that_is_too_short_must_be_refused(
    fault: fault_types.Fault, due: bool
) -> None:
    """Wrong data in a whole frame are another value, for all that anybody knows."""
    scenario = scenarios.load(scenarios.find("nominal"))
    config = scenarios.load_config(scenario)
    t = np.arange(0.0, 60.0, 0.1)
    (one,) = flags_of_fault(fault, AircraftRoles(config, bind_devices(config), scenario), TruthSeries(t, *[0 * t] * 6))
    assert [(expected_flag.place, expected_flag.words) for expected_flag in one.expected_flags] == [
        ("/fti/health/devices/air_data", ("damaged bytes",)) for _ in range(due)
    ]
    assert bool(one.unknown) is not due


@pytest.mark.parametrize("kind", ["breaker", "brown_out"])
def test_power_that_every_device_loses_is_not_expected_of_the_power_unit(kind: str) -> None:
    """It feeds itself and has no breaker."""
    scenario = scenarios.load(scenarios.find("nominal"))
    config = scenarios.load_config(scenario)
    t = np.arange(0.0, 60.0, 0.1)
    fault = TypeAdapter[fault_types.Fault](fault_types.Fault).validate_python(
        {"kind": kind, "from_s": 20.0, "to_s": 26.0}
    )
    flags = flags_of_fault(fault, AircraftRoles(config, bind_devices(config), scenario), TruthSeries(t, *[0 * t] * 6))
    assert [one.subject for one in flags] == [device.name for device in config.device if device.name != "pdu"]
