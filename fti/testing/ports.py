"""Configurations on private ports: free UDP ports of loopback, ptys in a folder of the test."""

from __future__ import annotations

import contextlib
import json
import random
import socket
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fti.config import CanLink, Config, Link, SerialLink, UdpLink
from fti.devices import option_files

LOOPBACK = "127.0.0.1"
#: Below the kernel's ephemeral ports, so that no other socket takes a port in the meantime.
FIRST_PORT, LAST_PORT = 15_000, 32_000
MAX_TRIES = 1000
#: State of a listening socket in /proc/net/tcp.
TCP_LISTEN = "0A"
_random = random.SystemRandom()
_issued_ports: set[int] = set()


@dataclass(frozen=True, slots=True)
class LinkAddress:
    """Address of a link of a bench; None where it does not apply.

    path : device file of a serial line or an slcan adapter; port : UDP port that the receiver binds
    peer_port : UDP port from which the other side sends, and at which it receives answers
    """

    name: str
    kind: str
    path: str | None = None
    host: str | None = None
    port: int | None = None
    peer_port: int | None = None

    def __str__(self) -> str:
        place = self.path if self.path else f"{self.host}:{self.port}" if self.port else "as configured"
        return f"{self.name} ({self.kind}, {place})"


def free_udp_port() -> int:
    """A UDP port of loopback that is not bound, and that this process has not returned before."""
    for _ in range(MAX_TRIES):
        port = _random.randint(FIRST_PORT, LAST_PORT)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            try:
                sock.bind((LOOPBACK, port))
            except OSError:
                continue
        if port not in _issued_ports:
            _issued_ports.add(port)
            return port
    raise OSError(f"no free UDP port between {FIRST_PORT} and {LAST_PORT}")


def is_udp_port_bound(port: int) -> bool:
    """Does a UDP socket of this machine listen on the port?"""
    return any(local == port for local, _ in _sockets("udp"))


def is_tcp_port_open(port: int) -> bool:
    """Does a TCP server of this machine listen on the port?"""
    return (port, TCP_LISTEN) in _sockets("tcp")


def _sockets(protocol: str) -> Iterator[tuple[int, str]]:
    """Port and state of each socket of this machine, without binding or connecting, which would disturb it."""
    for table in (protocol, f"{protocol}6"):
        with contextlib.suppress(OSError), Path(f"/proc/net/{table}").open(encoding="ascii") as lines:
            next(lines, None)
            for line in lines:
                _, local, _, state, *_ = line.split()
                yield int(local.rpartition(":")[2], 16), state


def on_free_ports(config: Config) -> Config:
    """The same configuration on free UDP ports of loopback, without page and bus, with absolute file names."""
    files = option_files(config)
    devices = tuple(
        device.model_copy(update={"options": _absolute(device.options, f"device[{i}].options", files)})
        for i, device in enumerate(config.device)
    )
    display = config.display.model_copy(update={"enabled": False})
    bus = config.bus.model_copy(update={"enabled": False})
    links = tuple(_move_to_free_port(link) for link in config.link)
    return config.model_copy(update={"link": links, "device": devices, "display": display, "bus": bus})


def _absolute(options: dict[str, Any], where: str, files: dict[str, Path]) -> dict[str, Any]:
    return {key: str(files[place].absolute()) if (place := f"{where}.{key}") in files else value
            for key, value in options.items()}  # fmt: skip


def _move_to_free_port(link: Link) -> Link:
    if isinstance(link, UdpLink):
        changes: dict[str, Any] = {"bind": f"{LOOPBACK}:{free_udp_port()}"}
        if link.source:
            changes["source"] = LOOPBACK
        if link.peer:
            changes["peer"] = f"{LOOPBACK}:{free_udp_port()}"
        return link.model_copy(update=changes)
    if isinstance(link, CanLink) and link.interface == "udp_multicast":
        return link.model_copy(update={"settings": {**link.settings, "port": free_udp_port()}})
    return link


def write_config(config: Config, file: Path) -> None:
    """Write a configuration as TOML."""
    table = config.model_dump(mode="json", exclude_unset=True, exclude_none=True, exclude={"path", "text"})
    file.write_text(toml_text(table), encoding="utf-8")


def addresses(config: Config, ptys: Path | None) -> dict[str, LinkAddress]:
    """The address of each link of a configuration, by its name.  ptys : folder of an emulator's ptys, or None"""
    return {link.name: _address(link, ptys) for link in config.link}


def _address(link: Link, ptys: Path | None) -> LinkAddress:
    if isinstance(link, UdpLink):
        port = int(link.bind.rpartition(":")[2])
        peer = int(link.peer.rpartition(":")[2]) if link.peer else None
        return LinkAddress(link.name, link.kind, host=link.group or LOOPBACK, port=port, peer_port=peer)
    if isinstance(link, SerialLink):
        return LinkAddress(link.name, link.kind, path=str(ptys / link.name) if ptys else link.port)
    if link.interface == "slcan":
        return LinkAddress(link.name, link.kind, path=str(ptys / link.name) if ptys else link.channel)
    return LinkAddress(link.name, link.kind, host=link.channel, port=link.settings.get("port"))


def toml_text(table: Mapping[str, Any]) -> str:
    """A TOML document with a line for each key of the first level.

    Values are strings, numbers, booleans, lists and tables of them.  Raises ValueError.
    """
    return "".join(f"{_text(key)} = {_value(value)}\n" for key, value in table.items())


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_text(key)} = {_value(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    raise ValueError(f"{value!r}: TOML has no such value")


def _text(text: str) -> str:
    """A basic string: the escapes of JSON, and DEL, which JSON does not escape."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
