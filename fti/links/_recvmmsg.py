"""Reads many datagrams with one system call: ``recvmmsg`` and its buffers.

All sockets of a process share one buffer: one thread reads them, and takes the datagrams of a call out before the next
call.  Each datagram has 64 KiB of address space, so none is truncated; memory is allocated only for pages that were
used, one for a short datagram.
"""

from __future__ import annotations

import ctypes
import errno
import functools
import mmap
import os
import socket
import struct
import sys
from collections.abc import Sequence

from fti.constants import SECOND_NS

MAX_DATAGRAMS = 64  # datagrams in a call, so that no link starves another
#: Slot of a datagram; slightly more than its maximum size, so that the first bytes use different cache sets.
SLOT_SIZE_BYTES = 65536 + 192
NAME_BYTES = 32  # the largest address is sockaddr_in6, 28 bytes
CONTROL_BYTES = 64
STAMP_BYTES = socket.CMSG_SPACE(16)  # struct timespec; the kernel puts the stamp first
DROPS_BYTES = STAMP_BYTES + socket.CMSG_SPACE(4)
NO_STAMP = -(2**63)
_SLOT_OFFSETS = range(0, MAX_DATAGRAMS * SLOT_SIZE_BYTES, SLOT_SIZE_BYTES)


class _Vector(ctypes.Structure):
    """struct iovec"""

    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _Message(ctypes.Structure):
    """struct msghdr"""

    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint32),
        ("vectors", ctypes.c_void_p),
        ("vector_count", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _Slot(ctypes.Structure):
    """struct mmsghdr"""

    _fields_ = (("message", _Message), ("length", ctypes.c_uint))


SLOT_BYTES = ctypes.sizeof(_Slot)
_SLOT_WORDS = SLOT_BYTES // 4
_SECONDS = socket.CMSG_LEN(0)
_DROPS = STAMP_BYTES + socket.CMSG_LEN(0)


class ReceiveBatch:
    """The datagrams of one call; all results are valid until the next call."""

    def __init__(self) -> None:
        # PyDLL keeps the GIL: the call never blocks, and releasing the GIL would cost more.
        self._call = ctypes.PyDLL(None, use_errno=True).recvmmsg
        self._data = mmap.mmap(-1, MAX_DATAGRAMS * SLOT_SIZE_BYTES, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        self._names = bytearray(MAX_DATAGRAMS * NAME_BYTES)
        self._control = bytearray(MAX_DATAGRAMS * CONTROL_BYTES)
        self._vectors = (_Vector * MAX_DATAGRAMS)()
        slots = (_Slot * MAX_DATAGRAMS)()
        self._fill(slots)
        self._arguments = ctypes.byref(slots), ctypes.c_uint(MAX_DATAGRAMS), ctypes.c_int(socket.MSG_DONTWAIT), None
        self._slots = memoryview(slots).cast("B").cast("I")
        self._initial_slots = memoryview(bytes(slots)).cast("I")
        self._count = 0
        self._control_lengths: Sequence[int] = ()
        self._flags: Sequence[int] = ()
        self._lengths: Sequence[int] = ()

    def _fill(self, slots: ctypes.Array[_Slot]) -> None:
        data, names, control = (_address(part) for part in (self._data, self._names, self._control))
        for i in range(MAX_DATAGRAMS):
            self._vectors[i] = _Vector(data + i * SLOT_SIZE_BYTES, SLOT_SIZE_BYTES)
            vector = ctypes.addressof(self._vectors[i])
            message = names + i * NAME_BYTES, NAME_BYTES, vector, 1, control + i * CONTROL_BYTES, CONTROL_BYTES, 0
            slots[i].message = _Message(*message)

    def receive(self, fd: int) -> int:
        """Read waiting datagrams of a socket, at most MAX_DATAGRAMS; returns their number.  Raises OSError."""
        if self._count:  # the kernel has overwritten the lengths of the slots
            used = self._count * _SLOT_WORDS
            self._slots[:used] = self._initial_slots[:used]
        count = self._call(fd, *self._arguments)
        self._count = max(count, 0)
        if count > 0:
            words = _slots(count).unpack_from(self._slots)
            self._control_lengths, self._flags, self._lengths = words[::3], words[1::3], words[2::3]
        elif (number := ctypes.get_errno()) != errno.EAGAIN:
            raise OSError(number, os.strerror(number))
        return self._count

    def frames(self) -> Sequence[bytes]:
        """The datagrams."""
        lengths = self._lengths
        if lengths.count(lengths[0]) == self._count:
            return _equal(self._count, lengths[0]).unpack_from(self._data)
        data = self._data
        return [data[at : at + length] for at, length in zip(_SLOT_OFFSETS, lengths, strict=False)]

    def stamps(self, offset_ns: int = 0) -> list[int]:
        """Arrival times: CLOCK_REALTIME + offset [ns]; NO_STAMP without a kernel stamp."""
        words = _stamps(self._count).unpack_from(self._control)
        seconds, nanoseconds = words[::2], words[1::2]
        if seconds.count(seconds[0]) == self._count:
            base = seconds[0] * SECOND_NS + offset_ns
            stamps = [base + ns for ns in nanoseconds]
        else:
            stamps = [s * SECOND_NS + ns + offset_ns for s, ns in zip(seconds, nanoseconds, strict=True)]
        lengths = self._control_lengths
        if min(lengths) < STAMP_BYTES:
            return [t if length >= STAMP_BYTES else NO_STAMP for t, length in zip(stamps, lengths, strict=True)]
        return stamps

    def drops(self) -> int | None:
        """Number of datagrams that the kernel dropped before the last one; None if it dropped none."""
        if self._control_lengths[-1] < DROPS_BYTES:
            return None
        at = (self._count - 1) * CONTROL_BYTES + _DROPS
        return int.from_bytes(self._control[at : at + 4], sys.byteorder)

    def flags(self) -> Sequence[int]:
        """``msg_flags`` of each."""
        return self._flags

    def senders(self) -> list[bytes]:
        """Address of each sender as ``struct sockaddr``."""
        names = bytes(self._names[: self._count * NAME_BYTES])
        return [names[at : at + NAME_BYTES] for at in range(0, len(names), NAME_BYTES)]


@functools.cache
def _slots(count: int) -> struct.Struct:
    """Results of the kernel in so many slots: control length, flags, data length of each."""
    control, flags, length = _Message.control_length.offset, _Message.flags.offset, _Slot.length.offset
    return struct.Struct("@" + f"{control}xNI{length - flags - 4}xI{SLOT_BYTES - length - 4}x" * count)


@functools.cache
def _stamps(count: int) -> struct.Struct:
    """The first stamp in the control bytes of so many datagrams: seconds and nanoseconds of each."""
    return struct.Struct("=" + f"{_SECONDS}xqq{CONTROL_BYTES - _SECONDS - 16}x" * count)


@functools.lru_cache(maxsize=1024)
def _equal(count: int, length: int) -> struct.Struct:
    """Layout of datagrams of one length in the buffer."""
    return struct.Struct(f"{length}s{SLOT_SIZE_BYTES - length}x" * (count - 1) + f"{length}s")


def _address(memory: bytearray | mmap.mmap) -> int:
    return ctypes.addressof(ctypes.c_char.from_buffer(memory))


@functools.cache
def shared_batch() -> ReceiveBatch:
    """The batch of this process, created when the first socket is opened."""
    return ReceiveBatch()
