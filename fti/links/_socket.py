"""What UDP and SocketCAN have in common: the kernel's time stamp, its drop counter, a receive buffer that is enough.

The kernel stamps a datagram when it arrives, so a busy loop costs no accuracy; ``SO_RXQ_OVFL`` says how many it had to
drop since the socket was made, because nobody read in time.
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
MEMINFO = struct.Struct("@9I")  # linux/sock_diag.h; the first one is what the queue holds, the last the drop counter


def enlarge(sock: socket.socket) -> None:
    """4 MiB of receive buffer, or as much as is allowed."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    with contextlib.suppress(PermissionError):  # beyond net.core.rmem_max only with CAP_NET_ADMIN
        sock.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BUFFER)


def prepare(sock: socket.socket) -> None:
    """Non-blocking, a large receive buffer, kernel stamps, drop counter."""
    sock.setblocking(False)
    enlarge(sock)
    sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    sock.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)


class Arrival:
    """Reads one socket, a batch at a time, with stamps and drop counter.  To be made before the socket is.

    The queue of a socket hands out in order.  So a stamp is believed that is not older than the last frame before it,
    or than the moment at which the queue was seen empty, however long nobody has read.

    batch : what the last read has brought; drops of earlier sockets stay in the status
    """

    def __init__(self, clock: Clock, status: LinkStatus) -> None:
        self.batch = shared_batch()
        self._clock = clock
        self._status = status
        self._dropped = 0  # of this socket
        self._last_ns = 0
        self._since_ns = clock.now_ns()  # nothing that waits in the queue has arrived before [FTI time]

    def read(self, fd: int) -> tuple[Sequence[bytes], Sequence[int]]:
        """What waits in the socket, at most a batch, and its FTI times of arrival [ns], never backward.

        Raises OSError.
        """
        batch = self.batch
        if not batch.receive(fd):
            return (), ()
        if (drops := batch.drops()) is not None:
            self._count_drops(drops)
        offset, oldest, newest = window = self._clock.stamp_window(self._since_ns)
        times = batch.stamps(offset)
        believed = oldest <= times[0] - offset and times[-1] - offset <= newest
        if not (believed and self._last_ns <= times[0] and times == sorted(times)):
            times = self._repair_times(times, window)
        self._last_ns = self._since_ns = times[-1]
        return batch.frames(), times

    def _repair_times(self, times: list[int], window: StampWindow) -> list[int]:
        """In order: two processors may stamp at once, and two windows are as good as two readings of the clocks.

        Where a stamp cannot be believed: the time of the next one that can, for it came before.  Behind the last of
        them it is now, when the queue is empty; else no later than those that still wait, whose stamps may be believed.
        """
        oldest, newest = window.oldest_ns + window.offset_ns, window.newest_ns + window.offset_ns
        believed = [time if oldest <= time <= newest else None for time in times]
        self._status.stamp_refused += believed.count(None)
        next_ns = self._clock.now_ns() if len(times) < MAX_DATAGRAMS else max(self._last_ns, self._since_ns)
        mended = []
        for time in reversed(believed):
            next_ns = next_ns if time is None else time
            mended.append(next_ns)
        return list(accumulate(reversed(mended), max, initial=self._last_ns))[1:]

    def ask_drops(self, sock: socket.socket) -> None:
        """Ask for the drop counter: a datagram tells of those before it, and behind the last drop none may come."""
        now_ns = self._clock.now_ns()
        with contextlib.suppress(OSError):  # a kernel without it
            held, *_, dropped = MEMINFO.unpack(sock.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, MEMINFO.size))
            self._count_drops(dropped)
            if not held:
                self._since_ns = now_ns

    def _count_drops(self, total: int) -> None:
        """The counter as the kernel had it at some time: a datagram from the queue tells of the past."""
        fresh = (total - self._dropped) & 0xFFFF_FFFF
        if 0 < fresh < 2**31:
            self._status.socket_dropped += fresh
            self._status.dropped_ns = self._clock.now_ns()
            self._dropped = total
