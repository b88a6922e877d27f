"""A process that sends numbered datagrams at a steady rate, whether somebody listens or not.

    python -m tests.e2e.flood HOST RATE COUNTER PORT [PORT ...]

The ports take turns.  COUNTER is the descriptor of a memory file, in which it counts what it has sent.  A datagram is
its link (position of the port), its number on that link, and filling; 60 bytes.  It runs until its standard input
ends, and then prints how many each link got, as a JSON list.
"""

from __future__ import annotations

import json
import mmap
import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Sequence

from tests.helpers import ROOT

NUMBER = struct.Struct("<IQ")
COUNTER = struct.Struct("=Q")
FILLING = bytes(range(48))
SIZE = NUMBER.size + len(FILLING)
PERIOD_S = 0.001


def parse(data: bytes) -> tuple[int, int]:
    """Link and number of a datagram, whose filling must be whole."""
    assert data[NUMBER.size :] == FILLING, data
    link, number = NUMBER.unpack_from(data)
    return link, number


def free_ports(host: str, count: int) -> list[int]:
    """UDP ports of an address of loopback, which nobody has now."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    for sock in sockets:
        sock.bind((host, 0))
    ports = [sock.getsockname()[1] for sock in sockets]
    for sock in sockets:
        sock.close()
    return ports


class Flood:
    """The process; ``sent`` tells of each link when it has been stopped."""

    def __init__(self, host: str, rate_hz: float, ports: Sequence[int]) -> None:
        self.rate_hz = rate_hz
        self.sent: list[int] = []
        self._links = len(ports)
        fd = os.memfd_create("flood")
        os.ftruncate(fd, COUNTER.size)
        self._counter = mmap.mmap(fd, COUNTER.size)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.e2e.flood", host, str(rate_hz), str(fd), *map(str, ports)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=ROOT,
            pass_fds=[fd],
        )
        os.close(fd)

    def sent_now(self) -> list[int]:
        """How many each link has got until now."""
        (total,) = COUNTER.unpack(self._counter)
        return [len(range(link, total, self._links)) for link in range(self._links)]

    def stop(self) -> None:
        """End it; nothing is sent any more."""
        if self._process.returncode is None:
            said, _ = self._process.communicate(timeout=30)
            self.sent = json.loads(said)


def _send(host: str, rate_hz: float, counter: mmap.mmap, ports: Sequence[int]) -> list[int]:
    os.set_blocking(0, False)
    sent = [0] * len(ports)
    addresses = [(host, port) for port in ports]
    begin, total = time.monotonic(), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        while said() is None:
            due = int((time.monotonic() - begin) * rate_hz)
            for turn in range(total, due):
                link = turn % len(ports)
                sock.sendto(NUMBER.pack(link, sent[link]) + FILLING, addresses[link])
                sent[link] += 1
                COUNTER.pack_into(counter, 0, turn + 1)
            total = due
            time.sleep(PERIOD_S)
    return sent


def said() -> bytes | None:
    """What came on standard input, which must not block; None when nothing came, b"" at its end."""
    try:
        return os.read(0, 1)
    except BlockingIOError:
        return None


if __name__ == "__main__":
    memory = mmap.mmap(int(sys.argv[3]), COUNTER.size)
    print(json.dumps(_send(sys.argv[1], float(sys.argv[2]), memory, [int(port) for port in sys.argv[4:]])))
