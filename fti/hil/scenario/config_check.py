"""Check of a scenario against the configuration: its names must exist, its faults must apply to their devices."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from fti.config import CanLink, Config
from fti.devices import BoundDevice, bind_devices
from fti.errors import ConfigError
from fti.hil.faults.applicability import inapplicable_reason
from fti.hil.scenario import expect_channels
from fti.hil.tables.fault_base import DeviceFault, LinkFault
from fti.hil.tables.fault_types import ByteFault, CanStatus, ClockFault
from fti.hil.tables.schema import Scenario


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
            _check_links(f"{where}.links", fault, config)
    for i, expectation in enumerate(scenario.expect):
        if wrong := expect_channels.channel_error(expectation.channel, config):
            raise ConfigError(f"{scenario.source_name}: expect[{i}].channel = {expectation.channel!r}: {wrong}")


def _check_links(where: str, fault: LinkFault, config: Config) -> None:
    """Only slcan adapters report controller errors; the other faults apply to any CAN link."""
    buses = [link for link in config.link if isinstance(link, CanLink)]
    if isinstance(fault, CanStatus):
        adapters = [link.name for link in buses if link.interface == "slcan"]
        _check_names(where, "slcan link", fault.links, adapters, config)
    else:
        _check_names(where, "CAN link", fault.links, [link.name for link in buses], config)


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
