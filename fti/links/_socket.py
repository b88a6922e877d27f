"""What UDP and SocketCAN have in common: the kernel's time stamp, its drop counter, a receive buffer that is enough.

The kernel stamps a datagram when it arrives, so a busy loop costs no accuracy; ``SO_RXQ_OVFL`` says how many it had to
drop since the socket was made, because nobody read in time.
"""

from __future__ import annotations

import contextlib
import socket
import struct
from itertools import accumulate

from fti.clock import Clock, StampWindow
from fti.links._batch import shared_batch
from fti.links.base import LinkStatus

# Linux, asm-generic/socket.h
SO_RCVBUFFORCE = 33
SO_TIMESTAMPNS = 35
SO_RXQ_OVFL = 40
SO_MEMINFO = 55

RECEIVE_BUFFER = 4 * 2**20
MEMINFO = struct.Struct("@9I")  # linux/sock_diag.h; the last one is the drop counter


def prepare(sock: socket.socket) -> None:
    """Non-blocking, 4 MiB of receive buffer (as much as is allowed), kernel stamps, drop counter."""
    sock.setblocking(False)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    with contextlib.suppress(PermissionError):  # beyond net.core.rmem_max only with CAP_NET_ADMIN
        sock.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BUFFER)
    sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    sock.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)


class Arrival:
    """Reads one socket, a batch at a time, with stamps and drop counter.

    batch : what the last read has brought; drops of earlier sockets stay in the status
    """

    def __init__(self, clock: Clock, status: LinkStatus) -> None:
        self.batch = shared_batch()
        self._clock = clock
        self._status = status
        self._dropped = 0  # of this socket
        self._last_ns = 0

    def read(self, fd: int) -> tuple[list[bytes], list[int]]:
        """What waits in the socket, at most a batch, and its FTI times of arrival [ns].  Raises OSError."""
        batch = self.batch
        if not batch.receive(fd):
            return [], []
        drops = batch.drops()
        if drops is not None:
            self._count_drops(drops)
        return batch.frames(), self._times(batch.stamps())

    def _times(self, stamps: list[int]) -> list[int]:
        """The kernel's stamps as FTI time, never backward.

        Two processors may stamp at once; two windows are as good as two readings of the clocks.
        """
        window = self._clock.stamp_window()
        offset, oldest, newest = window
        if oldest <= min(stamps) and max(stamps) <= newest:
            times = [stamp + offset for stamp in stamps]
        else:
            times = self._doubtful(stamps, window)
        if times[0] < self._last_ns or times != sorted(times):
            times = list(accumulate(times, max, initial=self._last_ns))[1:]
        self._last_ns = times[-1]
        return times

    def _doubtful(self, stamps: list[int], window: StampWindow) -> list[int]:
        """Where a stamp cannot be believed: the time of the next one that can, for it came before, or now."""
        time_ns, times = self._clock.now_ns(), []
        for stamp in reversed(stamps):
            if window.oldest_ns <= stamp <= window.newest_ns:
                time_ns = stamp + window.offset_ns
            else:
                self._status.stamp_refused += 1
            times.append(time_ns)
        return times[::-1]

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
