"""Configurations on free ports."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from fti import config as configuration
from fti.config import UdpLink
from fti.devices import bind_devices
from fti.testing.ports import (
    addresses,
    free_udp_port,
    is_tcp_port_open,
    is_udp_port_bound,
    on_free_ports,
    write_config,
)
from tests.helpers import ROOT

CONFIGS = sorted((ROOT / "configs").glob("*.toml"))
EXAMPLE = """
[session]
name = "example"

[[link]]
name = "far"
kind = "udp"
bind = "192.168.10.1:4000"
source = "192.168.10.7"
peer = "192.168.10.7:4001"

[[link]]
name = "line"
kind = "serial"
port = "/dev/ttyUSB0"

[[link]]
name = "can_eth"
kind = "can"
interface = "udp_multicast"
channel = "239.74.163.2"
"""


@pytest.mark.parametrize("file", CONFIGS, ids=lambda file: file.stem)
def test_every_configuration_can_be_used_from_another_folder(file: Path, tmp_path: Path) -> None:
    """What it names, relative to its own folder, is found."""
    write_config(on_free_ports(configuration.load(file)), tmp_path / "config.toml")
    moved = configuration.load(tmp_path / "config.toml")
    assert [bound.device.name for bound in bind_devices(moved)] == [d.name for d in configuration.load(file).device]


def test_everything_is_on_loopback_and_on_ports_that_differ(tmp_path: Path) -> None:
    (tmp_path / "example.toml").write_text(EXAMPLE)
    config = configuration.load(tmp_path / "example.toml")
    moved = [on_free_ports(config) for _ in range(2)]
    far = [link for one in moved for link in one.link if isinstance(link, UdpLink)]
    assert {link.source for link in far} == {"127.0.0.1"}
    ends = [end for link in far for end in (link.bind, link.peer or "")]
    assert all(end.startswith("127.0.0.1:") for end in ends)
    assert len(set(ends)) == len(ends) == 4
    buses = [one.link[2].settings["port"] for one in moved]  # type: ignore[union-attr]
    assert buses[0] != buses[1]


def test_where_each_link_is(tmp_path: Path) -> None:
    (tmp_path / "example.toml").write_text(EXAMPLE)
    places = addresses(on_free_ports(configuration.load(tmp_path / "example.toml")), tmp_path / "links")
    assert places["line"].path == str(tmp_path / "links" / "line")
    assert places["far"].host == "127.0.0.1"
    assert None not in (places["far"].port, places["far"].peer_port, places["can_eth"].port)


def test_a_port_is_given_once() -> None:
    ports = [free_udp_port() for _ in range(50)]
    assert len(set(ports)) == 50
    assert not any(is_udp_port_bound(port) for port in ports)


@pytest.mark.parametrize("address", ["127.0.0.1", "0.0.0.0", "::"])
def test_a_bound_udp_port_is_seen(address: str) -> None:
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as sock:
        sock.bind((address, 0))
        assert is_udp_port_bound(sock.getsockname()[1])


def test_a_tcp_server_is_seen_and_a_connection_is_none() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert is_tcp_port_open(port)
        with socket.create_connection(("127.0.0.1", port)) as client:
            assert not is_tcp_port_open(client.getsockname()[1])
    assert not is_tcp_port_open(port)
