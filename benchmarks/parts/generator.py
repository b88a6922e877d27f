"""Sends numbered datagrams to many ports of loopback at a steady rate, many with one system call.

    python -m benchmarks.parts.generator --rate 200000 --seconds 60 PORT...

Each datagram has 95 bytes: its number on this port, when it was sent (CLOCK_MONOTONIC [ns]), and filler.  The ports
take turns.  Prints one line of JSON: number of datagrams sent to each port, and duration.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import json
import os
import socket
import struct
import sys
import time

import numpy as np

SIZE = 95
HEAD = struct.Struct("<Qq")  # number, time sent [ns]
MAX_BATCH = 1024  # limit of one system call
PAUSE_S = 0.0005  # between two calls
PRIORITY = -10


class _Iovec(ctypes.Structure):
    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _Message(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint32),
        ("iov", ctypes.c_void_p),
        ("iov_length", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _MessageHeader(ctypes.Structure):
    _fields_ = (("message", _Message), ("length", ctypes.c_uint))


class DatagramBatch:
    """Messages for the ports in turn, prepared once; before each call only number and time change."""

    def __init__(self, ports: list[int]) -> None:
        self.sent_counts = np.zeros(len(ports), np.uint64)
        self._turn = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._send = ctypes.CDLL(None, use_errno=True).sendmmsg
        rows = MAX_BATCH + len(ports)  # a volley begins with any port
        self._data = np.zeros((rows, SIZE), np.uint8)
        self._data[:] = np.arange(SIZE, dtype=np.uint8)
        self._port = np.arange(rows) % len(ports)
        self._names = b"".join(_address(ports[i]) for i in self._port)
        self._messages = (_MessageHeader * rows)()
        self._vectors = (_Iovec * rows)()
        names = ctypes.cast(ctypes.c_char_p(self._names), ctypes.c_void_p).value or 0
        for i in range(rows):
            self._vectors[i] = _Iovec(self._data.ctypes.data + i * SIZE, SIZE)
            vector = ctypes.addressof(self._vectors[i])
            self._messages[i].message = _Message(names + 16 * i, 16, vector, 1, None, 0, 0)

    def fire(self, count: int) -> None:
        """Send ``count`` messages; waits while the kernel does not accept them."""
        rows = slice(self._turn, self._turn + count)
        ports = self._port[rows]
        turns = np.arange(count) // len(self.sent_counts)
        head = np.empty((count, 2), np.uint64)
        head[:, 0] = self.sent_counts[ports] + turns.astype(np.uint64)
        head[:, 1] = time.monotonic_ns()
        self._data[rows, : HEAD.size] = head.view(np.uint8).reshape(count, HEAD.size)
        done = 0
        while done < count:
            at = ctypes.byref(self._messages, (self._turn + done) * ctypes.sizeof(_MessageHeader))
            taken = self._send(self._socket.fileno(), at, count - done, 0)
            if taken < 0:
                raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
            done += taken
        self.sent_counts += np.bincount(ports, minlength=len(self.sent_counts)).astype(np.uint64)
        self._turn = (self._turn + count) % len(self.sent_counts)


def _address(port: int) -> bytes:
    return struct.pack("=H", socket.AF_INET) + struct.pack(">H4s8x", port, socket.inet_aton("127.0.0.1"))


def send(ports: list[int], rate: float, seconds: float) -> tuple[list[int], float]:
    """Send at that rate [1/s] to all ports together; number of each, and duration [s]."""
    volley, total, done = DatagramBatch(ports), round(rate * seconds), 0
    start = time.monotonic()
    while done < total:
        due = min(int((time.monotonic() - start) * rate) + 1, total)
        while done < due:
            count = min(due - done, MAX_BATCH)
            volley.fire(count)
            done += count
        time.sleep(max(start + done / rate - time.monotonic(), PAUSE_S if rate > 1 / PAUSE_S else 0))
    return volley.sent_counts.tolist(), time.monotonic() - start


def main() -> int:
    """Send, and print the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rate", type=float, required=True, help="messages per second, all ports together")
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("ports", type=int, nargs="+")
    args = parser.parse_args()
    with contextlib.suppress(PermissionError):  # it replaces external devices, which no process here delays
        os.nice(PRIORITY)
    sent_counts, seconds = send(args.ports, args.rate, args.seconds)
    print(json.dumps({"sent": sent_counts, "seconds": seconds}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
