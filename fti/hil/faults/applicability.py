"""Which faults apply to which device, and the message stages of a device's faults."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

import numpy as np

from fti import drivers
from fti.config import StrictModel
from fti.devices import BoundDevice
from fti.hil.faults.checksum_faults import MessageChange
from fti.hil.faults.fault_targets import (
    CHECKSUMS,
    DRIVERS_WITH_TIME,
    LABELS,
    checksum_change,
    identifier_change,
    sends_time,
)
from fti.hil.faults.gnss import DRIVERS_WITH_RECEIVER, GnssFault
from fti.hil.faults.messages import (
    BurstStage,
    CorruptionStage,
    FreezeStage,
    MessageEffect,
    MessageStage,
    ReorderStage,
    bit_error_effect,
    truncation_effect,
)
from fti.hil.faults.values import fault_rng
from fti.hil.tables import fault_types
from fti.hil.tables.fault_base import DeviceFault

POWER_UNIT = "power_unit"
#: Faults that need a feature of the protocol, and the drivers whose protocol may have it.
DRIVERS_BY_FAULT: Sequence[tuple[Any, Collection[str]]] = (
    (fault_types.WrongChecksum, CHECKSUMS),
    (fault_types.WrongLabel, LABELS),
    (fault_types.ClockJump | fault_types.ClockDrift, DRIVERS_WITH_TIME),
    (GnssFault, DRIVERS_WITH_RECEIVER),
)


def drivers_of(kind: type[StrictModel]) -> tuple[str, ...] | None:
    """The drivers whose devices may have a kind of fault, in alphabetical order; None: no restriction, or no device."""
    if issubclass(kind, fault_types.LostHeader):
        return tuple(sorted(name for name in drivers.names() if frozenset({"can"}) != drivers.load(name).CARRIERS))
    return next((tuple(sorted(names)) for kinds, names in DRIVERS_BY_FAULT if issubclass(kind, kinds)), None)


def inapplicable_reason(fault: DeviceFault, bound: BoundDevice) -> str:
    """Why a fault does not apply to a device, and the drivers to which it does; "" if it applies."""
    driver, options = bound.device.driver, bound.options
    if isinstance(fault, fault_types.WrongChecksum) and checksum_change(driver, options) is None:
        return f"{_driver_with_options(driver, options)} has no checksum; allowed: {_join_names(CHECKSUMS)}"
    if isinstance(fault, fault_types.WrongLabel) and identifier_change(driver, options) is None:
        return f"{_driver_with_options(driver, options)} has no message identifier; allowed: {_join_names(LABELS)}"
    if isinstance(fault, fault_types.ClockJump | fault_types.ClockDrift) and not sends_time(driver, options):
        allowed = f"{_join_names(DRIVERS_WITH_TIME)} (arinc429 in packets)"
        return f"{_driver_with_options(driver, options)} does not send its time; allowed: {allowed}"
    if isinstance(fault, GnssFault) and driver not in DRIVERS_WITH_RECEIVER:
        return f"{driver} has no satellite receiver; allowed: {_join_names(DRIVERS_WITH_RECEIVER)}"
    return _connection_reason(fault, bound)


def _connection_reason(fault: DeviceFault, bound: BoundDevice) -> str:
    """The same for faults that depend on the line and the supply of a device."""
    driver = bound.device.driver
    if isinstance(fault, fault_types.LostHeader) and _on_can(bound):
        return f"{driver} is on CAN, where every frame has its header; allowed: drivers that are not on CAN"
    if isinstance(fault, fault_types.PowerFault) and driver == POWER_UNIT:
        return f"{driver} has its own supply and no breaker; allowed: every other driver"
    if isinstance(fault, fault_types.LeverArm) and driver == POWER_UNIT:
        return f"{driver} measures nothing that depends on its position; allowed: every other driver"
    return ""


def _driver_with_options(driver: str, options: StrictModel) -> str:
    explicit = options.model_dump(include=options.model_fields_set)
    short = {
        key: value for key, value in explicit.items() if isinstance(value, str | bool | int) and len(str(value)) < 20
    }
    return driver + (f" with {', '.join(f'{k} = {v!r}' for k, v in short.items())}" if short else "")


def _join_names(names: Iterable[str]) -> str:
    return ", ".join(sorted(names))


def _on_can(bound: BoundDevice) -> bool:
    return frozenset({"can"}) == bound.driver.CARRIERS


def applies_to(fault: fault_types.Fault, bound: BoundDevice) -> bool:
    """Does the fault apply to the device?  A fault that names no device applies to every possible one."""
    if isinstance(fault, fault_types.BusOff):
        return _on_can(bound) and (not fault.links or bound.device.link in fault.links)
    if not isinstance(fault, DeviceFault):
        return False
    return bound.device.name in fault.devices if fault.devices else not inapplicable_reason(fault, bound)


def stages_of(bound: BoundDevice, faults: Sequence[fault_types.Fault], seed: int, end_s: float) -> list[MessageStage]:
    """The message stages of a device, in the order of the scenario.  end_s : time of its last message [s]"""
    found = []
    for i, fault in enumerate(faults):
        if applies_to(fault, bound):
            stage = _stage(fault, bound, fault_rng(seed, bound.device.name, i), end_s)
            found += [stage] if stage else []
    return found


def _stage(fault: fault_types.Fault, bound: BoundDevice, rng: np.random.Generator, end_s: float) -> MessageStage | None:
    if isinstance(fault, fault_types.Freeze):
        return FreezeStage(fault)
    if isinstance(fault, fault_types.Burst):
        return BurstStage(fault, end_s)
    if isinstance(fault, fault_types.Reordered):
        return ReorderStage(fault, rng, end_s)
    effect = _message_effect(fault, bound, rng)
    return (
        CorruptionStage(fault, effect, rng) if effect and isinstance(fault, DeviceFault | fault_types.BusOff) else None
    )


def _message_effect(fault: fault_types.Fault, bound: BoundDevice, rng: np.random.Generator) -> MessageEffect | None:
    """The effect of a fault without memory on a message; None for other faults."""
    on_can = _on_can(bound)
    effect: MessageEffect | None = None
    if isinstance(fault, fault_types.Cut | fault_types.BusOff):
        effect = lambda message: []  # noqa: E731
    elif isinstance(fault, fault_types.Duplicated):
        effect = lambda message: [message, message]  # noqa: E731
    elif isinstance(fault, fault_types.BitErrors):
        effect = bit_error_effect(fault, rng, on_can=on_can)
    elif isinstance(fault, fault_types.LostHeader):
        effect = lambda message: [message[fault.count :]]  # noqa: E731
    elif isinstance(fault, fault_types.Truncated):
        effect = truncation_effect(fault.count, on_can=on_can)
    elif isinstance(fault, fault_types.WrongChecksum):
        effect = _single_change(checksum_change(bound.device.driver, bound.options))
    elif isinstance(fault, fault_types.WrongLabel):
        effect = _single_change(identifier_change(bound.device.driver, bound.options))
    return effect


def _single_change(change: MessageChange | None) -> MessageEffect | None:
    return None if change is None else lambda message: [change(message)]
