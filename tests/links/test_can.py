"""CAN links through python-can.  tests/vcan tests the SocketCAN of the kernel, if available."""

from __future__ import annotations

import asyncio
import errno
import itertools
import socket
import threading
from collections.abc import Iterator
from typing import Any

import can
import pytest

from fti.canframe import pack_can
from fti.clock import FakeClock, SystemClock, choose_epoch_ns
from fti.config import CanLink
from fti.errors import ConfigError, LinkError, PartialSendError
from fti.links import open_link, sockets
from fti.links._recvmmsg import ReceiveBatch
from fti.links.can import pack_message, unpack_message
from fti.messages.frames import LinkState
from tests.helpers import until, until_async
from tests.links.bench import run_link

FRAMES = [
    pack_can(0x123, b"\x01\x02"),
    pack_can(0x1ABCDEF0, bytes(8), extended=True),
    pack_can(0x7FF, bytes(5), remote=True),
    pack_can(0x20, b"", error=True),
    pack_can(0x42, bytes(range(12)), fd=True),
    bytes.fromhex("4200000008050000") + bytes(64),
]
channels = (f"fti-test-{i}" for i in itertools.count())


def link(interface: str = "virtual", **keys: Any) -> CanLink:
    table = {"name": "can1", "kind": "can", "interface": interface, "channel": next(channels), **keys}
    return CanLink.model_validate(table)


@pytest.mark.parametrize("frame", FRAMES)
def test_messages_of_python_can_both_ways(frame: bytes) -> None:
    assert pack_message(unpack_message(frame)) == frame


# ------------------------------------------------------------------------------- an interface without a descriptor


@pytest.fixture
def bus() -> Iterator[tuple[CanLink, can.BusABC]]:
    """The configuration of a link, and the other end of its bus."""
    config = link(transmit=True, fd=True)
    with can.Bus(config.channel, "virtual", fd=True, ignore_config=True) as other:
        yield config, other


async def test_frames_arrive_in_order(bus: tuple[CanLink, can.BusABC]) -> None:
    config, other = bus
    async with run_link(config) as (opened, received):
        for frame in FRAMES * 20:
            other.send(unpack_message(frame))
        await until_async(lambda: len(received.frames) == len(FRAMES) * 20)
        assert opened.status.state is LinkState.GOOD
    assert received.frames == FRAMES * 20
    assert received.times == sorted(received.times)


async def test_frames_are_sent_and_not_received(bus: tuple[CanLink, can.BusABC]) -> None:
    config, other = bus
    async with run_link(config, on_connect=[FRAMES[0]]) as (opened, received):
        await opened.send(FRAMES[1])
        found = [other.recv(5), other.recv(5)]
        assert [pack_message(message) for message in found if message] == FRAMES[:2]
        other.send(unpack_message(FRAMES[2]))
        await until_async(lambda: received.frames)
        assert received.frames == [FRAMES[2]]
        assert opened.status.tx_frames == 2


async def test_reading_thread_ends_with_the_link(bus: tuple[CanLink, can.BusABC]) -> None:
    async with run_link(bus[0]):
        assert [t.name for t in threading.enumerate() if t.name == "fti-can-can1"]
    assert not [t.name for t in threading.enumerate() if t.name == "fti-can-can1"]


async def test_drain_takes_what_the_bus_holds(bus: tuple[CanLink, can.BusABC]) -> None:
    config, other = bus
    async with run_link(config) as (opened, received):
        for frame in FRAMES:
            other.send(unpack_message(frame))
        await opened.drain()
        assert received.frames == FRAMES


async def test_drain_waits_for_the_thread_that_reads(bus: tuple[CanLink, can.BusABC]) -> None:
    """Two that read one bus would change the order of the frames."""
    config, other = bus
    frames = [pack_can(i % 0x800, i.to_bytes(4, "little")) for i in range(3000)]
    async with run_link(config) as (opened, received):
        for frame in frames:
            other.send(unpack_message(frame))
        await opened.drain()
        assert received.frames == frames
        assert received.times == sorted(received.times)


async def test_draining_ends_while_others_talk(bus: tuple[CanLink, can.BusABC]) -> None:
    """A message every 10 ms, which is sooner than the thread waits: it looks whether something is there, no more."""
    config, other = bus

    async def talk() -> None:
        while True:
            other.send(unpack_message(FRAMES[0]))
            await asyncio.sleep(0.01)

    async with run_link(config) as (opened, received):
        talking = asyncio.create_task(talk())
        await until_async(lambda: received.frames)
        await opened.drain()
        assert "fti-can-can1" not in [thread.name for thread in threading.enumerate()]
        talking.cancel()


async def test_what_was_read_before_a_bus_is_lost_is_handed_on(bus: tuple[CanLink, can.BusABC]) -> None:
    """The loop is busy while the thread reads, and finds the bus lost before it has looked at the frames."""
    config, other = bus
    async with run_link(config) as (opened, received):
        for _ in range(100):
            other.send(unpack_message(FRAMES[0]))
        until(lambda: not opened._bus or opened._bus.queue.empty(), what="the thread to read")
        opened._close()
        assert len(received.frames) == 100


async def test_a_driver_that_raises_anything_is_read_on(bus: tuple[CanLink, can.BusABC]) -> None:
    config, other = bus
    async with run_link(config) as (opened, received):
        recv = opened._bus.recv

        def fail_then_read(timeout: float) -> can.Message | None:
            opened._bus.recv = recv
            raise RuntimeError("a driver of a vendor")

        opened._bus.recv = fail_then_read
        await until_async(lambda: opened.status.refused)
        other.send(unpack_message(FRAMES[0]))
        await until_async(lambda: received.frames)
        assert opened.status.errors == {"can_unreadable": 1}


@pytest.mark.parametrize(
    ("error", "state", "words"),
    [
        (OSError(errno.ENODEV, "No such device"), LinkState.ABSENT, "no such interface; present:"),
        (OSError(errno.EAFNOSUPPORT, "no"), LinkState.ABSENT, "kernel has no SocketCAN"),
        (PermissionError(errno.EPERM, "no"), LinkState.DENIED, "permission denied"),
        (OSError(errno.EBUSY, "no"), LinkState.BUSY, "in use"),
        (can.CanInitializationError("driver says no"), LinkState.ABSENT, "driver says no"),
    ],
)
async def test_bus_that_cannot_be_opened(
    monkeypatch: pytest.MonkeyPatch, error: Exception, state: LinkState, words: str
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(can, "Bus", refuse)
    async with run_link(link("socketcan"), connects=0) as (opened, _):
        await until_async(lambda: words in opened.status.hint)
        assert opened.status.state is state


def test_interface_that_python_can_does_not_know() -> None:
    with pytest.raises(ConfigError, match=r"'canned_fish': allowed are .*socketcan"):
        open_link(link("canned_fish"), FakeClock(), lambda frames, times: None)


async def test_bus_that_opens_too_late_is_closed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The link is cancelled while a driver is still busy opening."""
    go, made = threading.Event(), list[FakeBus]()

    def slow(*_: object, **__: object) -> FakeBus:
        go.wait(10)
        made.append(FakeBus())
        return made[0]

    monkeypatch.setattr(can, "Bus", slow)
    async with run_link(link("socketcan"), connects=0):
        await asyncio.sleep(0)
    go.set()
    await until_async(lambda: made and made[0].closed)


# ----------------------------------------------------------------------------------- interfaces with a descriptor


class FakeBus:
    """A bus whose descriptor is one end of a pair of sockets; each datagram is a frame, or a complaint."""

    def __init__(self) -> None:
        self.socket, self.other = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.arguments: dict[str, Any] = {}
        self.closed = False

    def fileno(self) -> int:
        return self.socket.fileno()

    def recv(self, timeout: float) -> can.Message | None:
        self.socket.setblocking(False)
        try:
            data = self.socket.recv(100)
        except BlockingIOError:
            return None
        if data == b"bad":
            raise can.CanOperationError("could not unpack received message")
        if data == b"worse":
            raise RuntimeError("a driver of a vendor")
        return unpack_message(data)

    def send(self, message: can.Message, timeout: float) -> None:
        self.other.send(pack_message(message))  # to whoever listens, ourselves too
        self.socket.send(pack_message(message))

    def shutdown(self) -> None:
        self.closed = True
        self.socket.close()
        self.other.close()


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[FakeBus]]:
    """The buses that were opened, the newest last."""
    results: list[FakeBus] = []

    def make(channel: str, interface: str, **arguments: Any) -> FakeBus:
        results.append(FakeBus())
        results[-1].arguments = arguments
        return results[-1]

    monkeypatch.setattr(can, "Bus", make)
    yield results
    assert all(bus.closed for bus in results)


async def test_multicast_bus_stays_on_this_machine_and_does_not_hear_itself(fake: list[FakeBus]) -> None:
    config = link("udp_multicast", transmit=True, bitrate=500_000, settings={"port": 4711, "hop_limit": 9})
    async with run_link(config) as (opened, received):
        assert fake[0].arguments == {"ignore_config": True, "port": 4711, "hop_limit": 0}
        await opened.send(FRAMES[0])
        fake[0].other.send(FRAMES[1])
        fake[0].other.send(FRAMES[0])
        await until_async(lambda: len(received.frames) == 2)
        assert received.frames == [FRAMES[1], FRAMES[0]]


@pytest.fixture
def own_socket(monkeypatch: pytest.MonkeyPatch) -> FakeBus:
    """A bus of the library that is a socket of its own (udp_multicast), with a small queue."""
    result = FakeBus()
    for end in (result.socket, result.other):
        end.close()
    result.socket, result.other = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    result.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    result.socket.bind(("127.0.0.1", 0))
    result.other.connect(result.socket.getsockname())
    monkeypatch.setattr(can, "Bus", lambda *_, **__: result)
    return result


async def test_frames_that_the_kernel_drops_are_counted(own_socket: FakeBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sockets, "RECEIVE_BUFFER", 4096)
    async with run_link(link("udp_multicast")) as (opened, received):
        for _ in range(500):
            own_socket.other.send(FRAMES[0])
        await until_async(lambda: opened.status.socket_dropped and received.frames)
        await opened.drain()
        opened._check()
        assert len(received.frames) + opened.status.socket_dropped == 500


async def test_a_bus_that_is_a_socket_has_a_queue_that_is_enough(own_socket: FakeBus) -> None:
    """Half a second of 525 frames/s may wait, where nothing but the usual limit of the system is allowed."""
    async with run_link(link("udp_multicast")) as (opened, received):
        for _ in range(260):
            own_socket.other.send(FRAMES[0])
        await until_async(lambda: len(received.frames) == 260)
        assert opened.status.socket_dropped == 0


async def test_a_frame_that_could_not_be_sent_is_not_waited_for(fake: list[FakeBus]) -> None:
    """Another node may send the same frame."""

    def refuse(message: can.Message, timeout: float) -> None:
        raise can.CanOperationError("the network is down")

    async with run_link(link("udp_multicast", transmit=True)) as (opened, received):
        fake[0].send = refuse  # type: ignore[method-assign]
        with pytest.raises(LinkError, match="the network is down"):
            await opened.send(FRAMES[0])
        fake[0].other.send(FRAMES[0])
        await until_async(lambda: received.frames)
        assert received.frames == FRAMES[:1]


async def test_an_echo_of_an_earlier_bus_is_not_waited_for(fake: list[FakeBus]) -> None:
    async with run_link(link("udp_multicast", transmit=True)) as (opened, received):
        fake[0].send = lambda message, timeout: None  # type: ignore[method-assign]
        await opened.send(FRAMES[0])
        opened._fail(LinkError("lost"))
        await until_async(lambda: opened.status.connects == 2)
        fake[1].other.send(FRAMES[0])
        await until_async(lambda: received.frames)


async def test_bad_frame_is_counted_and_skipped(fake: list[FakeBus]) -> None:
    async with run_link(link("pcan", bitrate=250_000)) as (opened, received):
        assert fake[0].arguments == {"ignore_config": True, "bitrate": 250_000}
        for data in (FRAMES[0], b"bad", b"worse", FRAMES[1]):
            fake[0].other.send(data)
        await until_async(lambda: len(received.frames) == 2)
        assert opened.status.refused == 2
        assert opened.status.errors == {"can_unreadable": 2}
        assert opened.status.connects == 1


async def test_bad_frames_among_good_ones_are_no_lost_bus(fake: list[FakeBus]) -> None:
    async with run_link(link("pcan")) as (opened, received):
        for turn in range(1, 4):
            for _ in range(60):
                fake[0].other.send(b"bad")
                await asyncio.sleep(0)  # the pair of sockets holds few
            fake[0].other.send(FRAMES[0])
            await until_async(lambda turn=turn: len(received.frames) == turn)  # type: ignore[misc]
        assert opened.status.refused == 180
        assert not opened._lost.done()


async def test_bus_that_only_complains_is_opened_again(fake: list[FakeBus]) -> None:
    async with run_link(link("pcan")) as (_, received):

        def complain() -> bool:
            if not fake[0].closed:
                fake[0].other.send(b"bad")
            return len(fake) == 2

        await until_async(complain)
        fake[1].other.send(FRAMES[0])
        await until_async(lambda: received.frames)


async def test_socketcan_frames_are_taken_as_they_are(fake: list[FakeBus], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fti.links.can.can_interfaces", list)
    clock = SystemClock(choose_epoch_ns())
    async with run_link(link("socketcan", fd=True, transmit=True), clock=clock) as (opened, received):
        for frame in FRAMES:
            fake[0].other.send(frame)
        await until_async(lambda: len(received.frames) == len(FRAMES))
        assert received.frames == FRAMES
        await opened.send(FRAMES[1])
        assert fake[0].other.recv(100) == FRAMES[1]
        await until_async(lambda: opened.status.state is LinkState.ABSENT)
        assert "ip link set" in opened.status.hint


class Flaky:
    """A socket that fails once with each of these errors when it sends, then works."""

    def __init__(self, inner: socket.socket, errors: list[int]) -> None:
        self._inner = inner
        self._errors = errors

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def send(self, data: bytes) -> int:
        fail_once(self._errors)
        return self._inner.send(data)


class FlakyBatch(ReceiveBatch):
    """Reads as the kernel would that fails once with each of these errors, then works and knows our own frames."""

    def __init__(self, errors: list[int], own: bytes = b"") -> None:
        super().__init__()
        self._errors = errors
        self._own = own

    def receive(self, fd: int) -> int:
        fail_once(self._errors)
        return super().receive(fd)

    def flags(self) -> list[int]:
        return [socket.MSG_CONFIRM if frame == self._own else 0 for frame in self.frames()]


def fail_once(errors: list[int]) -> None:
    if errors:
        raise OSError(errors.pop(), "as told")


async def test_interface_that_goes_down_is_read_again_without_opening(fake: list[FakeBus]) -> None:
    async with run_link(link("socketcan")) as (opened, received):
        opened._arrival.batch = FlakyBatch([errno.ENETDOWN])
        fake[0].other.send(FRAMES[0])
        await until_async(lambda: received.frames)
        assert not opened._lost.done()


async def test_own_frame_is_not_received(fake: list[FakeBus]) -> None:
    async with run_link(link("socketcan", settings={"receive_own_messages": True})) as (opened, received):
        opened._arrival.batch = FlakyBatch([], own=FRAMES[0])
        for frame in FRAMES[:2]:
            fake[0].other.send(frame)
        await until_async(lambda: received.frames)
        assert received.frames == FRAMES[1:2]


async def test_interface_that_vanishes_is_opened_again(fake: list[FakeBus]) -> None:
    async with run_link(link("socketcan")) as (opened, received):
        opened._arrival.batch = FlakyBatch([errno.ENODEV])
        for frame in FRAMES[:3]:
            fake[0].other.send(frame)
        await until_async(lambda: opened.status.connects == 2)
        assert received.frames == FRAMES[:3]  # the kernel tells the error first, and keeps what came before it


async def test_full_transmit_queue_is_waited_for(fake: list[FakeBus]) -> None:
    async with run_link(link("socketcan", transmit=True)) as (opened, _):
        opened._socket = Flaky(fake[0].socket, [errno.ENOBUFS] * 3)
        await opened.send(FRAMES[0])
        assert fake[0].other.recv(100) == FRAMES[0]
        opened._socket = Flaky(fake[0].socket, [errno.ENOBUFS] * 1000)
        with pytest.raises(LinkError, match="could not be sent within"):
            await opened.send(FRAMES[0], timeout_s=0.05)
        opened._socket = Flaky(fake[0].socket, [errno.EIO])
        with pytest.raises(LinkError, match="cannot send"):
            await opened.send(FRAMES[0])


async def test_a_frame_that_waits_while_the_bus_is_lost_is_not_reported_as_sent(fake: list[FakeBus]) -> None:
    async with run_link(link("socketcan", transmit=True)) as (opened, _):
        opened._socket = Flaky(fake[0].socket, [errno.ENOBUFS] * 100_000)
        sending = asyncio.create_task(opened.send(FRAMES[0], 30.0))
        await asyncio.sleep(0)
        opened._fail(LinkError("lost"))
        with pytest.raises(LinkError, match="not connected"):
            await sending
        assert opened.status.tx_frames == 0


async def test_nothing_is_sent_while_the_bus_is_being_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    """A driver of a vendor takes seconds for that."""
    go_on, made = threading.Event(), FakeBus()
    monkeypatch.setattr(can, "Bus", lambda *_, **__: go_on.wait(30.0) and made)
    async with run_link(link("udp_multicast", transmit=True), connects=0) as (opened, _):
        await until_async(lambda: opened._lost is not None)
        with pytest.raises(LinkError, match="is not connected: not opened yet"):
            await opened.send(FRAMES[0])
        go_on.set()
        await until_async(lambda: opened.status.connects)


@pytest.mark.parametrize("sends", [True, False])
async def test_what_a_driver_does_after_it_was_given_up_is_reported(fake: list[FakeBus], sends: bool) -> None:
    go_on = threading.Event()

    def be_slow(message: can.Message, timeout: float) -> None:
        go_on.wait(30.0)
        if not sends:
            raise RuntimeError("a driver of a vendor")

    async with run_link(link("udp_multicast", transmit=True)) as (opened, _):
        fake[0].send = be_slow  # type: ignore[method-assign]
        asyncio.get_running_loop().call_later(0.05, go_on.set)
        with pytest.raises(LinkError) as caught:
            await opened.send(FRAMES[0], timeout_s=0.01)
        assert opened.status.tx_frames == sends
        assert isinstance(caught.value, PartialSendError) is sends
        assert len(opened._echoes) == sends


async def test_stamps_without_a_kernel_are_those_of_the_read(bus: tuple[CanLink, can.BusABC]) -> None:
    async with run_link(bus[0], clock=FakeClock(42)) as (_, received):
        bus[1].send(unpack_message(FRAMES[0]))
        await until_async(lambda: received.times == [42])
