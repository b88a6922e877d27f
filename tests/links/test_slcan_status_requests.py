"""Status requests of a link to its Lawicel adapter, over a real pty."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fti.canframe import pack_can
from fti.clock import FakeClock
from fti.config import CanLink
from fti.errors import LinkError
from fti.hil.ports.lawicel import Adapter
from fti.links.slcan import format_frame
from fti.links.slcan_status import FLAGS
from fti.messages.frames import LinkState
from tests.helpers import until_async
from tests.links.bench import Peer, run_link

FRAME = pack_can(0x123, b"\x11\x22")


def counted(**counts: int) -> dict[str, int]:
    return dict.fromkeys(FLAGS.values(), 0) | {f"slcan_{name}": count for name, count in counts.items()}


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    result = Peer(tmp_path / "can1")
    yield result
    result.power_off()


def link(peer: Peer, **keys: Any) -> CanLink:
    table = {"name": "can1", "kind": "can", "interface": "slcan", "channel": str(peer.path), **keys}
    return CanLink.model_validate(table)


class Device:
    """The emulated adapter behind the other end of the line."""

    def __init__(self, peer: Peer) -> None:
        self.stated = b""
        self.frames: list[bytes] = []
        self.adapter = Adapter(self.frames.append)
        self._peer = peer

    def attend(self, until: Callable[[], object]) -> Callable[[], object]:
        """Answer, then look whether it is so."""

        def look() -> object:
            text = self._peer.read()
            self.stated += text
            self._peer.write(b"".join(self.adapter.feed(text)))
            return until()

        return look


@pytest.mark.parametrize("listen_only", [False, True])
async def test_flags_of_the_emulated_adapter_are_counted(peer: Peer, listen_only: bool) -> None:
    clock, device = FakeClock(0), Device(peer)
    device.adapter.flags = 0x80
    async with run_link(link(peer, settings={"listen_only": listen_only}), clock=clock) as (opened, received):
        errors = opened.status.errors
        await until_async(device.attend(lambda: "slcan_bus_error" in errors))
        for _ in range(2):
            before = errors["slcan_data_overrun"]
            device.adapter.flags = 0x09
            clock.advance(1)
            await until_async(device.attend(lambda: errors["slcan_data_overrun"] > before), 20)  # noqa: B023
        assert errors == counted(data_overrun=2, rx_fifo_full=2, noise_bytes=0)
        assert (received.frames, opened.status.frames, opened.status.tx_frames) == ([], 0, 0)
        assert device.stated == b"C\r" + (b"L\r" if listen_only else b"O\r") + b"F\r" * 3
        assert opened.status.state is LinkState.SILENT  # an answer is no frame


async def test_errors_on_the_bus_are_in_the_hint(peer: Peer) -> None:
    clock, device = FakeClock(0), Device(peer)
    async with run_link(link(peer), clock=clock) as (opened, _):
        device.adapter.flags = 0x04
        await until_async(device.attend(lambda: "bus errors" in opened.status.hint))


async def test_an_adapter_that_was_without_power_is_opened_again(peer: Peer) -> None:
    clock, device = FakeClock(0), Device(peer)
    async with run_link(link(peer), clock=clock) as (opened, received):
        errors = opened.status.errors
        await until_async(device.attend(lambda: "slcan_bus_error" in errors))
        device.adapter = Adapter(device.frames.append)

        def wait() -> bool:
            clock.advance(0.05)
            return device.adapter.is_open

        await until_async(device.attend(wait))
        assert errors["slcan_channel_closed"] == 1
        peer.write(format_frame(FRAME))
        await until_async(lambda: received.frames == [FRAME])
        assert opened.status.connects == 1


def choke(monkeypatch: pytest.MonkeyPatch, room: list[int]) -> bytearray:
    """A kernel that takes so many bytes at each write; returns what it has taken."""
    data = bytearray()

    def write(fd: int, text: bytes) -> int:
        count = min(room.pop(0), len(text)) if room else 0
        if not count:
            raise BlockingIOError
        data.extend(text[:count])
        return count

    monkeypatch.setattr("fti.links.slcan.os.write", write)
    return data


@pytest.mark.parametrize(("room", "later", "stated"), [([], [], b""), ([5], [], b"t1232"), ([5], [99], b"t12321122\r")])
async def test_a_line_that_was_begun_is_ended_before_the_status_is_asked(
    peer: Peer, monkeypatch: pytest.MonkeyPatch, room: list[int], later: list[int], stated: bytes
) -> None:
    """Else the half line and the question behind it could be a frame that nobody sent."""
    async with run_link(link(peer, transmit=True), clock=FakeClock(0)) as (opened, _):
        await peer.expect(b"C\rO\rF\r")
        monkeypatch.setattr(opened, "_check", lambda: None)
        with monkeypatch.context() as choked:
            data = choke(choked, room)
            with pytest.raises(LinkError, match="could not be sent"):
                await opened.send(FRAME, 0.05)
            assert data == stated[:5]
            room += later
            opened._request_status()
            assert data == stated
        opened._request_status()
        rest = b"t12321122\r"[len(stated) :] if stated else b""
        await peer.expect(rest + b"F\r")


async def test_half_a_line_is_not_ended_at_another_adapter(peer: Peer, monkeypatch: pytest.MonkeyPatch) -> None:
    async with run_link(link(peer, transmit=True), clock=FakeClock(0)) as (opened, _):
        await peer.expect(b"C\rO\rF\r")
        with monkeypatch.context() as choked:
            choke(choked, [5])
            with pytest.raises(LinkError, match="could not be sent"):
                await opened.send(FRAME, 0.05)
        peer.power_off()
        await until_async(lambda: opened.status.state is LinkState.ABSENT)
        peer.connect()
        await peer.expect(b"C\rO\rF\r")
        await until_async(lambda: opened.status.connects == 2)
        opened._request_status()
        await peer.expect(b"F\r")


async def test_a_refusal_before_the_channel_was_open_is_no_hint(peer: Peer) -> None:
    """The manual has a closed adapter refuse to close."""
    async with run_link(link(peer), clock=FakeClock(0)) as (opened, _):
        await peer.expect(b"C\rO\rF\r")
        peer.write(b"\a\r")
        await until_async(lambda: "refused a command" in opened.status.hint)
        peer.write(b"F00\r")
        await until_async(lambda: "no frame arrives" in opened.status.hint)


async def test_the_status_is_not_asked_inside_a_frame_that_is_being_sent(peer: Peer) -> None:
    clock = FakeClock(0)
    async with run_link(link(peer, transmit=True), clock=clock) as (opened, _):
        await peer.expect(b"C\rO\rF\r")
        async with opened._send_lock:
            clock.advance(5)
            opened._check()
            assert peer.read() == b""
        clock.advance(5)
        opened._check()
        await peer.expect(b"F\r")
