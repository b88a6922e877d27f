"""Common parts of UDP and SocketCAN: kernel time stamps, drop counter, a large receive buffer.

The kernel stamps a datagram on arrival, so a busy loop costs no accuracy; ``SO_RXQ_OVFL`` counts the datagrams that it
dropped since the socket was created, because its queue was full.
"""

from __future__ import annotations

import contextlib
import socket
import struct
from collections.abc import Sequence
from itertools import accumulate

from fti.clock import Clock, StampWindow
from fti.links._recvmmsg import MAX_DATAGRAMS, shared_batch
from fti.links.base import LinkStatus

# Linux, asm-generic/socket.h
SO_RCVBUFFORCE = 33
SO_TIMESTAMPNS = 35
SO_RXQ_OVFL = 40
SO_MEMINFO = 55

RECEIVE_BUFFER = 4 * 2**20
MEMINFO = struct.Struct("@9I")  # linux/sock_diag.h; first: bytes in the queue, last: drop counter


def enlarge(sock: socket.socket) -> None:
    """Set the receive buffer to 4 MiB, or to the allowed maximum."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    with contextlib.suppress(PermissionError):  # beyond net.core.rmem_max only with CAP_NET_ADMIN
        sock.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BUFFER)


def prepare(sock: socket.socket) -> None:
    """Set non-blocking mode, a large receive buffer, kernel stamps and drop counter."""
    sock.setblocking(False)
    enlarge(sock)
    sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    sock.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)


class Arrival:
    """Reads one socket, a batch at a time, with stamps and drop counter.  Create it before the socket.

    The queue of a socket is FIFO.  A stamp is therefore valid if it is not older than the last frame before it, or than
    the time at which the queue was empty, independent of the time without reading.

    batch : result of the last read; drops of earlier sockets stay in the status
    """

    def __init__(self, clock: Clock, status: LinkStatus) -> None:
        self.batch = shared_batch()
        self._clock = clock
        self._status = status
        self._dropped = 0  # of this socket
        self._last_ns = 0
        self._since_ns = clock.now_ns()  # no queued frame arrived before this [FTI time]

    def read(self, fd: int) -> tuple[Sequence[bytes], Sequence[int]]:
        """Waiting frames of the socket, at most a batch, and their FTI times of arrival [ns], nondecreasing.

        Raises OSError.
        """
        batch = self.batch
        if not batch.receive(fd):
            return (), ()
        if (drops := batch.drops()) is not None:
            self._count_drops(drops)
        offset, oldest, newest = window = self._clock.stamp_window(self._since_ns)
        times = batch.stamps(offset)
        is_valid = oldest <= times[0] - offset and times[-1] - offset <= newest
        if not (is_valid and self._last_ns <= times[0] and times == sorted(times)):
            times = self._repair_times(times, window)
        self._last_ns = self._since_ns = times[-1]
        return batch.frames(), times

    def _repair_times(self, times: list[int], window: StampWindow) -> list[int]:
        """Nondecreasing times: two processors may stamp at once, and windows differ by the error of clock readings.

        An invalid stamp gets the time of the next valid one, which arrived later.  After the last valid one it gets the
        present time if the queue is empty; otherwise the last time, since the queued frames may have valid stamps.
        """
        oldest, newest = window.oldest_ns + window.offset_ns, window.newest_ns + window.offset_ns
        valid = [time if oldest <= time <= newest else None for time in times]
        self._status.stamp_refused += valid.count(None)
        next_ns = self._clock.now_ns() if len(times) < MAX_DATAGRAMS else max(self._last_ns, self._since_ns)
        repaired = []
        for time in reversed(valid):
            next_ns = next_ns if time is None else time
            repaired.append(next_ns)
        return list(accumulate(reversed(repaired), max, initial=self._last_ns))[1:]

    def ask_drops(self, sock: socket.socket) -> None:
        """Read the drop counter: datagrams report only drops before them, and none may follow the last drop."""
        now_ns = self._clock.now_ns()
        with contextlib.suppress(OSError):  # not supported by the kernel
            queued, *_, dropped = MEMINFO.unpack(sock.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, MEMINFO.size))
            self._count_drops(dropped)
            if not queued:
                self._since_ns = now_ns

    def _count_drops(self, total: int) -> None:
        """Update from a value of the counter, which may be old: a queued datagram holds a past value."""
        new = (total - self._dropped) & 0xFFFF_FFFF
        if 0 < new < 2**31:
            self._status.socket_dropped += new
            self._status.dropped_ns = self._clock.now_ns()
            self._dropped = total
