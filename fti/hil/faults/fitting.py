"""Which fault can be of which device, and the stages of a device's faults."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

import numpy as np

from fti import drivers
from fti.config import StrictModel
from fti.hil.faults.checksums import Change
from fti.hil.faults.gnss import WITH_RECEIVER, OfGnss
from fti.hil.faults.messages import Become, Frozen, Held, Spoiled, Stage, Swapped, with_bit_errors, without_end
from fti.hil.faults.places import CHECKSUMS, LABELS, TIMED, checksum_of, label_of, sends_time
from fti.hil.faults.values import random_of
from fti.hil.tables.bases import OnDevices
from fti.hil.tables.kinds import (
    BitErrors,
    Burst,
    BusOff,
    ClockDrift,
    ClockJump,
    Cut,
    Duplicated,
    Fault,
    Freeze,
    LeverArm,
    LostHeader,
    OfPower,
    Reordered,
    Truncated,
    WrongChecksum,
    WrongLabel,
)
from fti.service.binding import BoundDevice

POWER_UNIT = "power_unit"
#: Kinds of faults that need something of a protocol, and the drivers whose protocol may have it.
NEEDED: Sequence[tuple[Any, Collection[str]]] = (
    (WrongChecksum, CHECKSUMS),
    (WrongLabel, LABELS),
    (ClockJump | ClockDrift, TIMED),
    (OfGnss, WITH_RECEIVER),
)


def drivers_of(kind: type[StrictModel]) -> tuple[str, ...] | None:
    """The drivers whose devices may have a kind of fault, in alphabetical order; None: every driver, or no device."""
    if issubclass(kind, LostHeader):
        return tuple(sorted(name for name in drivers.names() if frozenset({"can"}) != drivers.load(name).CARRIERS))
    return next((tuple(sorted(names)) for kinds, names in NEEDED if issubclass(kind, kinds)), None)


def why_not(fault: OnDevices, bound: BoundDevice) -> str:
    """Why a fault cannot be of a device, and of which drivers it can; "" when it can."""
    driver, options = bound.device.driver, bound.options
    if isinstance(fault, WrongChecksum) and checksum_of(driver, options) is None:
        return f"{_told(driver, options)} has no checksum that the emulator could spoil; {_listed(CHECKSUMS)} may have"
    if isinstance(fault, WrongLabel) and label_of(driver, options) is None:
        return f"{_told(driver, options)} gives its messages no identifier; {_listed(LABELS)} do"
    if isinstance(fault, ClockJump | ClockDrift) and not sends_time(driver, options):
        return f"{_told(driver, options)} does not send its time; {_listed(TIMED)} do (arinc429 in packets)"
    if isinstance(fault, OfGnss) and driver not in WITH_RECEIVER:
        return f"{driver} has no satellite receiver; {_listed(WITH_RECEIVER)} may have"
    return _why_not_connected(fault, bound)


def _why_not_connected(fault: OnDevices, bound: BoundDevice) -> str:
    """The same for what depends on the line and the supply of a device."""
    driver = bound.device.driver
    if isinstance(fault, LostHeader) and _on_can(bound):
        return f"{driver} is on CAN, where a frame has its header or is none; every driver of a line can lose it"
    if isinstance(fault, OfPower) and driver == POWER_UNIT:
        return f"{driver} feeds itself and has no breaker; every other driver can lose its power"
    if isinstance(fault, LeverArm) and driver == POWER_UNIT:
        return f"{driver} measures nothing that depends on its place"
    return ""


def _told(driver: str, options: StrictModel) -> str:
    given = options.model_dump(include=options.model_fields_set)
    short = {key: value for key, value in given.items() if isinstance(value, str | bool | int) and len(str(value)) < 20}
    return driver + (f" with {', '.join(f'{k} = {v!r}' for k, v in short.items())}" if short else "")


def _listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(names))


def _on_can(bound: BoundDevice) -> bool:
    return frozenset({"can"}) == bound.driver.CARRIERS


def is_of(fault: Fault, bound: BoundDevice) -> bool:
    """Is this a fault of this device?  Without names it is one of every device that it can be of."""
    if isinstance(fault, BusOff):
        return _on_can(bound) and (not fault.links or bound.device.link in fault.links)
    if not isinstance(fault, OnDevices):
        return False
    return bound.device.name in fault.devices if fault.devices else not why_not(fault, bound)


def stages_of(bound: BoundDevice, faults: Sequence[Fault], seed: int, end_s: float) -> list[Stage]:
    """The stages of the bytes of a device, in the order of the scenario.  end_s : when its last message leaves."""
    found = []
    for i, fault in enumerate(faults):
        if is_of(fault, bound):
            stage = _stage(fault, bound, random_of(seed, bound.device.name, i), end_s)
            found += [stage] if stage else []
    return found


def _stage(fault: Fault, bound: BoundDevice, rng: np.random.Generator, end_s: float) -> Stage | None:
    if isinstance(fault, Freeze):
        return Frozen(fault)
    if isinstance(fault, Burst):
        return Held(fault, end_s)
    if isinstance(fault, Reordered):
        return Swapped(fault, rng, end_s)
    become = _become(fault, bound, rng)
    return Spoiled(fault, become, rng) if become and isinstance(fault, OnDevices | BusOff) else None


def _become(fault: Fault, bound: BoundDevice, rng: np.random.Generator) -> Become | None:
    """What a fault without memory makes of a message; None for the faults of another kind."""
    on_can = _on_can(bound)
    become: Become | None = None
    if isinstance(fault, Cut | BusOff):
        become = lambda message: []  # noqa: E731
    elif isinstance(fault, Duplicated):
        become = lambda message: [message, message]  # noqa: E731
    elif isinstance(fault, BitErrors):
        become = with_bit_errors(fault, rng, on_can=on_can)
    elif isinstance(fault, LostHeader):
        become = lambda message: [message[fault.count :]]  # noqa: E731
    elif isinstance(fault, Truncated):
        become = without_end(fault.count, on_can=on_can)
    elif isinstance(fault, WrongChecksum):
        become = _one(checksum_of(bound.device.driver, bound.options))
    elif isinstance(fault, WrongLabel):
        become = _one(label_of(bound.device.driver, bound.options))
    return become


def _one(change: Change | None) -> Become | None:
    return None if change is None else lambda message: [change(message)]
