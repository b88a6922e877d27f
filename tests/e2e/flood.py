"""A process that sends numbered datagrams at a steady rate, whether somebody listens or not.

    python -m tests.e2e.flood HOST RATE MEMORY PORT [PORT ...]

The ports take turns.  MEMORY is the descriptor of a memory file, in which it counts what it has sent and notes when
it sent the last ones: a sender that was not let run catches up, so the number alone tells no time.  A datagram is its
link (position of the port), its number on that link, and filling; 60 bytes.  It runs until its standard input ends,
and then prints how many each link got, as a JSON list.
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

from tests.e2e.harness import END_S
from tests.helpers import ROOT

NUMBER = struct.Struct("<IQ")
WORD = struct.Struct("=Q")
#: Of so many datagrams the memory holds the time, behind the counter.
TIMES = 2**18
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
    """The process; ``sent_counts``: datagrams of each link, after ``stop``."""

    def __init__(self, host: str, rate_hz: float, ports: Sequence[int]) -> None:
        self.rate_hz = rate_hz
        self.sent_counts: list[int] = []
        self._links = len(ports)
        fd = os.memfd_create("flood")
        os.ftruncate(fd, (1 + TIMES) * WORD.size)
        self._memory = mmap.mmap(fd, 0)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.e2e.flood", host, str(rate_hz), str(fd), *map(str, ports)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=ROOT,
            pass_fds=[fd],
        )
        os.close(fd)

    def sent_now(self) -> int:
        """How many datagrams it has sent until now."""
        (total,) = WORD.unpack_from(self._memory)
        return int(total)

    def began_ns(self, recorded: Sequence[int], sent: int) -> int | None:
        """When it sent the first of ``sent`` datagrams that is not recorded [monotonic clock, ns].

        recorded : how many of each link are, from its first one on.  None when all of them are; the oldest time that
        is known when the datagram is older than that.
        """
        missing = [number * self._links + link for link, number in enumerate(recorded)]
        oldest = max(min(missing), sent - TIMES)
        (began_ns,) = WORD.unpack_from(self._memory, _time_at(oldest))
        return int(began_ns) if oldest < sent else None

    def stop(self) -> None:
        """End it; nothing is sent any more."""
        if self._process.returncode is None:
            output, _ = self._process.communicate(timeout=END_S)
            self.sent_counts = json.loads(output)
            self._memory.close()


def _time_at(turn: int) -> int:
    """Where in the memory the time of a datagram is."""
    return (1 + turn % TIMES) * WORD.size


def _send(host: str, rate_hz: float, memory: mmap.mmap, ports: Sequence[int]) -> list[int]:
    os.set_blocking(0, False)
    sent = [0] * len(ports)
    addresses = [(host, port) for port in ports]
    begin, total = time.monotonic(), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        while read_stdin() is None:
            due = int((time.monotonic() - begin) * rate_hz)
            for turn in range(total, due):
                link = turn % len(ports)
                WORD.pack_into(memory, _time_at(turn), time.monotonic_ns())
                sock.sendto(NUMBER.pack(link, sent[link]) + FILLING, addresses[link])
                sent[link] += 1
                WORD.pack_into(memory, 0, turn + 1)
            total = due
            time.sleep(PERIOD_S)
    return sent


def read_stdin() -> bytes | None:
    """What came on standard input, which must not block; None when nothing came, b"" at its end."""
    try:
        return os.read(0, 1)
    except BlockingIOError:
        return None


if __name__ == "__main__":
    shared = mmap.mmap(int(sys.argv[3]), 0)
    print(json.dumps(_send(sys.argv[1], float(sys.argv[2]), shared, [int(port) for port in sys.argv[4:]])))
