"""Writes the configuration of found devices: commented TOML that ``fti check`` accepts."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from fti.cli._port_survey import FoundPort
from fti.messages.measurements import Attitude, ImuSample, Measurement, Position, RadioHeight, Range, Velocity

#: Range limits and full beam width of an altimeter whose data sheet is not known: FreeFlight RA-4500, LightWare SF30.
ALTIMETERS: dict[type[Measurement], tuple[str, str, str]] = {
    RadioHeight: ("radar", "[0.0, 760.0]", "40.0"),
    Range: ("laser", "[0.2, 100.0]", "0.3"),
}
HEAD = """\
# Written by fti new from what the devices sent.  Lines with CHECK need the data sheet or the aircraft.
# fti check {file} explains it; docs/configuration.md describes every key.

[session]
name = {name}
directory = "data"             # of the recordings, relative to this file
origin = "flight"
"""
MOUNTING = """\
lever_arm_b = [0.0, 0.0, 0.0]  # CHECK: reference point to sensor: forward, right, down [m]
rpy_bs_deg = [0.0, 0.0, 0.0]   # CHECK: mounting: roll, pitch, yaw
"""


def config_text(file: Path, name: str, ports: Sequence[FoundPort]) -> str:
    """The text of the configuration.  file : where it will be; name : of the session"""
    parts = [HEAD.format(file=file, name=json.dumps(name))]
    names = list(_unique(_link_names(ports)))
    devices = dict(zip(names, _unique(_device_names(names, ports)), strict=True))
    for link, port in zip(names, ports, strict=True):
        parts.append(f"\n[[link]]\nname = {json.dumps(link)}\n{_keys(port.link)}")
        if port.device is None:
            state = f"{port.received} bytes came, which no driver decodes" if port.received else "no byte came"
            parts.append(f"# {state}: it is recorded and not decoded.  CHECK: fti listen {link} --config {file}\n")
    for link, port in zip(names, ports, strict=True):
        if port.device:
            parts.append(_device(devices[link], link, port))
    return "".join([*parts, *_roles([*devices.values()], ports)])


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


def _device(name: str, link: str, port: FoundPort) -> str:
    device = port.device
    assert device
    lines = [
        f"\n[[device]]\nname = {json.dumps(name)}\nlink = {json.dumps(link)}\n"
        f"driver = {json.dumps(device.driver)}  # its options: fti drivers {device.driver}\n"
    ]
    if device.rate_hz > 0.0:
        lines.append(f"rate_hz = {device.rate_hz:.2g}  # as measured; a lower rate is reported\n")
    if device.kinds & {Attitude, Position, Velocity, ImuSample, *ALTIMETERS}:
        lines.append(MOUNTING)
    for kind, (beam_kind, limits, beam) in ALTIMETERS.items():
        if kind in device.kinds:
            lines.append(
                f"\n[device.altimeter]\nkind = {json.dumps(beam_kind)}\n"
                f"range_m = {limits}  # CHECK: limits of the data sheet [m]\n"
                f"beam_deg = {beam}  # CHECK: full width of the beam\n"
            )
            break
    return "".join(lines)


def _roles(names: Sequence[str], ports: Sequence[FoundPort]) -> Iterator[str]:
    """The roles: of position and attitude first the devices that have both."""
    devices = [(name, port.device.kinds) for name, port in zip(names, ports, strict=True) if port.device]
    devices.sort(key=lambda each: -len(each[1] & {Position, Attitude, ImuSample}))
    yield "\n[nav]  # of each role the first valid device is used\n"
    for role, kinds in (("attitude", {Attitude}), ("position", {Position}), ("altimeters", {*ALTIMETERS})):
        yield f"{role} = {json.dumps([name for name, known in devices if known & kinds])}\n"
    yield '# terrain = { files = ["dem.tif"], vertical = "egm96" }   # elevations: altimeters are compared with them\n'
