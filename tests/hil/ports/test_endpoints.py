"""UDP, slcan and CAN endpoints, received by the real links and by independent programs."""

from __future__ import annotations

import asyncio
import socket
from pathlib import Path

import can
import pytest

from fti import config
from fti.canframe import pack_can
from fti.errors import MissingError
from fti.hil.ports.endpoints import UdpEndpoint, make_endpoint, open_endpoints, run_until
from fti.hil.ports.lawicel import Adapter
from tests.e2e.harness import free_udp_port
from tests.helpers import TIMEOUT_S, until_async
from tests.links.bench import run_link

FRAMES = [
    pack_can(0x123, b"\x01\x02\x03"),
    pack_can(0x1ABCDEF0, bytes(8), extended=True),
    pack_can(0x7FF, b""),
    pack_can(0x10, bytes(4), remote=True),
]


def mute(data: bytes) -> list[bytes]:
    return []


def udp(**keys: object) -> config.UdpLink:
    return config.UdpLink.model_validate(
        {"name": "line", "kind": "udp", "bind": f"127.0.0.1:{free_udp_port()}", **keys}
    )


def can_link(interface: str, channel: str) -> config.CanLink:
    return config.CanLink(name="bus", kind="can", interface=interface, channel=channel, bitrate=500000)


# ----------------------------------------------------------------------------------------------------------- UDP


async def test_datagrams_reach_a_link_that_accepts_only_the_source(tmp_path: Path) -> None:
    link = udp(source="127.0.0.3")
    end = make_endpoint(link, tmp_path, mute)
    async with open_endpoints({"line": end}), run_link(link) as (_, received):
        await end.wait_for_reader()
        for k in range(50):
            end.send(b"%d" % k)
        await until_async(lambda: len(received.frames) == 50)
    assert received.frames == [b"%d" % k for k in range(50)]
    assert (end.counters.messages, end.counters.dropped_messages) == (50, 0)


async def test_a_device_answers_at_the_peer_address(tmp_path: Path) -> None:
    link = udp(transmit=True, peer=f"127.0.0.1:{free_udp_port()}")
    end = make_endpoint(link, tmp_path, lambda data: [b"answer to " + data])
    async with open_endpoints({"line": end}), run_link(link) as (opened_link, received):
        await opened_link.send(b"question")
        await until_async(lambda: received.frames == [b"answer to question"])


async def test_nobody_listening_is_seen(tmp_path: Path) -> None:
    link = udp()
    end = make_endpoint(link, tmp_path, mute)
    async with open_endpoints({"line": end}):
        waiting = asyncio.create_task(end.wait_for_reader())
        await asyncio.wait([waiting], timeout=0.1)
        assert not waiting.done()
        async with run_link(link):
            await until_async(waiting.done)


async def test_addresses_of_other_machines_are_refused() -> None:
    """192.0.2.0/24 is documentation only (RFC 5737): no machine has it."""
    for link in (udp(source="192.0.2.7"), udp(bind="192.0.2.7:4000")):
        end = UdpEndpoint(link, mute)
        with pytest.raises(MissingError, match=r"link 'line': cannot send as 192\.0\.2\.7.*addresses of this machine"):
            await end.open()
        end.close()


async def test_a_port_that_another_program_has_is_reported_as_in_use(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        end = make_endpoint(udp(peer=f"127.0.0.1:{other.getsockname()[1]}"), tmp_path, mute)
        with pytest.raises(MissingError, match=r"Address already in use; another fti hil\?$"):
            async with open_endpoints({"eth": end}):
                pass


async def test_any_address_is_reached_on_loopback(tmp_path: Path) -> None:
    port = free_udp_port()
    end = make_endpoint(udp(bind=f"0.0.0.0:{port}"), tmp_path, mute)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", port))
        async with open_endpoints({"line": end}):
            await end.send_all(b"here")
        assert listener.recv(100) == b"here"


# --------------------------------------------------------------------------------------------------------- slcan


async def test_the_slcan_link_receives_every_frame(tmp_path: Path) -> None:
    end = make_endpoint(can_link("slcan", "anywhere"), tmp_path, mute)
    async with open_endpoints({"bus": end}), run_link(can_link("slcan", str(tmp_path / "bus"))) as (_, received):
        await end.wait_for_reader()
        for frame in FRAMES * 20:
            await end.send_all(frame)
        await until_async(lambda: len(received.frames) == 80)
    assert received.frames == FRAMES * 20


async def test_a_closed_channel_drops_and_counts(tmp_path: Path) -> None:
    end = make_endpoint(can_link("slcan", "anywhere"), tmp_path, mute)
    async with open_endpoints({"bus": end}):
        end.send(FRAMES[0])
    assert (end.counters.dropped_messages, end.counters.dropped_bytes) == (1, 16)


async def test_python_can_opens_it_receives_from_it_and_is_answered(tmp_path: Path) -> None:
    """python-can's slcan is another implementation of the protocol."""
    received: list[bytes] = []

    def respond(frame: bytes) -> list[bytes]:
        received.append(frame)
        return [FRAMES[1]]

    end = make_endpoint(can_link("slcan", "anywhere"), tmp_path, respond)
    async with open_endpoints({"bus": end}):
        bus = await asyncio.to_thread(
            can.Bus, str(tmp_path / "bus"), "slcan", bitrate=500000, sleep_after_open=0, ignore_config=True
        )
        await end.wait_for_reader()
        end.send(FRAMES[0])
        first = await asyncio.to_thread(bus.recv, TIMEOUT_S)
        await asyncio.to_thread(bus.send, can.Message(arbitration_id=0x55, data=b"\x09", is_extended_id=False))
        second = await asyncio.to_thread(bus.recv, TIMEOUT_S)
        await asyncio.to_thread(bus.shutdown)
    assert first is not None
    assert (first.arbitration_id, bytes(first.data), first.is_extended_id) == (0x123, b"\x01\x02\x03", False)
    assert received == [pack_can(0x55, b"\x09")]
    assert second is not None
    assert (second.arbitration_id, second.is_extended_id) == (0x1ABCDEF0, True)


@pytest.mark.parametrize("cut", [1, 2, 5, 100])
def test_commands_are_answered_however_they_are_cut(cut: int) -> None:
    frames: list[bytes] = []
    adapter = Adapter(frames.append)
    text = b"\rS6\rt1230\rO\rt12321122\rT1ABCDEF00\rV\rN\rX\rt123\rC\rt1230\r"
    answers = b"".join(a for i in range(0, len(text), cut) for a in adapter.feed(text[i : i + cut]))
    assert answers == b"\r\r\a\rz\rZ\rV1013\rNF001\r\a\a\r\a"
    assert frames == [pack_can(0x123, b"\x11\x22"), pack_can(0x1ABCDEF0, b"", extended=True)]
    assert not adapter.is_open


# -------------------------------------------------------------------------------------------------- other buses


async def test_a_shared_bus_carries_frames_to_the_link(tmp_path: Path) -> None:
    link = can_link("virtual", "hil-test")
    end = make_endpoint(link, tmp_path, mute)
    async with open_endpoints({"bus": end}), run_link(link) as (_, received):
        for frame in FRAMES:
            await end.send_all(frame)
        await until_async(lambda: received.frames == FRAMES)


def test_hardware_cannot_be_emulated(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match="interface 'vector' needs CAN hardware"):
        make_endpoint(can_link("vector", "0"), tmp_path, mute)


async def test_a_bus_that_is_not_there_is_named(tmp_path: Path) -> None:
    end = make_endpoint(can_link("socketcan", "can_of_nobody"), tmp_path, mute)
    with pytest.raises(MissingError, match="link 'bus': socketcan channel 'can_of_nobody' cannot be opened"):
        await end.open()
    end.close()


# --------------------------------------------------------------------------------------------------------- until


async def test_until_passes_errors_on_and_leaves_work_at_a_stop() -> None:
    async def fail() -> None:
        raise MissingError("error")

    with pytest.raises(MissingError, match="error"):
        await run_until(fail(), asyncio.Event())
    stop = asyncio.Event()
    stop.set()
    await run_until(asyncio.Event().wait(), stop)
