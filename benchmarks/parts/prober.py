"""Sends small numbered messages one by one, each with its send time, to measure the delay of its stamp.

    python -m benchmarks.parts.prober --rate 1000 --seconds 10 [--ports PORT...] [--lines FD...]

A message has its number on that path and CLOCK_MONOTONIC [ns], 16 bytes.  Ports of loopback and inherited descriptors
take turns.
"""

from __future__ import annotations

import argparse
import os
import socket
import struct
import time
from collections.abc import Callable

PROBE = struct.Struct("<Qq")


def open_channels(ports: list[int], lines: list[int]) -> list[Callable[[bytes], object]]:
    """Send function of each path."""
    senders: list[Callable[[bytes], object]] = []
    for port in ports:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.connect(("127.0.0.1", port))
        senders.append(sock.send)
    return senders + [lambda data, fd=line: os.write(fd, data) for line in lines]


def probe(sends: list[Callable[[bytes], object]], rate: float, seconds: float) -> None:
    """Send on all paths in turn, at that rate [1/s] together."""
    pack, now = PROBE.pack, time.monotonic_ns
    start = time.monotonic()
    for n in range(round(rate * seconds)):
        number, way = divmod(n, len(sends))
        sends[way](pack(number, now()))
        time.sleep(max(0.0, start + (n + 1) / rate - time.monotonic()))


def main() -> None:
    """As a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rate", type=float, required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--ports", type=int, nargs="*", default=[])
    parser.add_argument("--lines", type=int, nargs="*", default=[])
    args = parser.parse_args()
    probe(open_channels(args.ports, args.lines), args.rate, args.seconds)


if __name__ == "__main__":
    main()
