"""UDP: one datagram is one frame, with the kernel's time stamp.

The link is bound to the configured address; it accepts only datagrams of the configured source and counts the others.
A link with a ``group`` is bound to the multicast group at the port of ``bind`` and joins it on the interface with the
address of ``bind``: it receives the group only.  It sends to ``peer``, otherwise to the last sender.
"""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import socket
import struct
from collections.abc import Sequence
from itertools import compress

from fti.clock import Clock
from fti.config import UdpLink as UdpConfig
from fti.config.endpoints import Address, split_endpoint
from fti.errors import ConfigError, LinkError, PortAbsent, PortBusy, PortDenied
from fti.links._beat_scheduler import unwatch, watch
from fti.links._recvmmsg import MAX_DATAGRAMS
from fti.links.base import BaseLink, Sink
from fti.links.ports import ipv4_addresses
from fti.links.sockets import Arrival, prepare

OTHER_SOURCE = "udp_other_source"
#: Position of the host in ``struct sockaddr``.
HOSTS = {socket.AF_INET: slice(4, 8), socket.AF_INET6: slice(8, 24)}


class UdpSocketLink(BaseLink):
    """A UDP socket."""

    def __init__(self, config: UdpConfig, clock: Clock, sink: Sink, on_connect: Sequence[bytes] = ()) -> None:
        super().__init__(config.name, config.transmit, clock, sink, on_connect)
        self._bind = split_endpoint(config.bind)
        self._peer: Address | None = split_endpoint(config.peer) if config.peer else None
        self._family = socket.AF_INET6 if ":" in self._bind[0] else socket.AF_INET
        self._source = _address(config.source, config.name, "source") if config.source else None
        self._source_host = ipaddress.ip_address(self._source).packed if self._source else b""
        self._last_sender: bytes | None = None  # ``struct sockaddr`` of the last sender, if answers go there
        self._keep_last_sender = config.transmit and self._peer is None
        self._group = _group(config.group, config.name) if config.group else None
        self._socket: socket.socket | None = None
        self._fd = -1
        self._arrival = Arrival(clock, self.status)

    @property
    def address(self) -> Address:
        """Local address; the actual port if 0 is configured.  Raises LinkError while the link is down."""
        if self._socket is None:
            raise LinkError(f"link {self.name}: is not open")
        host, port = self._socket.getsockname()[:2]
        return str(host), int(port)

    async def _open(self) -> None:
        host, port = self._bind
        self._arrival = Arrival(self._clock, self.status)
        self._socket = sock = socket.socket(self._family, socket.SOCK_DGRAM)
        self._fd = sock.fileno()
        try:
            prepare(sock)
            if self._group:
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # every listener of a group gets a copy
                sock.bind((self._group, port))
                self._join(sock, self._group)
            else:
                sock.bind((host, port))
        except OSError as error:
            raise self._open_error(error) from None
        watch(self._fd, self._on_readable, is_early=self._is_early if self.urgent else None)

    def _join(self, sock: socket.socket, group: str) -> None:
        """Join the group on the interface of ``bind``; also send to groups through it, with the default TTL of 1."""
        interface = socket.inet_aton(self._bind[0])
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + interface)
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)

    def _open_error(self, error: OSError) -> LinkError:
        host, port = self._bind
        if error.errno == errno.EADDRINUSE:
            return PortBusy(f"{host}:{port}: in use by another program")
        if error.errno in (errno.EACCES, errno.EPERM):
            return PortDenied(f"{host}:{port}: permission denied; ports below 1024 belong to root")
        if error.errno in (errno.EADDRNOTAVAIL, errno.ENODEV):
            present = ", ".join(f"{p.name} ({p.detail})" for p in ipv4_addresses())
            return PortAbsent(f"{host}: is not an address of this machine; present: {present or 'none'}")
        return LinkError(f"{host}:{port}: cannot listen: {error.strerror}")

    def _close(self) -> None:
        if self._socket is None:
            return
        unwatch(self._fd)
        asyncio.get_running_loop().remove_writer(self._fd)
        self._arrival.ask_drops(self._socket)
        self._socket.close()
        self._socket = None

    def _read(self) -> bool:
        frames, times = self._arrival.read(self._fd)
        count = len(frames)
        if frames and self._source:
            frames, times = self._filter_source(frames, times)
        elif frames and self._keep_last_sender:
            self._last_sender = self._arrival.batch.senders()[-1]
        if frames:
            self._receive(frames, times)
        return count == MAX_DATAGRAMS

    def _filter_source(self, frames: Sequence[bytes], times: Sequence[int]) -> tuple[Sequence[bytes], Sequence[int]]:
        """Datagrams of the configured source; the others are counted."""
        host, senders = HOSTS[self._family], self._arrival.batch.senders()
        own = [sender[host] == self._source_host for sender in senders]
        if any(own):
            *_, self._last_sender = compress(senders, own)
        if all(own):
            return frames, times
        self.status.refused += own.count(False)
        self.status.errors[OTHER_SOURCE] = self.status.refused
        return list(compress(frames, own)), list(compress(times, own))

    async def _write(self, data: bytes) -> None:
        peer = self._peer or (self._last_sender and _endpoint_of(self._family, self._last_sender))
        if peer is None:
            raise LinkError(f"link {self.name}: no destination: no peer is configured and nothing was received")
        while self._socket:
            try:
                self._socket.sendto(data, peer)
                return
            except BlockingIOError:
                await self._writable(self._socket.fileno())

    def _check(self) -> None:
        if self._socket:
            self._arrival.ask_drops(self._socket)
        super()._check()

    def _silent_hint(self) -> str:
        address = f"{self._group or self._bind[0]}:{self._bind[1]}"
        if self.status.refused:
            return f"{self.status.refused} datagrams at {address}, none from {self._source}: is the source right?"
        return f"listening at {address} and nothing arrives: is the device on, and does it send to this address?"


def _address(text: str, link: str, key: str) -> str:
    try:
        return str(ipaddress.ip_address(text))
    except ValueError:
        raise ConfigError(f"link {link}: {key} = {text!r}: is not an IP address") from None


def _endpoint_of(family: socket.AddressFamily, address: bytes) -> tuple[str | int, ...]:
    """Python's form of a ``struct sockaddr``."""
    host = socket.inet_ntop(family, address[HOSTS[family]])
    port, flow = struct.unpack_from("!HI", address, 2)
    if family is socket.AF_INET:
        return host, port
    return host, port, flow, struct.unpack_from("=I", address, 24)[0]


def _group(text: str, link: str) -> str:
    group = ipaddress.ip_address(_address(text, link, "group"))
    if group.version != 4 or not group.is_multicast:
        raise ConfigError(f"link {link}: group = {text!r}: allowed are IPv4 multicast groups, 224.0.0.0 and above")
    return str(group)
