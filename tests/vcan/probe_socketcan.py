"""Runs inside the user-mode kernel: a link and a listener listen to vcan0, frames come from python-can and raw sockets.

What both saw, with stamps and states, is judged by ``test_socketcan.py``.
"""

from __future__ import annotations

import asyncio
import socket
import subprocess
import time
from collections.abc import Sequence
from typing import Any

import can

from fti.clock import SystemClock, choose_epoch_ns
from fti.config import CanLink
from fti.errors import LinkError
from fti.links import Link, open_link, per_frame_sink
from fti.messages.frames import LinkState
from tests.helpers import until_async

BURST = 3000  # what a default socket buffer does not hold
OWN_FRAME = (0x321).to_bytes(4, "little") + b"\x02\0\0\0" + b"\xaa\xbb" + bytes(6)

FRAMES = [
    can.Message(arbitration_id=0x000, is_extended_id=False, data=b""),
    can.Message(arbitration_id=0x7FF, is_extended_id=False, data=bytes(range(8))),
    can.Message(arbitration_id=0x000, is_extended_id=True, data=b"\x00"),
    can.Message(arbitration_id=0x1FFFFFFF, is_extended_id=True, data=b"\xff" * 8),
    can.Message(arbitration_id=0x123, is_extended_id=False, is_remote_frame=True, dlc=4),
    can.Message(arbitration_id=0x18DAF110, is_extended_id=True, is_remote_frame=True, dlc=0),
    can.Message(arbitration_id=0x456, is_extended_id=False, is_fd=True, data=b""),
    can.Message(arbitration_id=0x456, is_extended_id=False, is_fd=True, bitrate_switch=True, data=bytes(range(64))),
    can.Message(arbitration_id=0x12345678, is_extended_id=True, is_fd=True, data=bytes(range(12))),
]

#: linux/can/error.h: the controller lost a frame; it is error passive; bus off.
ERROR_FRAMES = [
    (0x2000_0004).to_bytes(4, "little") + b"\x08\0\0\0" + b"\0\x01" + bytes(6),
    (0x2000_0004).to_bytes(4, "little") + b"\x08\0\0\0" + b"\0\x10" + bytes(6),
    (0x2000_0040).to_bytes(4, "little") + b"\x08\0\0\0" + bytes(8),
]

Received = list[tuple[str, int]]


class KernelListener:
    """What a plain socket of the kernel hands over, as candump reads it."""

    def __init__(self, channel: str) -> None:
        self.sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.sock.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        self.sock.bind((channel,))
        self.sock.setblocking(False)

    def frames(self) -> list[str]:
        """Every frame since the last call, in hexadecimal."""
        found = []
        while True:
            try:
                found.append(self.sock.recv(72).hex())
            except BlockingIOError:
                return found
            except OSError:
                continue  # the interface went down


def ip_link(channel: str, state: str) -> None:
    subprocess.run(["ip", "link", "set", channel, state], check=True)


def link_of(channel: str, received: Received, clock: SystemClock, **keys: Any) -> Link:
    config = CanLink(name=channel, kind="can", interface="socketcan", channel=channel, fd=True, **keys)
    return open_link(config, clock, per_frame_sink(lambda data, t_rx_ns: received.append((data.hex(), t_rx_ns))))


def send_all(bus: can.BusABC, frames: Sequence[can.Message]) -> None:
    for frame in frames:
        bus.send(frame, timeout=1.0)


async def every_kind(
    link: Link, received: Received, listener: KernelListener, bus: can.BusABC, clock: SystemClock
) -> dict[str, Any]:
    """Frames of every kind, sent while the loop is busy elsewhere: only kernel stamps can tell them apart."""
    before = clock.now_ns()
    send_all(bus, FRAMES)
    after = clock.now_ns()
    time.sleep(0.3)  # noqa: ASYNC251 - a busy loop is what is tested
    await until_async(lambda: len(received) >= len(FRAMES), what="every kind of frame")
    return {
        "link": [s[0] for s in received],
        "times": [s[1] for s in received],
        "listener": listener.frames(),
        "sent": [before, after],
    }


async def error_frames(link: Link, received: Received) -> dict[str, Any]:
    """What a controller says of itself and of the bus, as a driver would hand it in: with CAN_ERR_FLAG."""
    received.clear()
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sock:
        sock.bind(("vcan0",))
        for frame in ERROR_FRAMES:
            sock.send(frame)
    await until_async(lambda: len(received) >= len(ERROR_FRAMES), what="the error frames")
    return {"link": [s[0] for s in received], "errors": dict(link.status.errors)}


async def burst(link: Link, received: Received, bus: can.BusABC) -> dict[str, Any]:
    """More frames than a default buffer holds, while nobody reads."""
    received.clear()
    for i in range(BURST):
        bus.send(can.Message(arbitration_id=1, is_extended_id=False, data=i.to_bytes(8, "little")), timeout=1.0)
    await until_async(lambda: len(received) + link.status.socket_dropped >= BURST, what="the burst")
    return {
        "counts": [int.from_bytes(bytes.fromhex(s[0])[8:], "little") for s in received],
        "dropped": link.status.socket_dropped,
    }


async def down_and_up(link: Link, received: Received, listener: KernelListener) -> dict[str, Any]:
    """The interface goes down and comes back."""
    received.clear()
    listener.frames()
    ip_link("vcan0", "down")
    await until_async(lambda: link.status.state is LinkState.ABSENT, what="the link to notice")
    hint = link.status.hint
    ip_link("vcan0", "up")
    await until_async(lambda: link.status.state is not LinkState.ABSENT, what="the link to come back")
    with can.Bus(interface="socketcan", channel="vcan0") as bus:  # a new one: the old one's first send would fail
        send_all(bus, FRAMES[:3])
    await until_async(lambda: len(received) >= 3, what="frames after the interface came back")
    return {"hint": hint, "link": [s[0] for s in received], "listener": listener.frames()}


async def sending(clock: SystemClock) -> dict[str, Any]:
    """A link that may send does; its own frame is not received, not even when the kernel hands it back."""
    received: Received = []
    listener = KernelListener("vcan1")
    link = link_of("vcan1", received, clock, transmit=True, settings={"receive_own_messages": True})
    task = asyncio.create_task(link.run(), name="sender")
    await until_async(lambda: link.status.state is LinkState.SILENT, what="vcan1")
    await link.send(OWN_FRAME)
    with can.Bus(interface="socketcan", channel="vcan1") as bus:
        bus.send(FRAMES[1])
    await until_async(lambda: len(received) >= 1, what="the frame of another")
    await cancel(task)
    return {"link": [s[0] for s in received], "listener": listener.frames(), "tx_frames": link.status.tx_frames}


async def absent(clock: SystemClock) -> dict[str, Any]:
    """An interface that does not exist."""
    link = link_of("vcan7", [], clock)
    task = asyncio.create_task(link.run(), name="absent")
    await until_async(lambda: "vcan7" in link.status.hint, what="a hint")
    await cancel(task)
    return {"state": link.status.state.value, "hint": link.status.hint}


async def set_clock(clock: SystemClock) -> list[dict[str, Any]]:
    """A frame waits with the kernel's stamp while somebody sets the real-time clock; this kernel is only ours."""
    received: Received = []
    link = link_of("vcan0", received, clock)
    task = asyncio.create_task(link.run(), name="set clock")
    await until_async(lambda: link.status.state is LinkState.SILENT, what="vcan0")
    rows = []
    with can.Bus(interface="socketcan", channel="vcan0") as bus:
        for step_ns in (5_000_000_000, -5_000_000_000):
            received.clear()
            before = clock.now_ns()
            clock.take_steps()
            bus.send(FRAMES[1])
            time.clock_settime_ns(time.CLOCK_REALTIME, time.clock_gettime_ns(time.CLOCK_REALTIME) + step_ns)
            await until_async(lambda: bool(received), what="the frame that waited")
            rows.append(
                {
                    "step_ns": step_ns,
                    "span": [before, clock.now_ns()],
                    "t_rx_ns": received[-1][1],
                    "refused": link.status.stamp_refused,
                    "told": [step.size_ns for step in clock.take_steps()],
                }
            )
    await cancel(task)
    return rows


async def cancel(task: asyncio.Task[None]) -> None:
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def probe() -> dict[str, Any]:
    clock = SystemClock(choose_epoch_ns())
    received: Received = []
    link = link_of("vcan0", received, clock)
    listener = KernelListener("vcan0")
    task = asyncio.create_task(link.run(), name="vcan0")
    await until_async(lambda: link.status.state is LinkState.SILENT, what="vcan0")
    refused = ""
    try:
        await link.send(OWN_FRAME)
    except (ValueError, LinkError) as error:
        refused = str(error)
    with can.Bus(interface="socketcan", channel="vcan0", fd=True) as bus:
        found = {
            "kinds": await every_kind(link, received, listener, bus, clock),
            "errors": await error_frames(link, received),
            "burst": await burst(link, received, bus),
            "down": await down_and_up(link, received, listener),
        }
    await cancel(task)
    apart = {"sending": await sending(clock), "absent": await absent(clock), "set_clock": await set_clock(clock)}
    return {**found, **apart, "refused": refused}
