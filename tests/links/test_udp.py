"""UDP links on loopback."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest

from fti.clock import FakeClock, SystemClock, choose_epoch_ns
from fti.config import UdpLink
from fti.errors import ConfigError, LinkError
from fti.links import open_link
from fti.links.base import OVERFLOW_HOLD_NS, LinkStatus
from fti.links.sockets import SO_RCVBUFFORCE, Arrival
from fti.messages.frames import LinkState
from tests.helpers import until_async
from tests.links.bench import run_link

GROUP = "239.255.71.3"


@pytest.fixture
def device() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(10)
        yield sock


def link(**keys: Any) -> UdpLink:
    return UdpLink.model_validate({"name": "eth", "kind": "udp", "bind": "127.0.0.1:0", **keys})


async def test_one_datagram_is_one_frame(device: socket.socket) -> None:
    sent = [b"", b"a", bytes(1472), bytes(65507)]
    async with run_link(link()) as (opened, received):
        for data in sent:
            device.sendto(data, opened.address)
        await until_async(lambda: len(received.frames) == len(sent))
    assert received.frames == sent
    assert opened.status.state is LinkState.GOOD


async def test_only_a_link_that_brings_little_is_looked_at_before_the_beat(device: socket.socket) -> None:
    """Of many messages the first one behind a beat is seldom the altimeter's."""
    async with run_link(link()) as (opened, _):
        assert not opened._is_early()
        opened.urgent = True
        assert opened._is_early()
        while opened._is_early():
            for _ in range(20):
                device.sendto(b"x", opened.address)
            await asyncio.sleep(0.1)
        await until_async(opened._is_early)


async def test_stamp_is_when_the_datagram_arrived_not_when_it_was_read(device: socket.socket) -> None:
    clock = SystemClock(choose_epoch_ns())
    async with run_link(link(), clock=clock) as (opened, received):
        before = clock.now_ns()
        for i in range(3000):  # the loop stands still meanwhile, so none has been read yet
            device.sendto(bytes([i & 255]), opened.address)
        sent = clock.now_ns()
        assert not received.frames
        await until_async(lambda: len(received.frames) == 3000)
    # realtime and monotonic are read one after the other and may be slewed against each other: 1 ms
    assert before - 1_000_000 <= received.times[0]
    assert received.times[-1] <= sent + 1_000_000
    assert opened.status.stamp_refused == 0
    assert opened.status.socket_dropped == 0


async def test_stamps_are_good_however_long_nobody_has_read(
    device: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The recorder stands still for 130 s, and so seems to have every clock; the kernel has stamped in time."""
    clock, pause_ns = SystemClock(choose_epoch_ns()), 130 * 10**9
    monotonic_ns, clock_gettime_ns = time.monotonic_ns, time.clock_gettime_ns
    async with run_link(link(), clock=clock) as (opened, received):
        before = clock.now_ns()
        for i in range(300):
            device.sendto(bytes([i & 255]), opened.address)
        sent = clock.now_ns()
        monkeypatch.setattr("fti.clock.time.monotonic_ns", lambda: monotonic_ns() + pause_ns)
        monkeypatch.setattr("fti.clock.time.clock_gettime_ns", lambda clock_id: clock_gettime_ns(clock_id) + pause_ns)
        await until_async(lambda: len(received.frames) == 300)
    assert before - 1_000_000 <= received.times[0]
    assert received.times[-1] <= sent + 1_000_000
    assert opened.status.stamp_refused == 0


async def test_stamp_that_cannot_be_true_is_replaced_and_counted(device: socket.socket) -> None:
    clock = FakeClock(77)  # as if real time had stepped by decades
    async with run_link(link(), clock=clock) as (opened, received):
        device.sendto(b"x", opened.address)
        await until_async(lambda: received.frames)
    assert received.times == [77]
    assert opened.status.stamp_refused == 1


async def test_what_the_kernel_drops_is_counted(device: socket.socket) -> None:
    async with run_link(link()) as (opened, received):
        opened._socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 20_000)
        for _ in range(500):
            device.sendto(bytes(100), opened.address)
        await until_async(lambda: received.frames)
        await opened.drain()
        for _ in range(2):  # the kernel tells the count with the next datagram
            device.sendto(b"next", opened.address)
        await until_async(lambda: received.frames[-1] == b"next")
        await opened.drain()
        assert opened.status.socket_dropped > 0
        assert len(received.frames) + opened.status.socket_dropped == 502


async def test_a_link_of_which_the_kernel_drops_frames_is_not_good(
    device: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monotonic_ns = time.monotonic_ns
    async with run_link(link()) as (opened, received):
        opened._socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 20_000)
        for _ in range(500):
            device.sendto(bytes(100), opened.address)
        await until_async(lambda: opened.status.state is LinkState.OVERFLOW, what="the state")
        assert opened.status.hint.startswith(f"the kernel has dropped {opened.status.socket_dropped} frames: ")
        before = len(received.frames)
        device.sendto(b"next", opened.address)
        await until_async(lambda: len(received.frames) > before)
        assert opened.status.state is LinkState.OVERFLOW
        monkeypatch.setattr("fti.clock.time.monotonic_ns", lambda: monotonic_ns() + OVERFLOW_HOLD_NS)
        device.sendto(b"much later", opened.address)
        await until_async(lambda: received.frames[-1] == b"much later")
        opened._check()
        assert (opened.status.state, opened.status.hint) == (LinkState.GOOD, "")


async def test_drops_behind_the_last_datagram_are_asked_for(device: socket.socket) -> None:
    async with run_link(link()) as (opened, received):
        opened._socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 20_000)
        for _ in range(500):
            device.sendto(bytes(100), opened.address)
        await until_async(lambda: len(received.frames) + opened.status.socket_dropped == 500, what="the sum")
        assert opened.status.socket_dropped > 0


def test_drop_counter_of_the_kernel_wraps() -> None:
    status = LinkStatus()
    arrival = Arrival(FakeClock(0), status)
    for total in (0x7FFF_FFF0, 0xFFFF_FFE0, 5, 0xFFFF_FFF0, 5):  # the last but one was in the queue for long
        arrival._count_drops(total)
    assert status.socket_dropped == 0x1_0000_0005


async def test_only_the_configured_source_is_received(device: socket.socket) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.2", 0))
        async with run_link(link(source="127.0.0.1")) as (opened, received):
            for _ in range(3):
                stranger.sendto(b"stranger", opened.address)
            await until_async(lambda: opened.status.refused == 3)
            opened._check()
            assert opened.status.state is LinkState.SILENT
            assert "none from 127.0.0.1" in opened.status.hint
            device.sendto(b"device", opened.address)
            await until_async(lambda: received.frames)
    assert received.frames == [b"device"]
    assert opened.status.errors == {"udp_other_source": 3}  # goes into the ledger


async def test_answers_go_to_the_last_sender(device: socket.socket) -> None:
    async with run_link(link(transmit=True)) as (opened, received):
        with pytest.raises(LinkError, match="no destination"):
            await opened.send(b"x")
        device.sendto(b"hello", opened.address)
        await until_async(lambda: received.frames)
        assert await opened.send(b"answer") == 6
        assert device.recvfrom(100) == (b"answer", opened.address)


async def test_peer_of_the_configuration_is_sent_to(device: socket.socket) -> None:
    host, port = device.getsockname()
    async with run_link(link(transmit=True, peer=f"{host}:{port}"), on_connect=[b"wake up"]):
        assert device.recv(100) == b"wake up"


async def test_who_cannot_be_greeted_yet_still_receives(device: socket.socket) -> None:
    async with run_link(link(transmit=True), on_connect=[b"wake up"]) as (opened, received):
        device.sendto(b"hello", opened.address)
        await until_async(lambda: received.frames)
        assert opened.status.connects == 1


async def test_multicast_group(device: socket.socket) -> None:
    device.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    device.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
    async with run_link(link(group=GROUP)) as (opened, received):
        assert opened.address[0] == GROUP
        device.sendto(b"to one", ("127.0.0.1", opened.address[1]))
        device.sendto(b"to all", opened.address)
        await until_async(lambda: received.frames)
        again = link(group=GROUP, bind=f"127.0.0.1:{opened.address[1]}")
        async with run_link(again) as (_, second):
            device.sendto(b"to both", opened.address)
            await until_async(lambda: second.frames and len(received.frames) == 2)
    assert received.frames == [b"to all", b"to both"]
    assert second.frames == [b"to both"]


async def test_ipv6() -> None:
    with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as sock:
        try:
            sock.bind(("::1", 0))
        except OSError:
            return  # a machine without IPv6
        async with run_link(link(bind="[::1]:0", source="0:0::1", transmit=True)) as (opened, received):
            sock.sendto(b"six", opened.address)
            await until_async(lambda: received.frames == [b"six"])
            await opened.send(b"back")
            sock.settimeout(10)
            assert sock.recv(10) == b"back"


async def test_port_in_use_is_busy_until_it_is_free(device: socket.socket) -> None:
    place = "{}:{}".format(*device.getsockname())
    async with run_link(link(bind=place), connects=0) as (opened, _):
        await until_async(lambda: opened.status.state is LinkState.BUSY)
        assert "in use" in opened.status.hint
        device.close()
        await until_async(lambda: opened.status.connects == 1)
        assert opened.status.state is LinkState.SILENT


async def test_address_of_another_machine_is_absent() -> None:
    async with run_link(link(bind="192.0.2.1:4000"), connects=0) as (opened, _):
        await until_async(lambda: "not an address of this machine" in opened.status.hint)
        assert opened.status.state is LinkState.ABSENT
        assert "127.0.0.1 (lo)" in opened.status.hint
        with pytest.raises(LinkError, match="not open"):
            _ = opened.address


async def test_port_below_1024_is_denied_to_users(monkeypatch: pytest.MonkeyPatch) -> None:
    """Root may do it, so the kernel's answer to a user is given instead."""

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("fti.links.udp.prepare", refuse)
    async with run_link(link(), connects=0) as (opened, _):
        await until_async(lambda: opened.status.state is LinkState.DENIED)
        assert "below 1024" in opened.status.hint


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"bind": "300.0.0.1:1"}, "not an IP address"),
        ({"bind": "127.0.0.1:70000"}, "allowed is 0 to 65535"),
        ({"source": "radar"}, "source = 'radar'"),
        ({"group": "192.168.1.1"}, "multicast"),
        ({"group": "ff02::1"}, "IPv4 multicast"),
    ],
)
def test_what_can_never_work_is_an_error_at_once(keys: dict[str, str], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        open_link(link(**keys), FakeClock(), lambda frames, times: None)
