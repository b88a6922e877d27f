"""The other end of each link of the daemon's configuration.

serial                       pty, symlink ``DIR/<link>``
can, interface slcan         Lawicel adapter on a pty, symlink ``DIR/<link>``
can, socketcan and others    the same channel through python-can; udp_multicast with hop limit 0
udp                          datagrams to ``bind``, sent from ``source`` (``peer`` when the daemon answers there)

``[port.LINK]`` of a scenario selects a real port instead (``real_port``).
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket
from collections.abc import AsyncIterator, Coroutine, Mapping
from pathlib import Path
from typing import Any, ClassVar, Protocol

from fti.config import CanLink, Link, SerialLink, UdpLink
from fti.errors import MissingError
from fti.hil.ports.counters import EndpointCounters
from fti.hil.ports.datagram_base import DatagramEndpoint
from fti.hil.ports.lawicel import Adapter
from fti.hil.ports.pacing import PacedMessage, byte_s, frame_s
from fti.hil.ports.pty import POLL_S, PtyEndpoint
from fti.hil.ports.real_port import RealPort, TtyEndpoint
from fti.hil.ports.serial_base import Notifier, Responder
from fti.links.slcan import format_frame

#: python-can interfaces whose channel two programs of one machine can share.
SHARED_INTERFACES = ("slcan", "socketcan", "udp_multicast", "virtual")
#: Loopback address for links that bind to any address.
LOOPBACK_OF = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104  nothing is bound to these


class Endpoint(Protocol):
    """One end of a link.  A message is a piece of a byte stream, a datagram or a CAN frame."""

    counters: EndpointCounters
    is_stream: ClassVar[bool]  # messages may be joined: the receiver does not see their bounds

    async def open(self) -> None:
        """Open the port.  Raises MissingError when that fails."""

    async def wait_for_reader(self) -> None:
        """Wait until the daemon has opened its end, if that is visible."""

    def send(self, data: bytes) -> None:
        """Send now; drop and count messages that do not fit."""

    async def send_all(self, data: bytes) -> None:
        """Send without loss; wait while the port is full."""

    async def drain(self) -> None:
        """Wait until the reader has read everything, if that is visible."""

    def close(self) -> None:
        """Close the port."""


def make_endpoint(
    link: Link,
    folder: Path,
    respond: Responder,
    *,
    paced: bool = False,
    notify: Notifier = lambda _: None,
    port: RealPort | None = None,
) -> Endpoint:
    """The far end of a link.

    folder : folder of the symlinks to ptys; notify : called with messages for the user
    paced  : limit a pty to the baud rate of the link; False for a replay, which has the recorded timing
    port   : real port of the link, if any
    """
    if isinstance(link, UdpLink):
        return UdpEndpoint(link, respond, to=port.to if port else None, notify=notify)
    if isinstance(link, SerialLink):
        respond = _add_echo(respond) if link.echo else respond
        if port is not None and port.device is not None:
            return TtyEndpoint(link, port.device, respond, notify)
        pace_s, capacity = byte_s(link) if paced else 0.0, capacity_text(link)
        return PtyEndpoint(folder / link.name, respond, byte_s=pace_s, capacity_text=capacity, notify=notify)
    if port is not None:
        real_link = link.model_copy(update={"interface": port.interface, "channel": port.device})
        return _bus_endpoint(real_link, respond, notify)
    if link.interface == "slcan":
        return SlcanEndpoint(folder / link.name, respond, bitrate=link.bitrate if paced else None, notify=notify)
    if link.interface not in SHARED_INTERFACES:
        raise MissingError(
            f"link {link.name!r}: interface {link.interface!r} needs CAN hardware, which the emulator does not have; "
            f"it supports {', '.join(SHARED_INTERFACES)}"
        )
    return _bus_endpoint(link, respond, notify)


def _bus_endpoint(link: CanLink, respond: Responder, notify: Notifier) -> Endpoint:
    from fti.hil.ports.canbus import CanBusEndpoint  # noqa: PLC0415  python-can is slow to import

    return CanBusEndpoint(link, respond, notify)


def capacity_text(link: SerialLink) -> str:
    """Capacity of a serial line as text."""
    return f"{link.baud} baud carry {1.0 / byte_s(link):.0f} bytes a second"


def _add_echo(respond: Responder) -> Responder:
    """A responder of a line that echoes its input."""
    return lambda data: [data, *respond(data)]


@contextlib.asynccontextmanager
async def open_endpoints(endpoints: Mapping[str, Endpoint]) -> AsyncIterator[Mapping[str, Endpoint]]:
    """Open the endpoints for the block, then close them."""
    try:
        for endpoint in endpoints.values():
            await endpoint.open()
        yield endpoints
    finally:
        for endpoint in endpoints.values():
            endpoint.close()


async def run_until(work: Coroutine[Any, Any, object], stop: asyncio.Event) -> None:
    """Run the work, and cancel it when ``stop`` is set."""
    tasks = [asyncio.create_task(w, name=f"fti-hil-{n}") for n, w in (("work", work), ("stop", stop.wait()))]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)
    if not tasks[0].cancelled():
        tasks[0].result()


class SlcanEndpoint(PtyEndpoint):
    """A Lawicel adapter on a pty: frames are sent while the host has the channel open.

    bitrate : of the bus [bit/s], which limits the rate; None: no limit
    """

    is_stream: ClassVar[bool] = False

    def __init__(
        self, symlink: Path, respond: Responder, *, bitrate: int | None = None, notify: Notifier = lambda _: None
    ) -> None:
        super().__init__(symlink, self._answer, capacity_text=f"a bus of {bitrate} bit/s carries less", notify=notify)
        self._bitrate = bitrate
        self._frames: list[bytes] = []
        self._adapter = Adapter(self._frames.append)
        self._respond_to_frame = respond

    async def wait_for_reader(self) -> None:
        """Wait until the host has opened the channel."""
        await super().wait_for_reader()
        while not self._adapter.is_open:  # noqa: ASYNC110  polling, as for the reader
            await asyncio.sleep(POLL_S)

    def raise_flags(self, flags: int) -> None:
        """Set flags that the controller reports on the next status request."""
        self._adapter.flags |= flags

    def send(self, data: bytes) -> None:
        """Send a ``can_frame``; drop it when the channel is closed."""
        if not self._adapter.is_open:
            self._drop(len(data))
        elif self._accepts(len(data)):
            duration_s = frame_s(data, self._bitrate) if self._bitrate else 0.0
            self._queue(PacedMessage(format_frame(data), duration_s, whole=True))

    async def send_all(self, data: bytes) -> None:
        """Send a ``can_frame`` without loss."""
        await super().send_all(format_frame(data))

    def _answer(self, data: bytes) -> list[bytes]:
        for answer in self._adapter.feed(data):
            super().send(answer)
        frames, self._frames[:] = list(self._frames), []
        for frame in frames:
            for reply in self._respond_to_frame(frame):
                self.send(reply)
        return []


class UdpEndpoint(DatagramEndpoint):
    """Datagrams from a simulated device.

    to     : address:port of a receiver on another machine, or None
    notify : called once when the network refuses datagrams, such as with a pulled cable
    """

    is_stream: ClassVar[bool] = False

    def __init__(
        self, link: UdpLink, respond: Responder, to: str | None = None, notify: Notifier = lambda _: None
    ) -> None:
        super().__init__()
        self._notify, self._is_cut = notify, False
        self._link = link
        self._respond = respond
        self._is_remote = to is not None
        self._target = split_endpoint(to) if to else _target(link)
        family = socket.AF_INET6 if ":" in self._target[0] else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)

    async def open(self) -> None:
        """Bind to the device's address.  Without ``to`` no datagram leaves this machine."""
        address, port = ("", 0) if self._is_remote else _source(self._link)
        try:
            self._socket.bind((address, port))
        except OSError as error:
            in_use = error.errno == errno.EADDRINUSE
            hint = "another fti hil?" if in_use else "the emulator needs addresses of this machine, such as 127.0.0.1"
            raise MissingError(
                f"link {self._link.name!r}: cannot send as {address}:{port} to {self._target[0]}:{self._target[1]}: "
                f"{error.strerror}; {hint}"
            ) from None
        if self._link.group and not self._is_remote:
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address))
        self._socket.setblocking(False)
        asyncio.get_running_loop().add_reader(self._socket, self._receive)

    async def wait_for_reader(self) -> None:
        """Wait until a program has bound the target port; return at once for another machine."""
        while not self._is_remote and not _is_bound(self._target[1]):  # noqa: ASYNC110  the kernel does not signal it
            await asyncio.sleep(POLL_S)

    async def drain(self) -> None:
        """Return at once: sent datagrams are in the receiver's queue."""

    def close(self) -> None:
        """Close the socket."""
        asyncio.get_running_loop().remove_reader(self._socket)
        self._socket.close()

    def _try_send(self, data: bytes) -> bool:
        try:
            self._socket.sendto(data, self._target)
        except BlockingIOError:
            return False
        except OSError as error:
            if not self._is_cut:
                address, port = self._target
                self._notify(f"{self._link.name}: cannot send to {address}:{port}: {error.strerror}; data are dropped")
            self._is_cut = True
            return False
        self._is_cut = False
        self.counters.messages += 1
        self.counters.bytes += len(data)
        return True

    def _receive(self) -> None:
        with contextlib.suppress(BlockingIOError):
            data = self._socket.recv(65536)
            self.counters.received_bytes += len(data)
            for answer in self._respond(data):
                self.send(answer)


def split_endpoint(text: str) -> tuple[str, int]:
    """``address:port`` (IPv6 in brackets) as a pair."""
    address, _, port = text.rpartition(":")
    return address.strip("[]"), int(port)


def _target(link: UdpLink) -> tuple[str, int]:
    address, port = split_endpoint(link.bind)
    if link.group:
        return link.group, port
    return LOOPBACK_OF.get(address, address), port


def _source(link: UdpLink) -> tuple[str, int]:
    """Source address and port of the simulated device; port 0: any free one."""
    if link.peer:
        return split_endpoint(link.peer)
    bound = _target(link)[0] if not link.group else "127.0.0.1"
    return link.source or bound, 0


def _is_bound(port: int) -> bool:
    """Whether a UDP socket of this machine is bound to the port, according to /proc/net/udp."""
    suffix = f":{port:04X}"
    for table in ("/proc/net/udp", "/proc/net/udp6"):
        with contextlib.suppress(OSError), Path(table).open(encoding="ascii") as lines:
            if any(line.split()[1].endswith(suffix) for line in lines if ":" in line):
                return True
    return False
