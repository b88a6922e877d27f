"""Writes the configuration of found devices: commented TOML that ``fti check`` accepts."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fti.cli._port_survey import FoundDevice, FoundPort
from fti.messages.measurements import Attitude, ImuSample, Measurement, Position, RadioHeight, Range, Velocity

#: Range limits and full beam width of an altimeter whose data sheet is not known: FreeFlight RA-4500, LightWare SF30.
ALTIMETERS: dict[type[Measurement], tuple[str, str, str]] = {
    RadioHeight: ("radar", "[0.0, 760.0]", "40.0"),
    Range: ("laser", "[0.2, 100.0]", "0.3"),
}
HEAD = """\
# Written by fti new from what the devices sent.  Lines with CHECK need the data sheet or the aircraft.
# fti check {file} explains it; docs/reference/configuration.md describes every key.

[session]
name = {name}
directory = "data"             # of the recordings, relative to this file
origin = "flight"
"""
LEVER_ARM = "lever_arm_b = {}  # {}reference point to sensor: forward, right, down [m]\n"
MOUNTING = "rpy_bs_deg = [0.0, 0.0, 0.0]   # CHECK: mounting: roll, pitch, yaw\n"


@dataclass(frozen=True, slots=True)
class NamedPort:
    """A port with the name of its link, and of its device if it has one."""

    link: str
    device: str
    found: FoundPort


@dataclass(frozen=True, slots=True)
class Answers:
    """What a person knows: order of the devices of a role, and lever arm of a device [m]; others are missing."""

    roles: Mapping[str, Sequence[str]] = field(default_factory=dict)
    lever_arms: Mapping[str, Sequence[float]] = field(default_factory=dict)


def name_ports(ports: Sequence[FoundPort]) -> list[NamedPort]:
    """The ports with unique names."""
    links = list(_unique(_link_names(ports)))
    devices = _unique(_device_names(links, ports))
    return [NamedPort(*each) for each in zip(links, devices, ports, strict=True)]


def config_text(file: Path, name: str, ports: Sequence[NamedPort], answers: Answers) -> str:
    """The text of the configuration.  file : where it will be; name : of the session"""
    parts = [HEAD.format(file=file, name=json.dumps(name))]
    for port in ports:
        found = port.found
        parts.append(f"\n[[link]]\nname = {json.dumps(port.link)}\n{_keys(found.link)}")
        if found.device is None:
            listen = f"fti listen {port.link} --config {file}"
            parts.append(f"# {_silence(found)}: the link is recorded and not decoded.  CHECK: {listen}\n")
    parts += [_device(port, answers) for port in ports if port.found.device]
    return "".join([*parts, *_roles(ports, answers)])


def _silence(port: FoundPort) -> str:
    """Why no device is found on a port."""
    if port.is_busy:
        return "the address was in use" if port.link["kind"] == "udp" else "the port was in use"
    return f"{port.received} bytes came, which no driver decodes" if port.received else "no byte came"


def is_mounted(device: FoundDevice) -> bool:
    """Whether the place of the sensor in the aircraft matters."""
    return bool(device.kinds & {Attitude, Position, Velocity, ImuSample, *ALTIMETERS})


def role_candidates(ports: Sequence[NamedPort]) -> dict[str, list[str]]:
    """Devices that can have each role: of position and attitude first those that have both."""
    devices = [(port.device, port.found.device.kinds) for port in ports if port.found.device]
    devices.sort(key=lambda each: -len(each[1] & {Position, Attitude, ImuSample}))
    roles: dict[str, set[type[Measurement]]]
    roles = {"attitude": {Attitude}, "position": {Position}, "altimeters": {*ALTIMETERS}}
    return {role: [name for name, known in devices if known & kinds] for role, kinds in roles.items()}


def _link_names(ports: Sequence[FoundPort]) -> Iterator[str]:
    """The link of a port has its name."""
    for link in (port.link for port in ports):
        where = str(link.get("port") or link.get("channel") or f"udp_{str(link.get('bind')).rpartition(':')[2]}")
        yield re.sub(r"\W+", "_", where.rpartition("/")[2]).lower()


def _device_names(links: Sequence[str], ports: Sequence[FoundPort]) -> Iterator[str]:
    """The device of a port of an emulator has the name of its link, any other that of its driver."""
    for link, port in zip(links, ports, strict=True):
        own = re.sub(r"_(line|can)$", "", link)
        yield own if own != link or port.device is None else port.device.driver


def _unique(names: Iterable[str]) -> Iterator[str]:
    """The names; a repeated one with a number."""
    taken = set[str]()
    for base in names:
        name = base
        while name in taken:
            name = f"{base}_{len(taken)}"
        taken.add(name)
        yield name


def _keys(table: Any) -> str:
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in table.items())


def _device(port: NamedPort, answers: Answers) -> str:
    device = port.found.device
    assert device
    lines = [
        f"\n[[device]]\nname = {json.dumps(port.device)}\nlink = {json.dumps(port.link)}\n"
        f"driver = {json.dumps(device.driver)}  # its options: fti drivers {device.driver}\n"
    ]
    if device.rate_hz > 0.0:
        lines.append(f"rate_hz = {_two_digits(device.rate_hz)}  # as measured; a lower rate is reported\n")
    if is_mounted(device):
        known = answers.lever_arms.get(port.device)
        lines += [LEVER_ARM.format(json.dumps(known or [0.0, 0.0, 0.0]), "" if known else "CHECK: "), MOUNTING]
    for kind, (beam_kind, limits, beam) in ALTIMETERS.items():
        if kind in device.kinds:
            lines.append(
                f"\n[device.altimeter]\nkind = {json.dumps(beam_kind)}\n"
                f"range_m = {limits}  # CHECK: limits of the data sheet [m]\n"
                f"beam_deg = {beam}  # CHECK: full width of the beam\n"
            )
            break
    return "".join(lines)


def _two_digits(value: float) -> str:
    """A number with two significant digits, without exponent."""
    return f"{float(f'{value:.1e}'):g}"


def _roles(ports: Sequence[NamedPort], answers: Answers) -> Iterator[str]:
    yield "\n[nav]  # of each role the first valid device is used\n"
    for role, names in {**role_candidates(ports), **answers.roles}.items():
        yield f"{role} = {json.dumps(names)}\n"
    yield '# terrain = { files = ["dem.tif"], vertical = "egm96" }   # elevations: altimeters are compared with them\n'
