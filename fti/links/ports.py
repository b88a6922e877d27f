"""Lists serial ports, CAN interfaces and addresses with their states, without opening any.

Opening a serial port would raise its modem lines, which resets some devices.  Instead, a port counts as busy when a
process has it open; only root sees processes of other users.  A process that also holds the other end of a pty, as an
emulator does, provides the port and does not use it.
"""

from __future__ import annotations

import fcntl
import grp
import os
import socket
import struct
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports

NET = Path("/sys/class/net")
BY_ID = Path("/dev/serial/by-id")
CAN_TYPE = "280"  # ARPHRD_CAN
IFF_UP = 1
SIOCGIFADDR = 0x8915
#: The master of a pty; the major device number of its slave (Linux, Documentation/admin-guide/devices.txt).
PTY_MASTERS = frozenset({"/dev/ptmx", "/dev/pts/ptmx"})
PTY_SLAVE_MAJOR = 136


@dataclass(frozen=True, slots=True)
class PortInfo:
    """A port.  name : as in the configuration; kind : serial, can or udp; state : free, busy, denied, up, down

    used_by : programs that have a busy port open
    """

    name: str
    kind: str
    state: str
    detail: str
    used_by: str = ""


def serial_names() -> list[str]:
    """Paths of the serial ports of this machine."""
    return sorted(str(port.device) for port in list_ports.comports())


def serial_ports(folder: Path | None = None) -> list[PortInfo]:
    """The serial ports, their stable names, and the ports of an emulator in a folder."""
    users = _users()
    described = {str(p.device): str(p.description or "") for p in list_ports.comports()}
    ports = [_serial_port(Path(name), users, described[name]) for name in sorted(described)]
    for parent in (BY_ID, folder):
        links = sorted(parent.iterdir()) if parent and parent.is_dir() else []
        links = [link for link in links if link.is_symlink() and link.exists()]
        ports += [_serial_port(link, users, f"-> {link.resolve()}") for link in links]
    return ports


def _serial_port(path: Path, users: Mapping[int, set[Path]], detail: str) -> PortInfo:
    if not os.access(path, os.R_OK | os.W_OK):
        return PortInfo(str(path), "serial", "denied", f"{detail}; group {group_of(path)}")
    processes = sorted(users.get(path.stat().st_rdev, ()))
    used_by = ", ".join(f"{_text(process / 'comm') or 'program'} (process {process.name})" for process in processes)
    return PortInfo(str(path), "serial", "busy" if processes else "free", detail, used_by)


def group_of(path: Path) -> str:
    """The group with access to a device."""
    try:
        return grp.getgrgid(path.stat().st_gid).gr_name
    except (OSError, KeyError):
        return "dialout"


def _users() -> dict[int, set[Path]]:
    """Processes that use a device, by its number, as far as they are visible to us."""
    users, providers = defaultdict[int, set[Path]](set), defaultdict[int, set[Path]](set)
    for entry in Path("/proc").glob("[0-9]*/fd/*"):
        process = entry.parent.parent
        try:
            target = str(entry.readlink())
            if target in PTY_MASTERS:
                providers[_slave_of(process / "fdinfo" / entry.name)].add(process)
            elif target.startswith("/dev/"):
                users[entry.stat().st_rdev].add(process)
        except OSError:
            continue  # closed meanwhile, or not visible
    return {device: processes - providers[device] for device, processes in users.items()}


def _slave_of(fdinfo: Path) -> int:
    """Device number of the slave of a pty.  fdinfo : of its master"""
    fields = dict(line.split(":", 1) for line in fdinfo.read_text().splitlines() if ":" in line)
    return os.makedev(PTY_SLAVE_MAJOR, int(fields.get("tty-index", -1)) & 0xFFFFF)


def can_interfaces() -> list[PortInfo]:
    """The CAN interfaces of the kernel."""
    return [
        PortInfo(net.name, "can", "up" if _flags(net) & IFF_UP else "down", _driver(net))
        for net in sorted(NET.iterdir())
        if _text(net / "type") == CAN_TYPE
    ]


def _flags(net: Path) -> int:
    return int(_text(net / "flags") or "0", 16)


def _driver(net: Path) -> str:
    driver = net / "device" / "driver"
    return driver.resolve().name if driver.exists() else "virtual"


def _text(file: Path) -> str:
    try:
        return file.read_text().strip()
    except OSError:
        return ""


def ipv4_addresses() -> list[PortInfo]:
    """The first IPv4 address of every network interface that has one."""
    addresses = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for _, name in socket.if_nameindex():
            request = struct.pack("256s", name.encode())
            try:
                answer = fcntl.ioctl(sock.fileno(), SIOCGIFADDR, request)
            except OSError:
                continue  # an interface without an address
            state = "up" if _flags(NET / name) & IFF_UP else "down"
            addresses.append(PortInfo(socket.inet_ntoa(answer[20:24]), "udp", state, name))
    return addresses
