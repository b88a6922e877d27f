"""Ends of links outside this machine: a cable (a pty pair stands for it), an address, an adapter."""

from __future__ import annotations

import os
import socket
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti.config import CanLink, Link, SerialLink, UdpLink
from fti.errors import ConfigError, MissingError
from fti.hil import scenario as scenarios
from fti.hil.ports.endpoints import make_endpoint, open_endpoints
from fti.hil.ports.real_port import RealPort
from tests.helpers import ROOT, until_async

LINE = SerialLink(name="line", kind="serial", port="/dev/unused", baud=9600)
ETH = UdpLink(name="eth", kind="udp", bind="192.0.2.1:4000")
BUS = CanLink(name="bus", kind="can", interface="slcan", channel="x")


@pytest.fixture
def cable() -> Iterator[tuple[int, str]]:
    """The other end of a cable, and the path of ours."""
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(master)
    os.close(slave)


async def test_a_real_port_carries_both_ways_and_no_symlink_is_made(cable: tuple[int, str], tmp_path: Path) -> None:
    far, device = cable
    end = make_endpoint(LINE, tmp_path, lambda data: [b"<" + data + b">"], paced=True, port=RealPort(device=device))
    async with open_endpoints({"line": end}):
        await end.wait_for_reader()
        end.send(b"measured\x00\x11\r\n")
        await end.drain()
        assert os.read(far, 100) == b"measured\x00\x11\r\n"
        os.write(far, b"ask")
        await until_async(lambda: end.counters.received_bytes == 3)
        assert os.read(far, 100) == b"<ask>"
    assert not os.listdir(tmp_path)  # noqa: PTH208


async def test_a_cable_that_takes_nothing_costs_the_oldest_and_closes(cable: tuple[int, str], tmp_path: Path) -> None:
    messages: list[str] = []
    end = make_endpoint(LINE, tmp_path, lambda _: [], port=RealPort(device=cable[1]), notify=messages.append)
    async with open_endpoints({"line": end}):
        for _ in range(1000):
            end.send(bytes(100))
        assert end.counters.dropped_messages > 0
        assert messages == ["line: no program reads it; the oldest messages are dropped"]


@pytest.mark.parametrize("sends", [True, False])
async def test_a_pulled_adapter_is_reported_once_and_does_not_end_the_flight(sends: bool, tmp_path: Path) -> None:
    far, near = os.openpty()
    messages: list[str] = []
    end = make_endpoint(LINE, tmp_path, lambda _: [], port=RealPort(device=os.ttyname(near)), notify=messages.append)
    async with open_endpoints({"line": end}):
        os.close(near)
        os.close(far)
        if sends:
            end.send(bytes(100))
        await until_async(lambda: len(messages) > 0)
        end.send(bytes(100))
        await end.drain()
        assert end.counters.dropped_bytes == (200 if sends else 100)
    assert [message.partition(": the port is lost: ")[0] for message in messages] == ["line"]


async def test_a_network_that_accepts_nothing_is_reported_once_and_does_not_end_the_flight(tmp_path: Path) -> None:
    messages: list[str] = []
    everybody = RealPort(to="255.255.255.255:4000")  # the kernel refuses it to a socket that did not ask for it
    end = make_endpoint(ETH, tmp_path, lambda _: [], port=everybody, notify=messages.append)
    async with open_endpoints({"eth": end}):
        end.send(b"measured")
        end.send(b"measured")
        assert end.counters.dropped_messages == 2
    assert messages == ["eth: cannot send to 255.255.255.255:4000: Permission denied; data are dropped"]


async def test_a_port_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    end = make_endpoint(LINE, tmp_path, lambda _: [], port=RealPort(device="/dev/ttyUSB99"))
    with pytest.raises(MissingError, match="link 'line': /dev/ttyUSB99: no such port"):
        async with open_endpoints({"line": end}):
            pass


async def test_datagrams_go_where_the_scenario_says(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(60)
        to = f"127.0.0.1:{receiver.getsockname()[1]}"
        end = make_endpoint(ETH, tmp_path, lambda _: [], port=RealPort(to=to))  # "bind" is no address of this machine
        async with open_endpoints({"eth": end}):
            await end.wait_for_reader()
            end.send(b"measured")
            assert receiver.recv(100) == b"measured"


async def test_without_a_word_of_the_scenario_nothing_leaves_this_machine(tmp_path: Path) -> None:
    end = make_endpoint(ETH, tmp_path, lambda _: [])
    with pytest.raises(MissingError, match="the emulator needs addresses of this machine"):
        async with open_endpoints({"eth": end}):
            pass


@pytest.mark.parametrize(
    ("link", "port", "needs"),
    [
        (LINE, RealPort(to="192.0.2.1:4000"), "a serial link needs device; no other key is allowed"),
        (LINE, RealPort(device="/dev/ttyUSB0", interface="x"), "a serial link needs device; no other key is allowed"),
        (ETH, RealPort(device="/dev/ttyUSB0"), "a udp link needs to; no other key is allowed"),
        (BUS, RealPort(device="can0"), "a can link needs device and interface; no other key is allowed"),
    ],
)
def test_a_port_of_the_wrong_kind_is_refused(link: Link, port: RealPort, needs: str) -> None:
    with pytest.raises(ConfigError, match=f"^here: {needs}$"):
        port.check(link, "here")


def test_a_scenario_names_its_ports(tmp_path: Path) -> None:
    text = (ROOT / "configs" / "scenarios" / "nominal.toml").read_text()
    file = tmp_path / "bench.toml"
    moved = text.replace('config = "../demo.toml"', f'config = "{ROOT}/configs/demo.toml"')
    file.write_text(moved + '\n[port.radalt_line]\ndevice = "/dev/ttyUSB1"\n')
    scenario = scenarios.load(file)
    scenarios.load_config(scenario)
    assert scenario.port["radalt_line"].device == "/dev/ttyUSB1"
    for wrong, error in (
        ('[port.radalt]\ndevice = "/dev/ttyUSB1"', "port: unknown link 'radalt'"),
        ('[port.ins_eth]\ndevice = "/dev/ttyUSB1"', "port.ins_eth: a udp link needs to"),
    ):
        file.write_text(f"{moved}\n{wrong}\n")
        with pytest.raises(ConfigError, match=error):
            scenarios.load_config(scenarios.load(file))
