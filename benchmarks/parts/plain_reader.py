"""Minimum cost of a recorder: asyncio, and for each datagram ``sock.recv`` and ``file.write``.

    python -m benchmarks.parts.plain_reader FILE PORTS [--stamp]

Binds so many free ports of loopback, prints them as one line of JSON, and reads until standard input ends.  With
--stamp each read is written with its time (FTI time, i64) and length (u32) in front: the usual stamp of a user.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import socket
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

STAMPED = struct.Struct("<qI")


def plain(sock: socket.socket, file: BinaryIO) -> Callable[[], None]:
    """A callback that only writes."""
    receive, write = sock.recv, file.write

    def read() -> None:
        write(receive(65536))

    return read


def stamping(sock: socket.socket, file: BinaryIO) -> Callable[[], None]:
    """A callback that stamps what it reads."""
    receive, write, now, pack = sock.recv, file.write, time.monotonic_ns, STAMPED.pack

    def read() -> None:
        data = receive(65536)
        write(pack(now(), len(data)) + data)

    return read


async def run(path: Path, ports: int, stamp: bool) -> None:
    """Read until standard input ends."""
    loop = asyncio.get_running_loop()
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(ports)]
    with path.open("wb") as file:
        for sock in sockets:
            sock.setblocking(False)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 * 2**20)
            sock.bind(("127.0.0.1", 0))
            loop.add_reader(sock, (stamping if stamp else plain)(sock, file))
        print(json.dumps([sock.getsockname()[1] for sock in sockets]), flush=True)
        ended = asyncio.Event()
        loop.add_reader(sys.stdin, ended.set)
        await ended.wait()
        for sock in sockets:
            loop.remove_reader(sock)
            sock.close()


def main() -> None:
    """As a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("ports", type=int)
    parser.add_argument("--stamp", action="store_true")
    args = parser.parse_args()
    asyncio.run(run(args.file, args.ports, args.stamp))


if __name__ == "__main__":
    main()
