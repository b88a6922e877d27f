"""Check of a scenario against the configuration.

Its names must exist, its faults must apply to their devices, and each channel of ``[[expect]]`` must be a field of a
message that the daemon records.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from msgspec import structs

from fti.config import CanLink, Config
from fti.devices import BoundDevice, bind_devices
from fti.errors import ConfigError
from fti.hil.faults.applicability import inapplicable_reason
from fti.hil.tables.fault_base import DeviceFault, LinkFault
from fti.hil.tables.fault_types import ByteFault, CanStatus, ClockFault
from fti.hil.tables.schema import Scenario
from fti.messages.outputs import HeightAboveGround, ProvisionalSolution
from fti.messages.topics import MEASUREMENT_CLASSES, OUTPUT_CLASSES

#: Health, ledger, clock, events: their content depends on the flight, so they are not checked.
DAEMON_NAMESPACE = "fti"


def check(scenario: Scenario, config: Config) -> None:
    """Raises ConfigError with file, key and the allowed values."""
    _check_names(f"{scenario.source_name}: sensor", "device", scenario.sensor, [d.name for d in config.device], config)
    _check_names(f"{scenario.source_name}: port", "link", scenario.port, [link.name for link in config.link], config)
    for link in config.link:
        if link.name in scenario.port:
            scenario.port[link.name].check(link, f"{scenario.source_name}: port.{link.name}")
    needs_drivers = any(isinstance(fault, ByteFault | ClockFault) for fault in scenario.fault)
    bound = bind_devices(config) if needs_drivers else []
    for i, fault in enumerate(scenario.fault):
        where = f"{scenario.source_name}: fault[{i}]"
        if isinstance(fault, DeviceFault):
            _check_names(f"{where}.devices", "device", fault.devices, [d.name for d in config.device], config)
            if isinstance(fault, ByteFault | ClockFault):
                _check_applicability(where, fault, bound)
        elif isinstance(fault, LinkFault):
            # only slcan adapters report controller errors
            buses = [link for link in config.link if isinstance(link, CanLink)]
            adapters = [link for link in buses if link.interface == "slcan"]
            kind, able = ("slcan link", adapters) if isinstance(fault, CanStatus) else ("CAN link", buses)
            _check_names(f"{where}.links", kind, fault.links, [link.name for link in able], config)
    for i, expectation in enumerate(scenario.expect):
        if wrong := _channel_error(expectation.channel, config):
            raise ConfigError(f"{scenario.source_name}: expect[{i}].channel = {expectation.channel!r}: {wrong}")


def _check_applicability(where: str, fault: DeviceFault, devices: Sequence[BoundDevice]) -> None:
    """The fault must apply to each named device; without names, to at least one device."""
    reasons = {
        b.device.name: inapplicable_reason(fault, b)
        for b in devices
        if b.device.name in (fault.devices or [b.device.name])
    }
    wrong = {name: reason for name, reason in reasons.items() if reason}
    if fault.devices and wrong:
        name, reason = next(iter(wrong.items()))
        raise ConfigError(f"{where}.devices: {name!r}: {reason}")
    if devices and len(wrong) == len(reasons):
        raise ConfigError(f"{where}: applies to no device of the configuration: {next(iter(wrong.values()))}")


def _check_names(where: str, kind: str, names: Iterable[str], known: Sequence[str], config: Config) -> None:
    for name in names:
        if name not in known:
            allowed = ", ".join(known) or "none"
            raise ConfigError(f"{where}: unknown {kind} {name!r}; {config.path} has: {allowed}")


def _channel_error(channel: str, config: Config) -> str:
    """The error in a topic and its field, with the allowed names; "" if there is none."""
    topic, _, field = channel.rpartition(".")
    begin, *rest = topic.strip("/").split("/")
    if begin == DAEMON_NAMESPACE:
        return ""
    devices = [device.name for device in config.device]
    if begin not in ("nav", *devices):
        return f"unknown topic /{begin}; allowed: nav, {DAEMON_NAMESPACE}, {_join_names(devices)}"
    kinds = OUTPUT_CLASSES if begin == "nav" else MEASUREMENT_CLASSES
    kind = kinds.get(rest[0]) if rest else None
    if kind is None:
        return f"unknown topic {'/'.join(rest)!r} of /{begin}; allowed: {_join_names(kinds)}"
    fields = [one.name for one in structs.fields(kind)]
    field_error = "" if field in fields else f"unknown field {field!r}; allowed: {_join_names(fields)}"
    return _part_error(kind, rest[1:], config) or field_error


def _part_error(kind: Any, parts: Sequence[str], config: Config) -> str:
    """Topics of heights and provisional solutions end with a device name; other topics have no further part."""
    receivers = config.nav.filter.gnss if config.nav.filter else ()
    device_roles = {
        HeightAboveGround: ("nav.altimeters", config.nav.altimeters),
        ProvisionalSolution: ("nav.filter.gnss", receivers),
    }
    role, names = device_roles.get(kind, ("", ()))
    if role and (len(parts) != 1 or parts[0] not in names):
        return f"must end with one of {role}: {_join_names(names)}"
    return f"unknown part {'/'.join(parts)!r}; allowed: none" if parts and not role else ""


def _join_names(names: Any) -> str:
    return ", ".join(names) or "none"
