"""What UDP and SocketCAN have in common: the kernel's time stamp, its drop counter, a receive buffer that is enough.

The kernel stamps a datagram when it arrives, so a busy loop costs no accuracy; ``SO_RXQ_OVFL`` says how many it had to
drop since the socket was made, because nobody read in time.
"""

from __future__ import annotations

import contextlib
import socket
import struct
from collections.abc import Iterable

from fti.clock import SECOND_NS, Clock
from fti.links.base import LinkStatus

# Linux, asm-generic/socket.h
SO_RCVBUFFORCE = 33
SO_TIMESTAMPNS = 35
SO_RXQ_OVFL = 40
SO_MEMINFO = 55

RECEIVE_BUFFER = 4 * 2**20
BATCH = 64  # datagrams per call of the loop, so that no link starves another
TIMESPEC = struct.Struct("@ll")
DROPS = struct.Struct("@I")
MEMINFO = struct.Struct("@9I")  # linux/sock_diag.h; the last one is the drop counter
ANCILLARY_BYTES = socket.CMSG_SPACE(TIMESPEC.size) + socket.CMSG_SPACE(DROPS.size)

Ancillary = Iterable[tuple[int, int, bytes]]


def prepare(sock: socket.socket) -> None:
    """Non-blocking, 4 MiB of receive buffer (as much as is allowed), kernel stamps, drop counter."""
    sock.setblocking(False)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    with contextlib.suppress(PermissionError):  # beyond net.core.rmem_max only with CAP_NET_ADMIN
        sock.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BUFFER)
    sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    sock.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)


class Arrival:
    """Reads stamps and drop counters of one socket; ``dropped`` frames of earlier sockets are kept in the status."""

    def __init__(self, clock: Clock, status: LinkStatus) -> None:
        self._clock = clock
        self._status = status
        self._dropped = 0  # of this socket

    def time_ns(self, ancillary: Ancillary) -> int:
        """FTI time of arrival [ns] of what was just read: the kernel's stamp, or now when it cannot be believed."""
        stamp = None
        for _, kind, data in ancillary:
            if kind == SO_TIMESTAMPNS:
                seconds, nanoseconds = TIMESPEC.unpack(data)
                stamp = self._clock.from_realtime_ns(seconds * SECOND_NS + nanoseconds)
            elif kind == SO_RXQ_OVFL:
                self._count_drops(DROPS.unpack(data)[0])
        if stamp is None:
            self._status.stamp_refused += 1
            return self._clock.now_ns()
        return stamp

    def ask_drops(self, sock: socket.socket) -> None:
        """Ask for the drop counter: a datagram tells of those before it, and behind the last drop none may come."""
        with contextlib.suppress(OSError):  # a kernel without it
            self._count_drops(MEMINFO.unpack(sock.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, MEMINFO.size))[-1])

    def _count_drops(self, total: int) -> None:
        """The counter as the kernel had it at some time: a datagram from the queue tells of the past."""
        fresh = (total - self._dropped) & 0xFFFF_FFFF
        if fresh < 2**31:
            self._status.socket_dropped += fresh
            self._dropped = total
