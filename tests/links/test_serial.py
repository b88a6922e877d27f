"""Serial links over real ptys."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import itertools
import os
import termios
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti.clock import FakeClock
from fti.config import SerialLink
from fti.errors import LinkError, PartialSendError, PortAbsent, PortBusy, PortDenied
from fti.links.serial import open_port
from fti.messages.frames import LinkState
from tests.helpers import until_async
from tests.links.bench import Peer, ReceivedFrames, run_link


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    result = Peer(tmp_path / "line")
    yield result
    result.power_off()


def link(peer: Peer | Path, transmit: bool = False, parity: str = "none") -> SerialLink:
    path = peer if isinstance(peer, Path) else peer.path
    return SerialLink.model_validate(
        {"name": "line", "kind": "serial", "port": str(path), "transmit": transmit, "parity": parity}
    )


async def test_bytes_arrive_as_sent_in_any_chunking(peer: Peer) -> None:
    sent = bytes(range(256)) * 4
    chunks = [sent[a:b] for a, b in itertools.pairwise([0, 1, 2, 10, 100, 600, len(sent)])]
    async with run_link(link(peer)) as (opened, received):
        for chunk in chunks:
            peer.write(chunk)
            await asyncio.sleep(0)
        await until_async(lambda: len(received.bytes) == len(sent))
    assert received.bytes == sent
    assert opened.status.bytes == len(sent)
    assert opened.status.frames == len(received.frames)
    assert received.times == sorted(received.times)


async def test_what_arrived_before_opening_is_kept(peer: Peer) -> None:
    peer.write(b"early \x11\x13\r\n\x03\x04\xff\x00")
    async with run_link(link(peer)) as (_, received):
        await until_async(lambda: received.bytes)
    assert received.bytes == b"early \x11\x13\r\n\x03\x04\xff\x00"


async def test_every_byte_passes_both_ways(peer: Peer) -> None:
    async with run_link(link(peer, transmit=True)) as (opened, _):
        assert await opened.send(bytes(range(256))) == 256
        await peer.expect(bytes(range(256)))
        assert (opened.status.tx_frames, opened.status.tx_bytes) == (1, 256)


async def test_stamp_is_the_clocks_time_of_the_read(peer: Peer) -> None:
    clock = FakeClock(5)
    async with run_link(link(peer), clock=clock) as (opened, received):
        peer.write(b"a")
        await until_async(lambda: received.times)
        clock.advance(1)
        peer.write(b"b")
        await until_async(lambda: len(received.times) == 2)
        assert received.times == [5, 1_000_000_005]
        assert opened.status.last_rx_ns == 1_000_000_005


async def test_states_silent_good_silent(peer: Peer) -> None:
    clock = FakeClock(0)
    async with run_link(link(peer), clock=clock) as (opened, _):
        assert opened.status.state is LinkState.SILENT
        assert "115200 baud" in opened.status.hint
        peer.write(b"a")
        await until_async(lambda: opened.status.state is LinkState.GOOD)
        clock.advance(3)
        await until_async(lambda: opened.status.state is LinkState.SILENT)


@pytest.mark.parametrize("parity", ["none", "even"])  # a pty has no parity; the emulator stands in for such a device
async def test_device_that_dies_and_comes_back_under_its_name(peer: Peer, parity: str) -> None:
    async with run_link(link(peer, parity=parity)) as (opened, received):
        peer.write(b"one")
        await until_async(lambda: received.bytes == b"one")
        peer.power_off()
        await until_async(lambda: opened.status.state is LinkState.ABSENT)
        peer.connect()
        await until_async(lambda: opened.status.connects == 2)
        peer.write(b"two")
        await until_async(lambda: received.bytes == b"onetwo")


async def test_name_that_leads_to_another_device_is_followed(peer: Peer, tmp_path: Path) -> None:
    other = Peer(tmp_path / "other")
    async with run_link(link(peer)) as (opened, received):
        (tmp_path / "new").symlink_to(other.path.readlink())
        (tmp_path / "new").replace(peer.path)
        peer.write(b"old, ")
        await until_async(lambda: opened.status.connects == 2)
        other.write(b"new")
        await until_async(lambda: received.bytes == b"old, new")
    other.power_off()


async def test_on_connect_is_sent_after_every_connect(peer: Peer) -> None:
    async with run_link(link(peer, transmit=True), on_connect=[b"log on\r", b"rate 10\r"]) as (opened, _):
        await peer.expect(b"log on\rrate 10\r")
        peer.power_off()
        await until_async(lambda: opened.status.state is LinkState.ABSENT)
        peer.connect()
        await peer.expect(b"log on\rrate 10\r")
        assert opened.status.tx_frames == 4


async def test_link_that_may_not_send_never_does(peer: Peer) -> None:
    async with run_link(link(peer), on_connect=[b"log on\r"]) as (opened, received):
        with pytest.raises(ValueError, match="transmit is false"):
            await opened.send(b"x")
        peer.write(b"!")
        await until_async(lambda: received.bytes)
        assert peer.read() == b""
        assert opened.status.tx_frames == 0


async def test_send_to_a_device_that_takes_nothing_ends_with_an_error(peer: Peer) -> None:
    async with run_link(link(peer, transmit=True)) as (opened, _):
        sent = ReceivedFrames()
        opened.on_sent = sent
        with pytest.raises(PartialSendError, match=r"could not be sent within 0.1 s; its first \d+ bytes are sent"):
            await opened.send(bytes(200_000), timeout_s=0.1)
        assert 0 < len(sent.bytes) < 200_000  # what went out stands in the file, though it was given up
        await peer.expect(sent.bytes)
        assert opened.status.tx_bytes == len(sent.bytes)


async def test_send_waits_for_a_slow_device(peer: Peer) -> None:
    async with run_link(link(peer, transmit=True)) as (opened, _):
        sent = bytes(range(250)) * 200
        sending = asyncio.create_task(opened.send(sent, 10.0))
        await peer.expect(sent)
        assert await sending == len(sent)


async def test_send_on_a_lost_link_is_an_error(peer: Peer) -> None:
    async with run_link(link(peer, transmit=True)) as (opened, _):
        peer.power_off()
        await until_async(lambda: opened.status.state is LinkState.ABSENT)
        with pytest.raises(LinkError, match="not connected"):
            await opened.send(b"x")
        peer.connect()


async def test_send_that_waits_while_the_device_dies_is_an_error(peer: Peer) -> None:
    async with run_link(link(peer, transmit=True)) as (opened, _):
        sending = asyncio.create_task(opened.send(bytes(200_000), 10.0))
        await until_async(lambda: len(peer.read()) > 0)
        peer.power_off()
        with pytest.raises(PartialSendError, match="bytes are sent"):
            await sending
        peer.connect()


async def test_send_that_waits_while_the_link_is_closed_is_an_error(peer: Peer) -> None:
    async with run_link(link(peer, transmit=True)) as (opened, _):
        sending = asyncio.create_task(opened.send(bytes(200_000), 30.0))
        await until_async(lambda: len(peer.read()) > 0)
    with pytest.raises(LinkError, match="closed"):
        await sending


async def test_drain_takes_what_the_kernel_holds(peer: Peer) -> None:
    async with run_link(link(peer)) as (opened, received):
        peer.write(b"x" * 8000)
        await opened.drain()
        assert len(received.bytes) == 8000
        await opened.drain()  # nothing more: that is no lost device
        assert not opened._lost.done()


async def test_absent_port_names_those_that_exist(tmp_path: Path) -> None:
    async with run_link(link(tmp_path / "nothing"), connects=0) as (opened, _):
        await until_async(lambda: "no such port; present:" in opened.status.hint)
        assert opened.status.state is LinkState.ABSENT
        with pytest.raises(LinkError, match="not connected"):
            await open_for_sending(tmp_path)


async def open_for_sending(tmp_path: Path) -> None:
    async with run_link(link(tmp_path / "nothing", transmit=True), connects=0) as (opened, _):
        await opened.send(b"x")


async def test_port_in_use_is_busy_until_it_is_free(peer: Peer) -> None:
    async with run_link(link(peer)), run_link(link(peer), connects=0) as (second, received):
        await until_async(lambda: second.status.state is LinkState.BUSY)
        assert "in use" in second.status.hint
    async with run_link(link(peer)) as (third, received):
        peer.write(b"mine")
        await until_async(lambda: received.bytes == b"mine")
        assert third.status.state is LinkState.GOOD


@pytest.mark.parametrize(
    ("number", "kind", "words"),
    [
        (errno.EACCES, PortDenied, "must be in group"),
        (errno.EBUSY, PortBusy, "in use"),
        (errno.ENXIO, PortAbsent, "no such port"),
    ],
)
def test_what_the_kernel_says_becomes_a_sentence(
    peer: Peer, monkeypatch: pytest.MonkeyPatch, number: int, kind: type[LinkError], words: str
) -> None:
    """Permission cannot be taken from root, who runs tests in a container: the kernel's answer is given instead."""

    def refuse(*_: object) -> int:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("serial.serialposix.os.open", refuse)
    with pytest.raises(kind, match=words):
        open_port(link(peer))


def test_file_that_is_no_port_is_explained(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"")
    with pytest.raises(LinkError, match="does not accept 115200 baud, 8 bits, parity none"):
        open_port(link(file))


def test_pty_has_no_wire_and_so_no_parity(peer: Peer) -> None:
    keys = {"parity": "even", "data_bits": 7, "flow": "rtscts"}
    port = open_port(link(peer).model_copy(update=keys))
    assert (port.bytesize, port.parity, port.rtscts, port.exclusive) == (8, "N", False, True)
    port.close()


def test_nothing_of_an_earlier_user_lets_the_kernel_discard_bytes(peer: Peer) -> None:
    """BRKINT: a break empties the queue.  IGNPAR: bytes with an error are left out.  ``stty sane`` sets the first."""
    settings = termios.tcgetattr(peer._slave)
    settings[0] |= termios.BRKINT | termios.IGNPAR | termios.IGNBRK | termios.INPCK | termios.ISTRIP
    termios.tcsetattr(peer._slave, termios.TCSANOW, settings)
    port = open_port(link(peer))
    assert termios.tcgetattr(port.fileno())[0] == 0
    port.close()


async def test_flood_on_one_line_does_not_silence_another(peer: Peer, tmp_path: Path) -> None:
    loud = Peer(tmp_path / "loud")
    async with run_link(link(loud.path)) as (_, much), run_link(link(peer)) as (_, little):

        def talk() -> bool:
            with contextlib.suppress(BlockingIOError):
                loud.write_some(bytes(2000))
            peer.write(b"q")
            return len(much.bytes) > 200_000 and len(little.bytes) > 20

        await until_async(talk)
    loud.power_off()
